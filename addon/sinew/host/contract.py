"""Checks what Sinew expects of Blender's memory (members.py, features.py) against the running Blender's own
description, and tells which features this Blender does without.

A feature is lost if a member that it needs differs, or if what was read differs from what Blender's API says
(distrust). The others work as ever. All are lost while Sinew may not use Blender's memory at all (forbid).
"""

import ctypes
import functools
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

import bpy

from . import features, layout, members

_T = TypeVar("_T")


class Broken(RuntimeError):
    """Raised if a part of Blender's memory is not what Sinew expects."""


def lost(structs: dict[str, layout.Struct]) -> dict[str, list[str]]:
    """Returns {feature: what it needs that differs, as clauses} for the features that cannot work with a description.
    structs: as returned by layout.structs."""
    found = {}
    for feature in features.FEATURES:
        wanted: dict[str, list[str]] = {}
        for kind, name in features.needs(feature):
            wanted.setdefault(kind, []).append(name)
        for kind in features.structs(feature):
            wanted.setdefault(kind, [])
        clauses = [
            each for kind, names in wanted.items() for each in members.differences(structs.get(kind), kind, names)
        ]
        if clauses:
            found[feature] = clauses
    return found


def differences(structs: dict[str, layout.Struct]) -> list[str]:
    """Returns all parts of the description that differ from what any feature needs, as clauses."""
    return list(dict.fromkeys(clause for clauses in lost(structs).values() for clause in clauses))


# --- of the running Blender -----------------------------------------------------------------------


_kept: list[Any] = []


def kept(function: Callable[..., _T]) -> "functools._lru_cache_wrapper[_T]":
    """Decorates a function whose results follow from what is found out here: they are kept until `forget`."""
    cached = functools.cache(function)
    _kept.append(cached)
    return cached


class _Known(NamedTuple):
    """What is known of the running Blender."""

    structs: dict[str, layout.Struct]
    lost: dict[str, list[str]]  # as returned by `lost`, and what was distrusted since
    wrong: dict[tuple[str, str], str]  # of (struct, member): why it is distrusted, a clause


_known: _Known | None = None  # None: not looked at yet
_forbidden: tuple[str, str] | None = None  # why nothing may be used, and what to do about it, as clauses
_losses = 0  # how many times something was distrusted
_compared: set[tuple[str, str]] = set()  # (struct, member): has the value that the API shows


def has(feature: str) -> bool:
    """Whether a feature works in this Blender. The first call of any function here must come from the main thread,
    because it makes Blender write a file."""
    own = _look().lost
    return not own or not _is_lost(feature, own)


def _is_lost(feature: str, own: dict[str, list[str]]) -> bool:
    return feature in own or any(_is_lost(each, own) for each in features.FEATURES[feature].also)


def why_not(feature: str) -> str:
    """Returns why a feature does not work in this Blender and what happens instead, a sentence for users; "" if it
    works."""
    own = _look().lost
    cause = feature
    while own and cause not in own:
        cause = next((each for each in features.FEATURES[cause].also if _is_lost(each, own)), "")
        if not cause:
            return ""
    return _sentence(own[cause], [cause]) if own else ""


def sentences() -> list[str]:
    """Returns what of this Blender Sinew does not know, and what happens because of it: a sentence for each
    difference."""
    own = _look().lost
    if features.DEFORMING in own:
        return [why_not(features.DEFORMING)]
    by_cause: dict[tuple[str, ...], list[str]] = {}
    for feature in features.FEATURES:
        if feature in own:
            by_cause.setdefault(tuple(own[feature]), []).append(feature)
    return [_sentence(clauses, lacking) for clauses, lacking in by_cause.items()]


def trouble() -> str:
    """Returns why Blender's own modifiers must deform all meshes, as a sentence for users; "" if nothing is wrong."""
    return why_not(features.DEFORMING)


