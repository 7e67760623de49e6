"""What Blender's API hands over one by one, read and written whole in Blender's own memory.

Addresses are asked for anew on each evaluation and never kept. Offsets are those of the running Blender (layout.py).
Weights are compared with what the API says of some vertices, once (`deform_vertices`), and read through it where the
two do not agree; a pose is refused if its bones or segments are not as many as expected (`read_pose`).
"""

import ctypes
import functools

import numpy as np
from mathutils import Matrix

from ..native import sinew_native
from . import layout

host = sinew_native.host
_SEEN = 0x53  # what a mark is
_MOST_GROUPS = 1 << 20
_DEFORM_VERTICES = 2  # Blender's number for that kind of data on vertices


def _address_at(address):
    return ctypes.c_uint64.from_address(address).value


def region(struct, kind, member):
    """(address, size) of a member, in bytes. struct: anything of Blender's with an address; kind: its name there."""
    offset, _type, size = layout.structs()[kind].members[member]
    return struct.as_pointer() + offset, size


# --- marks ----------------------------------------------------------------------------------------

_STRUCT_OF = {"OBJECT": "Object", "MESH": "Mesh", "KEY": "Key", "ARMATURE": "bArmature"}


@functools.cache
def _mark_offset(kind):
    return layout.structs()[_STRUCT_OF[kind]].padding()


def _mark(block, kind):
    return ctypes.c_uint8.from_address(mark_region(block, kind)[0])


def mark_region(block, kind):
    """(address, size) of the mark, in bytes."""
    return block.as_pointer() + _mark_offset(kind), 1


def take_mark(block, kind):
    """Whether an evaluated data-block is the copy that was seen last; it counts as seen from now on. The mark is a
    byte that Blender does not use, so it goes when Blender copies the block anew: after an edit.

    An original has none, unless it was made from an evaluated copy (`evaluated.data.copy()`) or comes from a file: all
    its copies would be marked from the beginning. It is healed."""
    byte, of_original = _mark(block, kind), _mark(block.original, kind)
    seen = byte.value == _SEEN and of_original.value == 0
    of_original.value = 0
    byte.value = _SEEN
    return seen


def is_marked(block, kind):
    return _mark(block, kind).value == _SEEN


def clear_mark(block, kind):
    _mark(block, kind).value = 0


def origin_region(block):
    """(address, size) of what says of which original an evaluated data-block is the copy."""
    return region(block, "ID", "*orig_id")


# --- weights --------------------------------------------------------------------------------------


def group_names(mesh):
    """Names of the vertex groups of that very copy of a mesh."""
    first = _address_at(region(mesh, "Mesh", "vertex_group_names")[0])
    offset, _type, size = layout.structs()["bDeformGroup"].members["name"]
    addresses = host.list_addresses(first, _MOST_GROUPS).tolist()
    return tuple(ctypes.string_at(address + offset, size).partition(b"\0")[0].decode() for address in addresses)


def deform_vertices(mesh):
    """Address of the mesh's array of weights; 0 if it has none, None if it cannot be found."""
    kinds = layout.structs()
    data, entry = kinds["CustomData"], kinds["CustomDataLayer"]
    vertex_data = mesh.as_pointer() + kinds["Mesh"].offset("vdata")
    layers = _address_at(vertex_data + data.offset("*layers"))
    count = ctypes.c_int32.from_address(vertex_data + data.offset("totlayer")).value
    for number in range(count):
        at = layers + number * entry.size
        if ctypes.c_int32.from_address(at + entry.offset("type")).value == _DEFORM_VERTICES:
            address = _address_at(at + entry.offset("*data"))
            return address if _is_where_the_api_says(mesh, address) else None
    return 0


_weights_are_known = False  # to lie where they are looked for


