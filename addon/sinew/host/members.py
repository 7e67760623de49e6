"""The members of Blender's structs that Sinew reads or writes by address, with type and size. Does not use Blender.

Offsets are those of the running Blender. A member that is not in this list cannot be requested.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

POINTER = 8  # bytes


class Member(NamedTuple):
    """Describes a member of a struct.

    type, size: as in Blender's description, size in bytes, None for any; offset: the required offset in bytes, None for
    any; shown: the name of the property in Blender's API with the same value, with which it is compared when it is
    first read or written; "" for none."""

    type: str | None
    size: int | None
    offset: int | None = None
    shown: str = ""


def _pointer(kind: str | None = None, offset: int | None = None, shown: str = "") -> Member:
    return Member(kind, POINTER, offset, shown)


def _int(shown: str = "") -> Member:
    return Member("int", 4, None, shown)


def _float(shown: str = "") -> Member:
    return Member("float", 4, None, shown)


def _short(shown: str = "") -> Member:
    return Member("short", 2, None, shown)


def _choice(shown: str) -> Member:
    return Member("char", 1, None, shown)


def _name(shown: str = "") -> Member:
    return Member("char", 64, None, shown)  # of a vertex group


_LIST = Member("ListBase", 16)
# What keyframes, drivers and people set in a pose bone, those of B-bones at rest too: sizes in bytes.
BEND = {
    "scale_in": 12,
    "scale_out": 12,
    **dict.fromkeys(("roll1", "roll2", "curveInX", "curveInY", "curveOutX", "curveOutY", "ease1", "ease2"), 4),
}
CHANNELS = {"loc": 12, "size": 12, "eul": 12, "quat": 16, "rotAxis": 12, "rotAngle": 4, **BEND}
# What keyframes set of an object's place, by what Blender's API calls it: its members with their sizes in bytes.
PLACE_CHANNELS = {
    "location": {"loc": 12},
    "rotation_quaternion": {"quat": 16},
    "rotation_axis_angle": {"rotAngle": 4, "rotAxis": 12},
    "rotation_euler": {"rot": 12},
    "scale": {"size": 12},
    "delta_location": {"dloc": 12},
    "delta_rotation_quaternion": {"dquat": 16},
    "delta_rotation_euler": {"drot": 12},
    "delta_scale": {"dscale": 12},
}
# What else people set in a pose bone, by what Blender's API calls each of three numbers.
LIMITS = {
    "ikstretch": ("ik_stretch",),
    "stiffness": ("ik_stiffness_x", "ik_stiffness_y", "ik_stiffness_z"),
    "limitmin": ("ik_min_x", "ik_min_y", "ik_min_z"),
    "limitmax": ("ik_max_x", "ik_max_y", "ik_max_z"),
}
# The numbers of a bone at rest, by what Blender's API calls them.
REST = {
    "arm_mat": "matrix_local",
    "bone_mat": "matrix",
    "head": "head",
    "arm_head": "head_local",
    "arm_tail": "tail_local",
    "length": "length",
}
# The struct of a type of constraint. Those that are not here use more than one, or what they follow is not in it.
CONSTRAINTS = {
    "CHILD_OF": "bChildOfConstraint",
    "COPY_LOCATION": "bLocateLikeConstraint",
    "COPY_ROTATION": "bRotateLikeConstraint",
    "COPY_SCALE": "bSizeLikeConstraint",
    "COPY_TRANSFORMS": "bTransLikeConstraint",
    "DAMPED_TRACK": "bDampTrackConstraint",
    "FLOOR": "bMinMaxConstraint",
    "FOLLOW_PATH": "bFollowPathConstraint",
    "IK": "bKinematicConstraint",
    "LIMIT_DISTANCE": "bDistLimitConstraint",
    "LIMIT_LOCATION": "bLocLimitConstraint",
    "LIMIT_ROTATION": "bRotLimitConstraint",
    "LIMIT_SCALE": "bSizeLimitConstraint",
    "LOCKED_TRACK": "bLockTrackConstraint",
    "MAINTAIN_VOLUME": "bSameVolumeConstraint",
    "PIVOT": "bPivotConstraint",
    "SPLINE_IK": "bSplineIKConstraint",
    "STRETCH_TO": "bStretchToConstraint",
    "TRACK_TO": "bTrackToConstraint",
    "TRANSFORM": "bTransformConstraint",
}
# The struct of a type of modifier that is copied as a whole.
MODIFIERS = {
    "ARRAY": "ArrayModifierData",
    "BEVEL": "BevelModifierData",
    "DECIMATE": "DecimateModifierData",
    "EDGE_SPLIT": "EdgeSplitModifierData",
    "MASK": "MaskModifierData",
    "MIRROR": "MirrorModifierData",
    "SOLIDIFY": "SolidifyModifierData",
    "SUBSURF": "SubsurfModifierData",
    "TRIANGULATE": "TriangulateModifierData",
    "WELD": "WeldModifierData",
}
# A pointer's name begins with "*". The type of a pointer is omitted if it differs between Blender versions.
MEMBERS: dict[str, dict[str, Member]] = {
    "ID": {"*orig_id": _pointer("ID", shown="original"), "recalc": _int(), "us": _int()},
    "Object": {
        "mode": _int("mode"),
        "*data": _pointer(shown="data"),
        "*pose": _pointer("bPose", shown="pose"),
        "*parent": _pointer("Object"),
        "transflag": _short(),
        "rotmode": _short(),
        "parentinv": Member("float", 64),
        **{name: Member("float", size) for own in PLACE_CHANNELS.values() for name, size in own.items()},
    },
    "Mesh": {
        "*key": _pointer("Key", shown="shape_keys"),
        "vdata": Member("CustomData", 248),
        "vertex_group_names": _LIST,
    },
    "Lattice": {
        **{name: _float() for name in ("fu", "fv", "fw", "du", "dv", "dw")},
        "*dvert": _pointer("MDeformVert"),
        "vertex_group_names": _LIST,
    },
    "Key": {},
    "bArmature": {"flag": _int(), "bonebase": _LIST},
    "bAction": {},
    "AnimData": {
        "*action": _pointer("bAction", shown="action"),
        "*tmpact": _pointer("bAction", shown="action_tweak_storage"),
        "nla_tracks": _LIST,
    },
    "NlaStrip": {"*act": _pointer("bAction", shown="action")},
    "Bone": {
        "*next": _pointer("Bone", 0),
        "childbase": _LIST,
        "*prop": _pointer("IDProperty"),
        "*bbone_prev": _pointer("Bone"),
        "*bbone_next": _pointer("Bone"),
        **dict.fromkeys((*REST, *BEND), Member("float", None)),
    },
    # A struct in a list begins with the address of the next one.
    "ListBase": {"*first": _pointer("void", 0), "*last": _pointer("void", 8)},
    "bDeformGroup": {"*next": _pointer("bDeformGroup", 0), "name": _name()},
    "KeyBlock": {
        "*next": _pointer("KeyBlock", 0),
        "flag": _short(),
        "curval": _float(),
        "relative": _short(),
        "*data": _pointer("void"),
        "totelem": _int(),
    },
    "CustomData": {"*layers": _pointer("CustomDataLayer"), "totlayer": _int()},
    "CustomDataLayer": {"type": _int(), "*data": _pointer("void")},
    # Read by native code, in which these offsets and sizes are hard-coded.
    "MDeformVert": {"*dw": _pointer("MDeformWeight", 0), "totweight": Member("int", 4, 8)},
    "MDeformWeight": {"def_nr": Member("int", 4, 0), "weight": Member("float", 4, 4)},
    # No feature needs the array, which is there before Blender 5.3: it makes the fast path a little faster.
    "bPose": {"chanbase": _LIST, "**chan_array": _pointer("bPoseChannel")},
    "bPoseChannel": {
        "*next": _pointer("bPoseChannel", 0),
        "*parent": _pointer("bPoseChannel"),
        "*prop": _pointer("IDProperty"),
        "constraints": _LIST,
        "chan_mat": Member("float", 64),
        "runtime": Member("bPoseChannel_Runtime", None),
        "pose_mat": Member("float", 64),
        "pose_head": Member("float", 12),
        "pose_tail": Member("float", 12),
        **{name: Member("float", size) for name, size in CHANNELS.items()},
        **dict.fromkeys(LIMITS, Member("float", None)),
    },
    "bPoseChannel_Runtime": {
        "bbone_segments": _int(),
        "*bbone_deform_mats": _pointer("Mat4"),
        "deform_dual_quat": Member("DualQuat", 100),
        "*bbone_pose_mats": _pointer("Mat4"),
        "*bbone_dual_quats": _pointer("DualQuat"),
    },
    "bConstraint": {
        "*next": _pointer("bConstraint", 0),
        "*data": _pointer("void"),
        "type": _short(),
        "enforce": _float(),
        "flag": _short(),
    },
    **{kind: {} for kind in CONSTRAINTS.values()},
    "bArmatureConstraint": {"targets": _LIST},
    "bConstraintTarget": {"*next": _pointer("bConstraintTarget", 0)},
    "DriverTarget": {
        "*id": _pointer("ID", shown="id"),
        "*rna_path": _pointer("char"),
        "pchan_name": _name(),
        "transChan": _short(),
        "rotation_mode": Member("char", 1),
        "flag": _short(),
    },
    "DriverVar": {
        "*next": _pointer("DriverVar", 0),
        "name": _name(),
        "type": Member("char", 1),
        "targets": Member("DriverTarget", None),
        "num_targets": Member("char", 1),
        "curval": _float(),
    },
    "ChannelDriver": {
        "variables": _LIST,
        "expression": Member("char", 256),
        "*expr_simple": _pointer("ExprPyLike_Parsed"),
        "type": _int(),
        "flag": _int(),
    },
    "FCurve": {
        "*next": _pointer("FCurve", 0),
        "*driver": _pointer("ChannelDriver"),
        "flag": _short(),
        "*bezt": _pointer("BezTriple"),
        "*fpt": _pointer("FPoint"),
        "totvert": _int(),
        "extend": _short(),
        "array_index": _int(),
        "*rna_path": _pointer("char"),
        "modifiers": _LIST,
    },
    "BezTriple": {
        "vec": Member("float", 36),
        "ipo": Member("char", 1),
        "easing": Member("char", 1),
        "back": _float(),
        "amplitude": _float(),
        "period": _float(),
    },
    "ModifierData": {"mode": _int()},
    **{kind: {"modifier": Member("ModifierData", None, 0)} for kind in MODIFIERS.values()},
    "ArmatureModifierData": {
        "deformflag": _short(),
        "multi": _short(),
        "defgrp_name": _name("vertex_group"),
        "*object": _pointer("Object", shown="object"),
    },
    "CorrectiveSmoothModifierData": {
        "(*bind_coords)()": _pointer("float"),
        "bind_coords_num": _int(),
        "lambda": _float("factor"),
        "scale": _float("scale"),
        "repeat": _short("iterations"),
        "flag": _short(),
        "smooth_type": _choice("smooth_type"),
        "rest_source": _choice("rest_source"),
        "defgrp_name": _name("vertex_group"),
    },
    "SmoothModifierData": {
        "fac": _float("factor"),
        "repeat": _short("iterations"),
        "flag": _short(),
        "defgrp_name": _name("vertex_group"),
    },
    "SurfaceDeformModifierData": {
        "*verts": _pointer("SDefVert"),
        "num_mesh_verts": _int(),
        "numverts": _int(),
        "target_verts_num": _int(),
        "flags": _int(),
        "mat": Member("float", 64),
    },
    "MeshDeformModifierData": {
        "*bindinfluences": _pointer("MDefInfluence"),
        "*bindoffsets": _pointer("int"),
        "*bindcagecos": _pointer("float"),
        "totvert": _int(),
        "totcagevert": _int(),
        "bindmat": Member("float", 64),
    },
    "MDefInfluence": {"vertex": Member("int", 4, 0), "weight": Member("float", 4, 4)},
    # Read by native code, in which these offsets and sizes are hard-coded.
    "SDefVert": {
        "*binds": _pointer("SDefBind", 0),
        "numbinds": Member("int", 4, 8),
        "vertex_idx": Member("int", 4, 12),
    },
    "SDefBind": {
        "*vert_inds": _pointer("int", 0),
        "numverts": Member("int", 4, 8),
        "mode": Member("int", 4, 12),
        "*vert_weights": _pointer("float", 16),
        "normal_dist": Member("float", 4, 24),
        "influence": Member("float", 4, 28),
    },
}
# The sizes in bytes of structs that are read from arrays. Blender does not describe the last two.
SIZES = {
    "MDeformVert": 16,
    "MDeformWeight": 8,
    "SDefVert": 16,
    "SDefBind": 32,
    "MDefInfluence": 8,
    "Mat4": 64,
    "DualQuat": 100,
}
# Stands for any byte of a struct that Blender does not use.
UNUSED = "_pad"
# Stands for the member of Object that leads to its matrix to world space: the first of these that exists. Before 4.1 it
# is the matrix itself, since then the address of a struct that Blender does not describe.
PLACE = "place"
PLACES = {"obmat": Member("float", 64), "object_to_world": Member("float", 64), "*runtime": _pointer()}


def differences(struct: Any, kind: str, names: Iterable[str]) -> list[str]:
    """Returns how some members of a struct differ from what is listed here, as clauses.

    struct: its layout.Struct, None if there is none; kind: its name; names: of the members, UNUSED or PLACE."""
    if struct is None:
        return [f"there is no struct {kind}"]
    found = [clause for name in names if (clause := _difference(struct, kind, name))]
    if kind in SIZES and struct.size != SIZES[kind]:
        found.append(f"{kind} has {struct.size} bytes instead of {SIZES[kind]}")
    return found


def _difference(struct: Any, kind: str, name: str) -> str:
    if name == UNUSED:
        return "" if struct.padding() is not None else f"{kind} has no unused byte"
    listed: dict[str, Member] = MEMBERS[kind]
    if name == PLACE:
        found, listed = place_in(struct), PLACES
        if found is None:
            return f"{kind} has no matrix to the world"
        name = found
    if name not in struct.members:
        return f"{kind} has no {name}"
    offset, of_type, size = struct.members[name]
    wanted = listed[name]
    if wanted.type not in (None, of_type) or wanted.size not in (None, size):
        expected = " ".join(str(each) for each in (wanted.type, wanted.size and f"of {wanted.size} bytes") if each)
        return f"{kind}.{name} is {of_type} of {size} bytes instead of {expected}"
    if wanted.offset not in (None, offset):
        return f"{kind}.{name} is at byte {offset} instead of {wanted.offset}"
    return ""


def place_in(struct: Any) -> str | None:
    """Returns which of PLACES the struct Object has. struct: its layout.Struct."""
    return next((name for name in PLACES if name in struct.members), None)