def is_broken() -> bool:
    """Whether there is such trouble. False if nothing has been checked yet. Can be called from any thread."""
    return _known is not None and features.DEFORMING in _known.lost


def forbid(reason: str, cure: str) -> None:
    """Does without all features from now on. reason: why, cure: what to do about it, clauses."""
    global _forbidden
    _forbidden = reason, cure
    forget()
    _look()


def permit() -> None:
    """Undoes `forbid`. The next use looks at the running Blender."""
    global _forbidden
    if _forbidden is not None:
        _forbidden = None
        forget()


def is_forbidden() -> bool:
    """Whether Sinew may use nothing of Blender's memory."""
    return _forbidden is not None


def off() -> list[str]:
    """Returns the features that this Blender does without."""
    return features.lost_with(_look().lost)


def losses() -> int:
    """Returns a number that changes when a feature is lost while Blender runs, so that plans have to be made again."""
    return _losses


def distrust(feature: str, difference: str) -> Broken:
    """Does without a feature from now on. difference: a clause. Returns the error to raise."""
    global _losses
    own = _look().lost
    if feature not in own:
        own[feature] = [difference]
        _losses += 1
    return Broken(why_not(feature))


def distrust_member(kind: str, name: str, difference: str) -> Broken:
    """Does without all features that need a member from now on. difference: a clause. Returns the error to raise."""
    own = features.users(kind, name)
    _look().wrong[kind, name] = difference
    for function in (holds, offset):
        function.cache_clear()
    return [distrust(feature, difference) for feature in own][0]


def forget() -> None:
    """Discards all that was found out, so that the next use checks again."""
    global _known, _losses
    _known = None
    _losses += 1
    _compared.clear()
    for function in _kept:
        function.cache_clear()


def _look() -> _Known:
    global _known
    if _known is None and _forbidden is not None:
        _known = _Known({}, {feature: [_forbidden[0]] for feature in features.FEATURES}, {})
    if _known is None:
        try:
            structs = layout.structs()
            _known = _Known(structs, lost(structs), {})
        except Exception as error:  # kept, because it would fail again for each mesh and frame
            clause = f"its description of its data cannot be read: {error}"
            _known = _Known({}, {feature: [clause] for feature in features.FEATURES}, {})
    return _known


def _sentence(found: Sequence[str], lacking: Sequence[str]) -> str:
    """found: differences, as clauses; lacking: features."""
    more = f", and {len(found) - 1} more" if len(found) > 1 else ""
    without = "; ".join(features.FEATURES[feature].without for feature in lacking)
    if _forbidden is not None:
        return f"{_forbidden[0]}, so {without}: {_forbidden[1]}"
    return (
        f"Blender {bpy.app.version_string} keeps its data in another way than this version of Sinew knows "
        f"({found[0]}{more}), so {without}: look for a newer Sinew"
    )


@kept
def holds(kind: str, name: str) -> bool:
    """Whether a member is what Sinew expects."""
    try:
        _of(kind, name)
    except Broken:
        return False
    return True


def _of(kind: str, name: str) -> layout.Struct:
    """Returns the struct with that member. Raises KeyError if it is in no list, and Broken if it differs."""
    if name not in (members.UNUSED, members.PLACE):
        members.MEMBERS[kind][name]
    known = _look()
    found = known.wrong.get((kind, name)) or "".join(members.differences(known.structs.get(kind), kind, [name])[:1])
    if found:
        raise Broken(_sentence([found], features.users(kind, name)[:1]))
    return known.structs[kind]


@kept
def offset(kind: str, name: str) -> int:
    """Returns the offset of a member in its struct, in bytes. Raises KeyError if it is not in the list, and Broken if
    it differs."""
    return _of(kind, name).offset(name)


@kept
def size(kind: str, name: str) -> int:
    """Returns the size of a member, in bytes. Raises what `offset` raises."""
    return _of(kind, name).members[name][2]


