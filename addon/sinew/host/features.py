"""What each feature needs of Blender's memory, and what happens in a Blender that keeps it otherwise. Does not use
Blender.

The table in docs/blenders-memory.md is made from this (docs/make_memory_table.py).
"""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from . import members


class Feature(NamedTuple):
    """Something that works only if parts of Blender's memory are what is expected.

    without: what happens otherwise, a clause; needs: members, each as Struct.member; a struct alone means all that are
    listed of it; Struct._pad means a byte that Blender does not use; also: features without which this one is lost too;
    compared: what is compared with Blender's API the first time, besides single members; "" for nothing."""

    without: str
    needs: str = ""
    also: tuple[str, ...] = ()
    compared: str = ""


DEFORMING = "Deforming"
ATTRIBUTES = "Meshes without shape keys"
KEYS = "Shape keys"
BONES = "Poses"
SEGMENTS = "B-bones"
EDITIONS = "Bones while posing by hand"
WEIGHTS = "Weights"
BOUND = "Corrective Smooth, bound"
LATTICES = "Lattice"
WEIGHTED_LATTICES = "Lattices with weights"
SURFACE = "Surface Deform"
CAGE = "Mesh Deform"
DRIVEN = "Driven settings"
DRIVERS = "Drivers of data"
MUTING = "Muting"
WHOLE = "Modifiers as a whole"
FAST = "Fast path"
FAST_ARMATURES = "Fast path of armatures"
FAST_KEYS = "Fast path of shape keys"
FAST_CANVASES = "Fast path of canvases"
FAST_ACTIONS = "Fast path of animated data"
FAST_STRIPS = "Fast path of data with NLA strips"
FAST_TWEAKS = "Fast path while a strip is tweaked"
FAST_CORRECTIVE = "Fast path of Corrective Smooth"
FAST_SMOOTH = "Fast path of Smooth"
PLAYING = "Native and recorded rigs"
CONSTRAINTS = "Animated constraints of native rigs"
POSED = "Edits of native rigs"
NUMBERS = "Numbers of bones"
VARIABLES = "Drivers of native rigs"
FOLLOWING = "Rigs that follow objects with keyframes"
MOVING = "Rigs whose object has keyframes"

