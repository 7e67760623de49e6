"""Reads the memory layout of Blender's structs from Blender's own description.

Every .blend file contains a description (the "DNA") of the structs of the Blender that wrote it. A nearly empty library
written by the running Blender therefore contains the layout of exactly this build, and no offset is hard-coded here.
"""

import contextlib
import ctypes
import functools
import os
import struct
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass

import bpy

from .members import POINTER


@dataclass(frozen=True)
class Struct:
    """Describes the layout of one of Blender's structs."""

    size: int  # in bytes
    members: dict[str, tuple[int, str, int]]  # name: (offset, type, size), in bytes; a pointer's name begins with "*"

    def offset(self, name: str) -> int:
        """Returns the offset of a member, in bytes."""
        return self.members[name][0]

    def padding(self) -> int | None:
        """Returns the offset of a byte that Blender does not use, or None."""
        spare = [offset for name, (offset, _type, _size) in self.members.items() if name.lstrip("*").startswith("_pad")]
        return spare[0] if spare else None


@contextlib.contextmanager
def temporary_data() -> Iterator[bpy.types.BlendData]:
    """Provides temporary data, separate from the open file's, which Blender removes when the context ends.

    Blender's own context manager (3.4 to 5.2) hands out its only reference to the data and releases it again when it is
    freed. The name after `as` would then refer to freed memory, and the next object there would be damaged.
    """
    with bpy.data.temp_data() as data:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(data))
        yield data


@functools.lru_cache(maxsize=1)
def structs() -> dict[str, Struct]:
    """Returns {name: Struct} for the running Blender. The first call must come from the main thread, because it makes
    Blender write a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "layout.blend")
        with temporary_data() as data:
            data.libraries.write(path, {data.texts.new("")}, compress=False)  # 4.2 crashes on an empty set
        with open(path, "rb") as file:
            return parse(file.read())


def parse(data: bytes) -> dict[str, Struct]:
    """Returns {name: Struct} from the bytes of an uncompressed .blend file of a little-endian machine."""
    place = data.index(b"SDNA", data.index(b"DNA1"))

    def after(tag: bytes) -> int:
        return data.index(tag, place) + len(tag)

    def words(place: int) -> tuple[list[str], int]:
        (count,) = struct.unpack_from("<I", data, place)
        parts = data[place + 4 :].split(b"\0", count)[:count]
        return [part.decode() for part in parts], place + 4 + sum(map(len, parts)) + count

    names, place = words(after(b"NAME"))
    types, place = words(after(b"TYPE"))
    place = after(b"TLEN")
    sizes = struct.unpack_from(f"<{len(types)}H", data, place)
    place = after(b"STRC")
    (count,) = struct.unpack_from("<I", data, place)
    place += 4
    found = {}
    for _ in range(count):
        kind, member_count = struct.unpack_from("<HH", data, place)
        pairs = struct.unpack_from(f"<{2 * member_count}H", data, place + 4)
        place += 4 + 4 * member_count
        offset, members = 0, {}
        for member_type, name in zip(pairs[::2], pairs[1::2]):
            name, *lengths = names[name].replace("]", "").split("[")
            size = POINTER if name[0] in "*(" else sizes[member_type]
            for length in lengths:
                size *= int(length)
            members[name] = (offset, types[member_type], size)
            offset += size
        found[types[kind]] = Struct(sizes[kind], members)
    return found
