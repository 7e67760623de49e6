"""What people choose when they bake to bones. Independent of Blender."""

from dataclasses import dataclass

from ..feedback.options import option


@dataclass(frozen=True)
class FoundOptions:
    """Of a bake that finds weights, and bones unless they are copied."""

    bones: int = option(
        20,
        "Number of Bones",
        "The largest number of bones to find; fewer, if fewer play the deformation exactly",
        limits=(1, 2048, 200),
    )
    max_influences: int = option(
        4, "Most Bones per Vertex", "The most bones per vertex. Game engines often allow 4 or 8", limits=(1, 64, 8)
    )
    iterations: int = option(
        30, "Iterations", "At most so often weights and motions are found in turns", limits=(1, 10000, 200)
    )
    tolerance: float = option(
        1e-3,
        "Tolerance",
        "Stop when three iterations lower the error by less than this share of it; 0: do all iterations",
        limits=(0.0, 1.0),
        more={"precision": 4},
    )


@dataclass(frozen=True)
class ExactOptions:
    """Of a bake that copies the rig's bones, with exactly their motion."""

    actions: str = option("*", "Named", "Only actions with such names, for example walk*", value="GLOB")
    skeleton: str = option(
        "", "Skeleton", "The armature to update: bones of the same names get the new actions; empty: make a new one"
    )
    root: str = option(
        "", "Root", "The bone of the rig below which all others are put, whether it deforms or not", value="BONE"
    )
    root_motion: str = option(
        "BONES",
        "Root Motion",
        "What the root does",
        items=(
            ("BONES", "As It Is", "Each bone moves as the rig's"),
            (
                "ROOT",
                "To the Root",
                "The root moves along the ground with the first bone below it; the pose stays the same",
            ),
            ("IN_PLACE", "In Place", "What moves the first bone below the root along the ground is left out"),
        ),
        help="root: it gets what moves the others along the ground; in-place: that is left out",
    )
    is_flat: bool = option(
        False,
        "No Hierarchy",
        "No bone but the root has children. Bones below a stretched one then stay exact in engines",
        word="flat",
    )
    has_segments: bool = option(
        False,
        "Bones for B-Bones",
        "A bone for each end of a B-bone's segments, and weights split between them; otherwise one bone",
        word="segments",
        help="a bone for each end of a B-bone's segments",
    )
    roots_alone_move: bool = option(
        False,
        "Only Roots Move",
        "Key the location of bones without parents alone; others rotate",
        word="only-roots-move",
    )
    copies_meshes: bool = option(
        True,
        "Copy Meshes",
        "Put copies of the meshes with their weights onto a new skeleton",
        word="no-meshes",
        help="do not copy the meshes",
    )
    key_error: float = option(
        0.0,
        "Key Error",
        "Leave out keyframes for which straight lines do, as long as no bone is further off than this on any frame; 0: "
        "a keyframe on each frame",
        limits=(0.0, None, 0.1),
        value="LENGTH",
        help="leave out keyframes for which lines do, as long as no bone is further off than this on any frame",
        more={"precision": 4, "subtype": "DISTANCE"},
    )
    names: str = option(
        "",
        "Names",
        "Text file with other names for bones, a line NAME = NEW NAME each",
        value="FILE",
        more={"subtype": "FILE_PATH"},
    )
    gltf: str = option(
        "",
        "glTF",
        "Also write the skeleton and the meshes to this .glb file",
        value="FILE.glb",
        more={"subtype": "FILE_PATH"},
    )