_FULL = "take more steps on each frame"
_OF_POSE = "*next", "runtime", "chan_mat", "pose_mat", "pose_head", "pose_tail"
FEATURES = {
    DEFORMING: Feature(
        "Blender's own modifiers deform",
        "ID.recalc Object._pad Mesh._pad Mesh.vertex_group_names ListBase.*first bDeformGroup ModifierData.mode",
        compared="the bit that disables a modifier, the bits of its switches",
    ),
    ATTRIBUTES: Feature(
        "Blender's own modifiers deform meshes without shape keys",
        also=(DEFORMING,),
        compared="the positions in an attribute",
    ),
    KEYS: Feature(
        "Blender's own modifiers deform meshes with shape keys",
        "Key._pad KeyBlock",
        (DEFORMING,),
        "addresses, values, mute switches and relative keys of all keys, and the points of the last one",
    ),
    BONES: Feature(
        "the poses of armatures are read bone by bone, which takes longer",
        "bPoseChannel.*next bPoseChannel.chan_mat",
        compared="the motion of a bone",
    ),
    SEGMENTS: Feature(
        "B-bones are read segment by segment, and meshes that they move " + _FULL,
        "bPoseChannel.runtime bPoseChannel_Runtime.bbone_segments bPoseChannel_Runtime.*bbone_deform_mats",
        (BONES,),
        "the motions of the segments of a B-bone",
    ),
    EDITIONS: Feature(
        "whether bones have changed is found out bone by bone, so posing by hand takes longer",
        "bArmature.bonebase bArmature._pad Bone.*next Bone.childbase ListBase.*first",
    ),
    WEIGHTS: Feature(
        "the weights of a mesh are read vertex by vertex, so edits and painting take longer",
        "Mesh.vdata CustomData CustomDataLayer MDeformVert MDeformWeight",
        compared="the weights of three vertices",
    ),
    BOUND: Feature(
        "Blender evaluates a Corrective Smooth that is bound, and what comes behind it",
        "CorrectiveSmoothModifierData.(*bind_coords)() CorrectiveSmoothModifierData.bind_coords_num",
        compared="whether it is bound",
    ),
    LATTICES: Feature(
        "Blender evaluates Lattice modifiers, and what comes behind them",
        " ".join(f"Lattice.{name}" for name in ("fu", "fv", "fw", "du", "dv", "dw")),
        compared="the first point of a lattice at rest",
    ),
    WEIGHTED_LATTICES: Feature(
        "Blender evaluates Lattice modifiers whose lattice has a vertex group, and what comes behind them",
        "Lattice.*dvert Lattice.vertex_group_names ListBase.*first bDeformGroup MDeformVert MDeformWeight",
        (LATTICES,),
    ),
    SURFACE: Feature(
        "Blender evaluates Surface Deform, and what comes behind it",
        "SurfaceDeformModifierData SDefVert SDefBind",
        compared="whether it is bound",
    ),
    CAGE: Feature(
        "Blender evaluates Mesh Deform, and what comes behind it",
        "MeshDeformModifierData MDefInfluence",
        compared="whether it is bound",
    ),
    DRIVEN: Feature("Blender evaluates modifiers with driven settings, and what comes behind them", "DriverVar.curval"),
    DRIVERS: Feature(
        "the drivers of meshes and bones' data are looked at one by one after edits, which takes longer",
        "FCurve.*next FCurve.*driver FCurve.*rna_path ListBase.*first ChannelDriver.variables ChannelDriver.expression "
        "ChannelDriver.type ChannelDriver.flag DriverVar.*next DriverVar.name DriverVar.type DriverVar.targets "
        "DriverTarget.*id DriverTarget.*rna_path DriverTarget.pchan_name",
        compared="the path of the first driver, and the bone that one of its variables waits for",
    ),
    MUTING: Feature(
        "Blender goes on calling Sinew for meshes that it deforms itself, which takes longer",
        "FCurve.flag",
        compared="the bit that mutes a driver",
    ),
    WHOLE: Feature(
        "Blender evaluates modifiers that make other vertices; with one before the armature, the whole mesh",
        " ".join(members.MODIFIERS.values()),
        compared="what the API shows of the copy",
    ),
    FAST: Feature("all meshes " + _FULL, "ID.*orig_id Object.mode DriverTarget.*id", (DEFORMING,)),
    FAST_ARMATURES: Feature(
        "meshes with armatures " + _FULL,
        "Object.*data Object.*pose Object.place bArmature.flag bArmature._pad bPose.chanbase ListBase.*first "
        "ArmatureModifierData",
        (FAST, BONES, EDITIONS),
        "an object's matrix to world space",
    ),
    FAST_KEYS: Feature("meshes with shape keys " + _FULL, "Mesh.*key", (FAST, KEYS)),
    FAST_CANVASES: Feature("meshes that several objects share, or with a front, " + _FULL, "Object.*data", (FAST,)),
    FAST_ACTIONS: Feature("meshes whose data are animated " + _FULL, "AnimData.*action bAction._pad", (FAST,)),
    FAST_STRIPS: Feature("meshes whose data NLA strips animate " + _FULL, "NlaStrip.*act bAction._pad", (FAST,)),
    FAST_TWEAKS: Feature("while an NLA strip is tweaked, its meshes " + _FULL, "AnimData.*tmpact", (FAST_STRIPS,)),
    FAST_CORRECTIVE: Feature(
        "the settings of Corrective Smooth are read on each frame",
        " ".join(
            f"CorrectiveSmoothModifierData.{name}"
            for name in ("lambda", "scale", "repeat", "flag", "smooth_type", "rest_source", "defgrp_name")
        ),
        (FAST,),
    ),
    FAST_SMOOTH: Feature("the settings of Smooth are read on each frame", "SmoothModifierData", (FAST,)),
    PLAYING: Feature(
        "no rig is native or recorded",
        "ID.us AnimData.*action AnimData.nla_tracks ListBase ChannelDriver.expression ChannelDriver.*expr_simple "
        "ChannelDriver.type bPoseChannel_Runtime BezTriple FCurve.flag FCurve.*bezt FCurve.*fpt "
        "FCurve.totvert FCurve.extend FCurve.array_index FCurve.*rna_path FCurve.modifiers "
        + " ".join(f"bPoseChannel.{name}" for name in (*_OF_POSE, *members.CHANNELS)),
        (DEFORMING, KEYS),
        "the number of users, actions, drivers, poses, the segments of a B-bone, keyframes",
    ),
    CONSTRAINTS: Feature(
        "a native rig whose constraints' influence or mute is keyed is Blender's while it is selected; what is driven "
        "of them shows only then",
        "bConstraint.enforce bConstraint.flag",
        (PLAYING,),
        "the influence and mute of a constraint",
    ),
    POSED: Feature(
        "after each edit of its pose or its keyframes, all of a native rig is read again, which takes longer",
        "bPoseChannel.*next bPoseChannel.constraints bConstraint bArmatureConstraint bConstraintTarget ListBase.*first "
        "Bone.*bbone_prev Bone.*bbone_next " + " ".join(members.CONSTRAINTS.values()),
        (EDITIONS, DRIVERS, PLAYING),
        "where a bone's constraints are, and the type of the first",
    ),
    NUMBERS: Feature(
        "the numbers of the bones of native rigs are read one property after the other, which takes longer",
        "bPoseChannel.*next bPoseChannel.*parent bPoseChannel.*prop bPoseChannel.constraints Bone ListBase.*first "
        + " ".join(f"bPoseChannel.{name}" for name in (*members.CHANNELS, *members.LIMITS)),
        compared="the numbers of the last bone; of all, parents, and where constraints and custom properties may be",
    ),
    VARIABLES: Feature(
        "the variables of the drivers of native rigs are read one property after the other, which takes longer",
        "FCurve.*driver ListBase.*first ChannelDriver.variables DriverVar.*next DriverVar.name DriverVar.type "
        "DriverVar.targets DriverTarget",
        compared="the variables of all drivers",
    ),
    FOLLOWING: Feature(
        "a rig that follows objects with keyframes stays Blender's",
        "bConstraint DriverVar.num_targets DriverTarget.*id " + " ".join(members.CONSTRAINTS.values()),
        (PLAYING,),
        "the objects that a constraint follows, and how many a variable of a driver reads",
    ),
    MOVING: Feature(
        "a rig whose armature object, or a parent of it, has keyframes stays Blender's",
        "Object.place Object.*parent Object.transflag Object.rotmode Object.parentinv "
        + " ".join(f"Object.{name}" for own in members.PLACE_CHANNELS.values() for name in own),
        (PLAYING, FAST_ARMATURES),
        "channels, matrix, inverse and mirroring of an object",
    ),
}


def needs(feature: str) -> Iterator[tuple[str, str]]:
    """Yields (struct, member) of what a feature needs itself."""
    for word in FEATURES[feature].needs.split():
        kind, _, name = word.partition(".")
        if name:
            yield kind, name
        else:
            yield from ((kind, each) for each in members.MEMBERS[kind])


def structs(feature: str) -> set[str]:
    """Returns the names of the structs of which a feature needs anything itself."""
    return {word.partition(".")[0] for word in FEATURES[feature].needs.split()}


def users(kind: str, name: str) -> list[str]:
    """Returns the features that need a member themselves, in the order of the table."""
    return [feature for feature in FEATURES if (kind, name) in needs(feature)]


def lost_with(own: Iterable[str]) -> list[str]:
    """Returns some features and all those that are lost without one of them, in the order of the table."""
    lost = set(own)
    for feature, each in FEATURES.items():  # what a feature needs comes before it
        if not lost.isdisjoint(each.also):
            lost.add(feature)
    return [feature for feature in FEATURES if feature in lost]
