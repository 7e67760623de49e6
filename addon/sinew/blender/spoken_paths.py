"""What people call a property, from Blender's path of it. Imports no bpy."""

import re

NAME = r'\["((?:[^"\\]|\\.)*)"\]'  # escaped
_OWNERS = (("bones", "bone"), ("constraints", "constraint"), ("modifiers", "modifier"), ("key_blocks", "shape key"))
_OF_OWNER = [(re.compile(rf"^(?:pose\.|data\.)?{many}{NAME}\.?"), one) for many, one in _OWNERS]
_CUSTOM = re.compile(rf"^{NAME}$")


def spoken(path: str) -> str:
    """Returns what people call a property, to stand within a sentence: `pose.bones["hip"].constraints["IK"].influence`
    is `Influence of the constraint "IK" of the bone "hip"`."""
    rest = path
    owners: list[str] = []
    while (owner := next(filter(None, (_match(each, rest) for each in _OF_OWNER)), None)) is not None:
        text, end = owner
        owners.insert(0, text)
        rest = rest[end:]
    custom = _CUSTOM.match(rest)
    if custom:
        what = f'the property "{_unescaped(custom[1])}"'
    elif re.fullmatch(r"(data\.)?\w+", rest):
        what = rest.removeprefix("data.").replace("_", " ").title()
    else:
        return path
    return " ".join((what, *owners))


def _match(of_owner: tuple[re.Pattern[str], str], path: str) -> tuple[str, int] | None:
    pattern, kind = of_owner
    found = pattern.match(path)
    return (f'of the {kind} "{_unescaped(found[1])}"', found.end()) if found else None


def _unescaped(name: str) -> str:
    return re.sub(r"\\(.)", r"\1", name)


# Paths of what belongs to bones, wherever they stand in a sentence.
_IN_TEXT = re.compile(rf"\b(?:pose|data)\.bones{NAME}(?:\.\w+|{NAME})*(?:\[\d+\])?")


def in_words(text: str) -> str:
    """Returns a sentence with paths of bones' properties replaced by what people call them."""
    return _IN_TEXT.sub(lambda match: spoken(match[0]), text)
