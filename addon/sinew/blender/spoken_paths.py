"""What people call a property, from Blender's path of it. Imports no bpy."""

import re

NAME = r'\["((?:[^"\\]|\\.)*)"\]'  # escaped
_PART = re.compile(rf"(?:(\w+)(?:{NAME}|\[(\d+)\])?|{NAME})(?:\.|(?=\[)|$)")
_ONES = {"vertices": "vertex", "key_blocks": "shape key", "data": "point"}
_WHATS = {"co": "Position"}
_OF_B_BONES = re.compile(r"(?<=bbone_)(roll|ease|scale|curve)(in|out)([xz]?)$")


def spoken(path: str) -> str:
    """Returns what people call a property, to stand within a sentence: `pose.bones["hip"].constraints["IK"].influence`
    is `Influence of the constraint "IK" of the bone "hip"`, and `vertices[7].co` is `Position of vertex 7`."""
    owners: list[str] = []
    end = 0
    while (part := _PART.match(path, end)) is not None:
        word, name, index, custom = part.groups()
        end = part.end()
        if custom is not None or (name is not None and word in ("pose", "data")):
            what = f'the property "{_unescaped(name or custom)}"'
        elif name is not None:
            what = f'the {_one_of(word)} "{_unescaped(name)}"'
        elif end == len(path):
            what = _WHATS.get(word) or _titled(word) + (f" {index}" if index else "")
        elif index is not None:
            what = f"{_one_of(word)} {index}"
        elif word in ("pose", "data"):
            continue
        else:
            what = f"the {word.replace('_', ' ')}"
        owners.insert(0, what)
        if end == len(path):
            return " of ".join(owners)
    return path


def _titled(word: str) -> str:
    parts = _OF_B_BONES.sub(r"\1 \2 \3", word).replace("bbone", "b-bone")
    return parts.replace("_", " ").strip().title()


def _one_of(collection: str) -> str:
    """Returns what one element of a collection is called, from the collection's name."""
    one = _ONES.get(collection) or collection.removesuffix("s")
    return one.replace("_", " ")


def _unescaped(name: str) -> str:
    return re.sub(r"\\(.)", r"\1", name)


# Paths of what belongs to bones, wherever they stand in a sentence.
_IN_TEXT = re.compile(rf"\b(?:pose|data)\.bones{NAME}(?:\.\w+|{NAME})*(?:\[\d+\])?")


def in_words(text: str) -> str:
    """Returns a sentence with paths of bones' properties replaced by what people call them."""
    return _IN_TEXT.sub(lambda match: spoken(match[0]), text)
