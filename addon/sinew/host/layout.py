"""Where the members of Blender's structs lie in memory, read from Blender's own description.

Every .blend file begins with a description (the "DNA") of the structs of the Blender that wrote it. An empty
library written by the running Blender thus tells the layout of this very build: no offset stands in our code.
"""

import contextlib
import ctypes
import functools
import os
import struct
import tempfile
from dataclasses import dataclass

import bpy

POINTER = 8


@dataclass(frozen=True)
class Struct:
    size: int
    members: dict  # name -> (offset, type, size in bytes); a pointer's name begins with "*"

    def offset(self, name):
        return self.members[name][0]

    def padding(self):
        """Offset of a byte that Blender leaves alone, or None."""
        spare = [offset for name, (offset, _type, _size) in self.members.items() if name.lstrip("*").startswith("_pad")]
        return spare[0] if spare else None


@contextlib.contextmanager
def temporary_data():
    """Data apart from those of the open file, which go with the context.

    Blender's own context (3.4 to 5.2) gives away the one reference that it has to them, and lets go of it again when
    it is freed. The name behind `as` would then stand for freed memory, and the next object there would be damaged.
    """
    with bpy.data.temp_data() as data:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(data))
        yield data


@functools.lru_cache(maxsize=1)
def structs():
    """{name: Struct} of the running Blender. To be called from the main thread first: it writes a file."""
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "layout.blend")
        with temporary_data() as data:
            data.libraries.write(path, {data.texts.new("")}, compress=False)  # 4.2 crashes on an empty set
        with open(path, "rb") as file:
            return parse(file.read())


def parse(data):
    """{name: Struct} from the bytes of an uncompressed .blend file of a little-endian machine."""
    place = data.index(b"SDNA", data.index(b"DNA1"))

    def after(tag):
        return data.index(tag, place) + len(tag)

    def words(place):
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
