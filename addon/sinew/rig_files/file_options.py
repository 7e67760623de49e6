"""How a rig folder is read into the scene, and written. Independent of Blender."""

from dataclasses import dataclass

from ..deform import choices
from ..feedback.options import option

_Y_OR_Z = (("Y", "Y", "Y is up, as in most .obj files"), ("Z", "Z", "Z is up, as in Blender"))
# The names of files that are read or written if no others are given.
MESH, WEIGHTS, POSE, ANIMATION = "mesh.obj", "weights.dmat", "pose.dmat", "anim.dmat"
AUTO = "auto"  # in place of the name of a file of weights


@dataclass(frozen=True)
class FileOptions:
    """What the files are, beside the skeleton. Empty names: the default files. weights AUTO: made from the bones, as
    they are if there is no such file and none is named."""

    mesh: str = option("", "Mesh", f"File of the mesh, beside the skeleton; empty: {MESH}", value="FILE")
    weights: str = option(
        "",
        "Weights",
        "File of the weights; empty: weights.dmat, and if there is none, weights made from the bones; auto: made from "
        "the bones in any case",
        value="FILE",
    )
    pose: str = option(
        "",
        "Poses",
        "File of the poses; empty: pose.dmat, if there is one",
        value="FILE",
        help="file of the poses (default: pose.dmat, else anim.dmat)",
    )
    convention: str = option(
        "AUTO",
        "Convention",
        "What a row of a .bf file describes",
        items=(
            ("AUTO", "Automatic", "Bone if a root has the weight index -1, otherwise Joint"),
            ("BONE", "Bone", "The edge from the parent to the joint, which rotates about the parent"),
            ("JOINT", "Joint", "The joint itself, which rotates about its own position"),
        ),
    )
    quaternion_order: str = option(
        "WXYZ",
        "Quaternions",
        "The order of the four numbers in the file of the poses",
        items=(
            ("WXYZ", "w x y z", "The real part first"),
            ("XYZW", "x y z w", "The real part last, as libigl writes them"),
        ),
    )


@dataclass(frozen=True)
class ImportOptions(FileOptions):
    """How a rig folder is imported."""

    up_axis: str = option("Y", "Up", "The axis of the files that points up", items=_Y_OR_Z)
    scale: float = option(1.0, "Scale", "Size of the imported rig", limits=(1e-6, None, 1000))
    source: str = option("CLIP", "Pose", "Where the pose comes from", items=choices.SOURCES)
    method: str = option("LINEAR", "Method", "How the joints' motions are blended", items=choices.METHODS)
    output: str = option(
        "MODIFIER",
        "Output",
        "Where the deformed positions go",
        items=choices.OUTPUTS,
        word="output-kind",
        help="where the shape goes: through a modifier, or also into a copy of the mesh",
    )
    frame_rate: float = option(
        0.0,
        "Frame Rate",
        "Poses per second in the file, played at the scene's frame rate; 0: one pose per frame",
        limits=(0.0, None, 240.0),
        help="poses per second in the file, played at the scene's frame rate (default: one pose per frame)",
    )
    set_frame_range: bool = option(
        True,
        "Set Frame Range",
        "End the scene at the last pose if there are more than two",
        word="keep-frame-range",
        help="do not end the scene with the last pose",
    )


@dataclass(frozen=True)
class ExportOptions:
    """How a rig folder is written."""

    animation: str = option(
        "AUTO",
        "Animation",
        "What to write besides the rest pose",
        items=(
            (
                "AUTO",
                "Automatic",
                "The imported poses if they are shown, otherwise the scene's frames if the armature is animated",
            ),
            ("FRAMES", "Scene Frames", "The frames of the scene, as anim.dmat"),
            ("NONE", "None", "Only the rest pose"),
        ),
        help="auto: the imported poses if they are shown, else the scene's frames if the armature is animated; frames: "
        "always those",
    )
    up_axis: str = option(
        "Y",
        "Up",
        "The axis of the files that the mesh's Z axis becomes. An imported rig is written in the axes of its own files",
        items=_Y_OR_Z,
        help="the axis of the files that the mesh's Z axis becomes, if it was not imported",
    )
