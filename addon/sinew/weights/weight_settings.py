"""The settings of the tools that make, edit and check weights. Independent of Blender."""

from dataclasses import dataclass

from ..feedback.options import option
from . import bone_segments, checks, pose_checks

_FACTOR, _ANGLE = {"subtype": "FACTOR"}, {"subtype": "ANGLE"}


@dataclass(frozen=True)
class AutomaticSettings:
    """How weights are made from bones. The defaults suit a character."""

    ends: str = option(  # as in bone_segments.choose
        bone_segments.AUTOMATIC,
        "Bones",
        "The line that each bone stands for",
        items=(
            (
                bone_segments.AUTOMATIC,
                "Automatic",
                "To the tail, unless most tails are far from the next bone, as in rigs from files without tails",
            ),
            (bone_segments.TAIL, "Head to Tail", "The bones as they are drawn"),
            (bone_segments.CHILD, "Head to Child", "To the next bone. For imported rigs, whose tails are guesses"),
        ),
        word="bones",
        help="where the line ends that each bone stands for: at its tail, or at the next bone's head",
    )
    stiffness: float = option(
        8.0,
        "Stiffness",
        "How closely weights follow the nearest bone: small values are soft, large ones stiff",
        limits=(0.1, 1e4, 50.0),
    )
    resolution: int = option(
        128, "Resolution", "Voxels along the longest side, which measure distances inside the mesh", limits=(16, 256)
    )
    max_influences: int = option(
        0,
        "Most Bones",
        "The largest number of bones per vertex, for game engines often 4; 0: no limit",
        limits=(0, None, 8),
        help="the largest number of bones per vertex; 0: no limit; with --check, what counts as too many, 0: 4",
    )
    rigid_size: float = option(
        0.02,  # a person's eyes, teeth, buckles
        "Rigid Parts",
        "Loose parts that are smaller than this share of the mesh's size do not bend: buttons, buckles, teeth, eyes. "
        "0: all parts bend",
        limits=(0.0, 1.0),
        more=_FACTOR | {"precision": 3},
    )
    rigid_follow: str = option(
        "attachment",
        "They Follow",
        "What rigid parts follow: the closest point of the rest of the mesh, or one bone",
        items=(
            ("attachment", "Surface", "The closest point of the rest of the mesh"),
            ("bone", "One Bone", "The bone that moves them most"),
        ),
    )
    rigid_group: str = option(
        "Rigid",
        "Rigid Group",
        "Vertices in the vertex group of this name do not bend: each connected piece of them is rigid",
    )


@dataclass(frozen=True)
class TransferSettings:
    """Which vertices get the weights of the closest point of the source, as in sinew_native.transfer_weights."""

    distance: float = option(
        0.05,
        "Distance",
        "How far the closest point may be for a vertex to be matched, as a share of the size of the target",
        limits=(0.0001, 10.0, 0.5),
        more={"precision": 3},
    )
    angle: float = option(
        30.0, "Angle", "The largest angle between the surfaces there", limits=(0.0, 180.0), more=_ANGLE
    )
    flipped: bool = option(False, "Flipped Normals", "Also match surfaces that face the opposite way, such as linings")


@dataclass(frozen=True)
class SmoothSettings:
    """How weights are smoothed, as in sinew_native.smooth_weights."""

    steps: int = option(
        5, "Steps", "How many times each vertex goes towards the mean of its neighbors", limits=(1, 10000, 50)
    )
    factor: float = option(0.5, "Factor", "How far each step goes", limits=(0.0, 1.0), more=_FACTOR)
    strength: float = option(
        0.0,
        "Strength",
        "Above 0: smooth in one solve instead of steps. It reaches about so many edges as the square root of "
        "this number",
        limits=(0.0, 1e6, 1000.0),
    )


@dataclass(frozen=True)
class MirrorSettings:
    """How weights are mirrored: in the space of the object, at its origin."""

    axis: str = option(
        "X",
        "Axis",
        "The axis of the object that the sides are on. The mirror is at its origin",
        items=tuple((axis, axis, f"Left and right along {axis}") for axis in "XYZ"),
    )
    direction: str = option(
        "POSITIVE",
        "Direction",
        "Which side is copied",
        items=(
            ("POSITIVE", "Positive to Negative", "From the positive side of the axis, which is a character's left"),
            ("NEGATIVE", "Negative to Positive", "From the negative side of the axis"),
        ),
        word="from",
        help="the side to copy from; positive is a character's left",
    )


@dataclass(frozen=True)
class ReduceSettings:
    """How weights are reduced."""

    max_influences: int = option(
        4, "Most Bones", "The largest number of bones per vertex. Many game engines allow 4", limits=(1, 64, 12)
    )
    rings: int = option(
        2,
        "Fade",
        "Over how many edges a bone fades out towards vertices that have lost it, so that no seam shows",
        limits=(0, 64, 10),
        word="fade",
    )
    tolerance: float = option(  # in world space
        0.0,
        "Tolerance",
        "Select the vertices that move farther than this; 0: none",
        limits=(0.0,),
        help="in world space; exit code 1 if a vertex moves farther (default: none)",
        more={"subtype": "DISTANCE", "unit": "LENGTH", "precision": 4},
    )


@dataclass(frozen=True)
class CheckSettings:
    """What counts as a problem."""

    most_influences: int = option(
        checks.MOST_INFLUENCES, "Most Bones", "Find vertices with more bones than this", limits=(1, None, 16)
    )
    angle: float = option(
        pose_checks.ANGLE,
        "Test Poses",
        "The angle by which each bone is bent to see how far it stretches the mesh",
        limits=(0.0, 180.0),
        help="with --check: by how much each bone is bent to see how far it stretches the mesh",
        more=_ANGLE,
    )