def _is_where_the_api_says(mesh, address):
    """Whether some vertices' weights are there. Looked at until some were, and never again: asking for them, later
    versions copy the weights of the whole mesh."""
    global _weights_are_known
    if _weights_are_known:
        return True
    count = len(mesh.vertices)
    compared = 0
    for index in {0, count // 2, count - 1} if count else ():
        _offsets, groups, weights = host.read_weights(address + 16 * index, 1)
        said = [(entry.group, entry.weight) for entry in mesh.vertices[index].groups]
        if said != list(zip(groups.tolist(), weights.tolist())):
            return False
        compared += len(said)
    _weights_are_known = compared > 0
    return True


# --- poses ----------------------------------------------------------------------------------------


@functools.cache
def pose_layout():
    """What `host.read_pose` takes."""
    kinds = layout.structs()
    bone, runtime = kinds["bPoseChannel"], kinds["bPoseChannel_Runtime"]
    start = bone.offset("runtime")
    return (
        bone.offset("*next"),
        bone.offset("chan_mat"),
        start + runtime.offset("bbone_segments"),
        start + runtime.offset("*bbone_deform_mats"),
    )


@functools.cache
def posed_layout():
    """What `host.Shortcut` takes."""
    pose = layout.structs()["bPose"]
    return pose.offset("chanbase"), pose.offset("**chan_array"), *pose_layout()


def read_pose(armature, first_joints, joint_counts, out):
    """Motions of an evaluated armature's bones, from rest to pose, armature space, those of B-bones for each end of
    a segment; the rest as `host.read_pose` has it."""
    host.read_pose(armature.pose.bones[0].as_pointer(), first_joints, joint_counts, pose_layout(), out)


# --- places ---------------------------------------------------------------------------------------


@functools.lru_cache(maxsize=1)
def place_layout():
    """(offset in an object of the address at which its matrix to the world's space lies or None, offset of the matrix
    from there or from the object), or None if it is not where it is looked for. To be called from the main thread
    first."""
    members = layout.structs()["Object"].members
    for name in ("obmat", "object_to_world"):  # before 4.1
        if name in members:
            return None, members[name][0]
    # Later it is in a struct that Blender's description does not have. It is the first member there; an object that
    # is placed like no other tells whether that is so.
    with layout.temporary_data() as data:
        probe = data.objects.new("", None)
        probe.matrix_world = Matrix.Translation((3, 5, 7)) @ Matrix.Diagonal((11, 13, 17, 1))
        place = members["*runtime"][0], 0
        return place if _matrix_at(_place_address(probe, place)) == _columns(probe.matrix_world) else None


def _place_address(ob, place):
    pointer, offset = place
    start = ob.as_pointer()
    return (start if pointer is None else _address_at(start + pointer)) + offset


def _matrix_at(address):
    return list((ctypes.c_float * 16).from_address(address))


def _columns(matrix):
    return [number for column in matrix.transposed() for number in column]


def place_address(ob):
    """The address of 16 float32, column by column: the matrix of an evaluated object to the world's space, for as long
    as `place_regions` are as they are; None if it cannot be found."""
    place = place_layout()
    address = place and _place_address(ob, place)
    return address if address and _matrix_at(address) == _columns(ob.matrix_world) else None


def place_regions(ob):
    """[(address, size)] of what says that `place_address` is still right: Blender gives an object that it copies anew
    other memory for its place."""
    place = place_layout()
    return [] if place is None or place[0] is None else [(ob.as_pointer() + place[0], layout.POINTER)]


# --- shape keys -----------------------------------------------------------------------------------


@functools.cache
def key_layout():
    """Byte offsets in a key of its flags, its value, the address of its points, and their number."""
    key = layout.structs()["KeyBlock"]
    return key.offset("flag"), key.offset("curval"), key.offset("*data"), key.offset("totelem")


def key_addresses(keys):
    """(K,) of an evaluated key data-block's keys."""
    blocks = keys.key_blocks
    return host.list_addresses(blocks[0].as_pointer(), len(blocks)) if len(blocks) else np.empty(0, np.int64)


def key_positions(address, count):
    """(count, 3) float32: a key's numbers themselves, or None if it has another number of them."""
    _flag, _value, data, total = key_layout()
    address = int(address)
    if ctypes.c_int32.from_address(address + total).value != count:
        return None
    return vectors_at(_address_at(address + data), count)


def silence_keys(addresses):
    """Has Blender add nothing to the reference key in an evaluated copy. Returns (K,) float32, the keys' values, 0
    for what the user has muted."""
    return host.silence_keys(addresses, key_layout()[:2])


def give_keys_back(addresses):
    host.give_keys_back(addresses, key_layout()[0])


@functools.lru_cache(maxsize=64)
def _floats(count):
    return ctypes.c_float * count


def vectors_at(address, count):
    """(count, 3) float32 at that address, to be used at once and forgotten."""
    return np.frombuffer(_floats(3 * count).from_address(address), np.float32).reshape(count, 3)


def attribute_vectors(attribute, count):
    """(count, 3) float32: the numbers of a vector attribute themselves, or None if they cannot be had. Asking for
    their address makes Blender give the mesh numbers of its own, no longer shared with other copies, as any write
    through its API does; but it does not see what is written here."""
    data = attribute.data
    if count == 0 or len(data) != count:
        return None
    address = data[0].as_pointer()
    if data[count - 1].as_pointer() != address + 12 * (count - 1):
        return None
    return vectors_at(address, count)


# --- bound positions of Corrective Smooth ----------------------------------------------------------


def bound_count(modifier):
    """Of how many vertices a Corrective Smooth keeps the positions."""
    return ctypes.c_uint32.from_address(region(modifier, "CorrectiveSmoothModifierData", "bind_coords_num")[0]).value


def bound_positions(modifier):
    """(N, 3) float32, a copy of these positions, which the API does not show; None if there are none."""
    address = _address_at(region(modifier, "CorrectiveSmoothModifierData", "(*bind_coords)()")[0])
    return vectors_at(address, bound_count(modifier)).copy() if address else None


# --- modifiers ------------------------------------------------------------------------------------

_VIEWPORT, _RENDER = 1, 2  # bits of a modifier's mode
_GROUPS, _ENVELOPES = 1, 2  # bits of an Armature modifier's way to bind


@functools.cache
def _mode_offset():
    return layout.structs()["ModifierData"].offset("mode")


def bind_armature_modifier(modifier, groups, envelopes):
    """Whether an evaluated Armature modifier binds vertices through groups and through envelopes."""
    offset = layout.structs()["ArmatureModifierData"].offset("deformflag")
    flags = ctypes.c_int16.from_address(modifier.as_pointer() + offset)
    flags.value = flags.value & ~(_GROUPS | _ENVELOPES) | _GROUPS * bool(groups) | _ENVELOPES * bool(envelopes)


def mode_switch(modifier, viewport, render):
    """(address, bits to clear, bits to set) of an int32 that switch a modifier of an evaluated object, before its
    modifiers are evaluated. Through the API it would count as an edit."""
    return (
        modifier.as_pointer() + _mode_offset(),
        _VIEWPORT | _RENDER,
        _VIEWPORT * bool(viewport) | _RENDER * bool(render),
    )


def switch_modifier(modifier, viewport, render):
    address, clear, bits = mode_switch(modifier, viewport, render)
    mode = ctypes.c_int32.from_address(address)
    mode.value = mode.value & ~clear | bits