@kept
def struct_size(kind: str) -> int:
    """Returns the size of a struct, in bytes. Raises KeyError if it is not in the list."""
    members.MEMBERS[kind]
    return _look().structs[kind].size


@kept
def plain_regions(kind: str, *without: str) -> list[tuple[int, int]]:
    """Returns [(offset, size)] in bytes of all that a struct contains except addresses, and some members."""
    members.MEMBERS[kind]
    found: list[tuple[int, int]] = []
    for offset, size in _plain(_look().structs, kind, 0, *without):
        if found and sum(found[-1]) == offset:
            found[-1] = found[-1][0], found[-1][1] + size
        else:
            found.append((offset, size))
    return found


def _plain(structs: dict[str, layout.Struct], kind: str, start: int, *without: str) -> Iterator[tuple[int, int]]:
    for name, (offset, of_type, size) in structs[kind].members.items():
        if name[0] in "*(" or name in without:
            continue
        if of_type in structs:
            for place in range(offset, offset + size, structs[of_type].size):
                yield from _plain(structs, of_type, start + place)
        else:
            yield start + offset, size


@kept
def unused_byte(kind: str) -> int:
    """Returns the offset in a struct of a byte that Blender does not use. Raises KeyError if no feature needs one, and
    Broken if there is none."""
    if not features.users(kind, members.UNUSED):
        raise KeyError(kind)
    found: Any = _of(kind, members.UNUSED).padding()  # an int: there is one
    return found


@kept
def place() -> tuple[str, int]:
    """Returns the name of the member of Object that contains its matrix to world space, or the address that leads to
    it; and the member's offset in bytes. Raises what `offset` raises."""
    found = _of("Object", members.PLACE)
    name: Any = members.place_in(found)  # a str: there is one
    return name, found.offset(name)


def region(struct: bpy.types.bpy_struct, kind: str, name: str) -> tuple[int, int]:
    """Returns the address of a member and its size in bytes. struct: any of Blender's structs; kind: its name in
    Blender's description. Raises what `offset` raises, and Broken if the member has another value than in the API."""
    found = struct.as_pointer() + offset(kind, name), size(kind, name)
    if (kind, name) not in _compared:
        _compare(struct, kind, name, found[0])
    return found


def _compare(struct: Any, kind: str, name: str, address: int) -> None:
    """Compares the value of a member with what the API shows, if it shows it."""
    member = members.MEMBERS[kind][name]
    if member.shown and hasattr(struct, member.shown):
        if not _is_shown(struct, member.shown, _value_at(address, member)):
            raise distrust_member(kind, name, f"{kind}.{name} is not where it was")
    _compared.add((kind, name))


_NUMBERS: dict[Any, Any] = {
    ("int", 4): ctypes.c_int32,
    ("short", 2): ctypes.c_int16,
    ("char", 1): ctypes.c_int8,
    ("float", 4): ctypes.c_float,
}


def _value_at(address: int, member: members.Member) -> Any:
    number = _NUMBERS.get((member.type, member.size))
    if number is not None:
        return number.from_address(address).value
    if member.type == "char":
        return ctypes.string_at(address, member.size or 0).partition(b"\0")[0]
    return address_at(address)


def _is_shown(struct: Any, name: str, found: Any) -> bool:
    """Whether a property of a struct has the value that was found in memory."""
    shown, rna = getattr(struct, name), struct.bl_rna.properties[name]
    if rna.type == "ENUM":
        item = rna.enum_items.get(shown)
        return item is None or found == item.value  # a damaged file may have a choice that there is not
    if rna.type == "POINTER":
        return found == (shown.as_pointer() if shown is not None else 0)
    if rna.type == "STRING":
        return found == shown.encode()
    return found == shown or found != found and shown != shown  # also if both are not numbers


def address_at(address: int) -> int:
    """Returns the address that is stored at an address."""
    return ctypes.c_uint64.from_address(address).value
