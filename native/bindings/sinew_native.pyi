"""Skeletal deformation: forward kinematics, skinning, shape keys, smoothing and the files of a rig folder.

Letters: V vertices, J joints, P poses, F frames, N influences of all vertices together. Matrices are
indexed m[..., row, column] and move column vectors. A mistake raises ValueError with a one-sentence message.
tests/python/test_stub.py compares this file with the compiled module.
"""

import os
from collections.abc import Sequence
from typing import Any, Literal, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

_Path: TypeAlias = str | os.PathLike[str]
_Convention: TypeAlias = Literal["bone", "joint"]
_Method: TypeAlias = Literal["linear", "dual_quaternion", "blended", "rotation_centers", "direct_delta_mush"]
_Laplacian: TypeAlias = Literal["cotangent", "uniform"]
_SmoothType: TypeAlias = Literal["simple", "length_weighted"]
_CornerAngle: TypeAlias = Literal["polynomial", "arc_cosine"]
_Spline: TypeAlias = Literal["linear", "cardinal", "catmull_rom", "bspline"]
_Falloff: TypeAlias = Literal["none", "constant", "linear", "smooth", "sharp", "root", "sphere", "inverse_square"]
_WeightMethod: TypeAlias = Literal["heat", "volume", "nearest"]
_RigidFollow: TypeAlias = Literal["attachment", "bone"]
_Stretch: TypeAlias = Literal["polar", "frame", "frame_each"]
_Integers: TypeAlias = npt.NDArray[np.integer[Any]]
_Reals: TypeAlias = npt.NDArray[np.floating[Any] | np.integer[Any]]
_Float32: TypeAlias = npt.NDArray[np.float32]
_Float64: TypeAlias = npt.NDArray[np.float64]
_Int32: TypeAlias = npt.NDArray[np.int32]
_Int64: TypeAlias = npt.NDArray[np.int64]
_UInt8: TypeAlias = npt.NDArray[np.uint8]
_Bool: TypeAlias = npt.NDArray[np.bool_]
_Float = TypeVar("_Float", np.float32, np.float64)

__version__: str

class Skeleton:
    """The tree of joints and its rest pose. Immutable."""

    def __init__(self, parents: _Integers, rest: _Reals) -> None:
        """parents (J,), -1 for a root, in any order; rest (J, 4, 4): R(j), relative to the parent."""
    @property
    def joint_count(self) -> int:
        """J."""
    @property
    def parents(self) -> _Int32:
        """(J,), read-only."""
    @property
    def rest(self) -> _Float64:
        """(J, 4, 4), read-only: R(j), relative to the parent."""
    @property
    def rest_world(self) -> _Float64:
        """(J, 4, 4), read-only: A(j), relative to the world."""
    @property
    def inverse_rest(self) -> _Float64:
        """(J, 4, 4), read-only: A(j)^-1."""

class RigSkeleton(Skeleton):
    """A Skeleton as a .bf or .tgf file describes it. Immutable."""

    def __init__(
        self,
        parents: _Integers,
        heads: _Reals,
        tails: _Reals,
        weight_columns: _Integers,
        names: list[str] = [],
        convention: _Convention = "joint",
    ) -> None:
        """parents (J,); heads and tails (J, 3), world; weight_columns (J,), -1 for none."""
    @property
    def heads(self) -> _Float64:
        """(J, 3), read-only, world: where each joint turns."""
    @property
    def tails(self) -> _Float64:
        """(J, 3), read-only, world: where its bone is drawn to."""
    @property
    def weight_columns(self) -> _Int32:
        """(J,), read-only: the joint's column of weights, or -1."""
    @property
    def names(self) -> list[str]:
        """J unique names."""
    @property
    def convention(self) -> _Convention: ...

class PoseClip:
    """P poses of J joint rotations. Immutable."""

    def __init__(self, rotations: _Reals) -> None:
        """rotations (P, J, 4): quaternions w x y z; they are normalized."""
    @property
    def joint_count(self) -> int:
        """J."""
    @property
    def pose_count(self) -> int:
        """P."""
    @property
    def rotations(self) -> _Float64:
        """(P, J, 4): w x y z, unit. A copy."""
    def sample(self, time: float, loop: bool = False) -> _Float64:
        """Returns the rotations (J, 4) at a time counted in poses, by spherical interpolation.

        loop: the first pose follows the last; otherwise time is clamped to the ends.
        """

class Rig:
    """Mesh, skeleton, weights and poses that belong together. Immutable."""

    def __init__(
        self,
        positions: _Reals,
        face_offsets: _Integers,
        face_vertices: _Integers,
        skeleton: RigSkeleton,
        weights: _Reals,
        poses: PoseClip | None = None,
        animation: _Reals | None = None,
        face_materials: _Integers | None = None,
        material_names: list[str] = [],
        material_library: str = "",
    ) -> None:
        """positions (V, 3); face_offsets (faces + 1,); face_vertices (C,), face after face; weights
        (V, columns); animation (F, J, 4, 4): skinning matrices; face_materials (faces,), -1 for none.
        """
    @property
    def positions(self) -> _Float32:
        """(V, 3), read-only."""
    @property
    def face_offsets(self) -> _Int32:
        """(faces + 1,), read-only: where each face's vertices begin."""
    @property
    def face_vertices(self) -> _Int32:
        """Read-only: vertex numbers, face after face."""
    @property
    def face_materials(self) -> _Int32:
        """(faces,), read-only: index into material_names, or -1. Empty if the file has no materials."""
    @property
    def material_names(self) -> list[str]:
        """In order of first use."""
    @property
    def material_library(self) -> str:
        """The file that describes the materials, or an empty string."""
    @property
    def skeleton(self) -> RigSkeleton: ...
    @property
    def weights(self) -> _Float64:
        """(V, columns), read-only."""
    @property
    def clamped_weights(self) -> int:
        """How many weights in the file were below 0 or above 1, see read_rig."""
    @property
    def poses(self) -> PoseClip | None: ...
    @property
    def animation(self) -> _Float64 | None:
        """(F, J, 4, 4), read-only: skinning matrices."""

class Skin:
    """The mesh at rest and the joints that move each vertex. Immutable except for set_rest_positions."""

    def __init__(
        self, rest_positions: _Reals, offsets: _Integers, joints: _Integers, weights: _Reals, joint_count: int
    ) -> None:
        """rest_positions (V, 3); offsets (V + 1,): vertex v has the influences offsets[v] to
        offsets[v + 1]; joints (N,); weights (N,), which for each vertex should sum to 1.
        """
    @staticmethod
    def from_dense(rest_positions: _Reals, weights: _Reals) -> Skin:
        """Makes a skin from a table. rest_positions (V, 3); weights (V, J), whose zeros are left out."""
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def joint_count(self) -> int:
        """J."""
    @property
    def influence_count(self) -> int:
        """N."""
    @property
    def most_influences(self) -> int:
        """The largest number of influences of a vertex."""
    @property
    def unweighted_count(self) -> int:
        """How many vertices no joint moves."""
    @property
    def largest_sum_error(self) -> float:
        """The largest |sum of weights - 1| of a vertex that has a weight."""
    @property
    def rest_positions(self) -> _Float32:
        """(V, 3), read-only."""
    @property
    def offsets(self) -> _Int64:
        """(V + 1,), read-only."""
    @property
    def joints(self) -> _Int32:
        """(N,), read-only."""
    @property
    def weights(self) -> _Float32:
        """(N,), read-only."""
    def set_rest_positions(self, positions: _Reals) -> None:
        """Gives the same influences another shape. positions (V, 3). Not while another thread skins with this
        object."""

class MethodData:
    """A method's own data for each vertex: the base class of BlendShares, RotationCenters and DirectDeltaMush.
    Immutable."""

    @property
    def method(self) -> str:
        """The one method that uses this data."""
    @property
    def vertex_count(self) -> int:
        """V."""

class BlendShares(MethodData):
    """The share of dual quaternion skinning of each vertex, for the method "blended"."""

    def __init__(self, shares: _Reals) -> None:
        """shares (V,), each from 0 (linear skinning) to 1 (dual quaternion skinning)."""
    @property
    def shares(self) -> _Float32:
        """(V,), read-only."""

class Progress:
    """The progress of a long computation, and a way to cancel it. Make it in one thread and pass it to a computation
    in another."""

    def __init__(self) -> None:
        """Use it for one computation at a time."""
    @property
    def fraction(self) -> float:
        """0 to 1."""
    @property
    def is_cancelled(self) -> bool:
        """Whether cancel() was called."""
    def cancel(self) -> None:
        """Ends the computation within about 0.1 s; it then returns None. What solves begins by ordering its matrix,
        which cannot be interrupted: 0.2 s for 300,000 vertices, 0.4 s in transfer_weights."""

class RotationCenters(MethodData):
    """Optimized centers of rotation (Le and Hodgins 2016), for the method "rotation_centers"."""

    def __init__(self, centers: _Reals, has_center: _Bool) -> None:
        """Restores what compute() made before: centers (V, 3), has_center (V,)."""
    @staticmethod
    def compute(
        skin: Skin,
        face_offsets: _Integers,
        face_vertices: _Integers,
        sigma: float = 0.1,
        progress: Progress | None = None,
    ) -> RotationCenters | None:
        """face_offsets (faces + 1,); face_vertices (C,), face after face. Returns None if progress was cancelled."""
    @property
    def centers(self) -> _Float32:
        """(V, 3), zeros for vertices without a center. A copy."""
    @property
    def has_center(self) -> _Bool:
        """(V,). A copy."""
    @property
    def count(self) -> int:
        """How many vertices have a center."""

class DirectDeltaMush(MethodData):
    """Direct delta mush (Le and Lewis 2019): a skin prepared for skin_direct_delta_mush and for the method
    "direct_delta_mush". Immutable."""

    def __init__(
        self,
        rest_positions: _Reals,
        face_offsets: _Integers,
        face_vertices: _Integers,
        weights: _Reals,
        smoothing: float = 3.0,
        weight_smoothing: float = 1.0,
        blend: float = 0.8,
        iterations: int = 20,
        laplacian: _Laplacian = "cotangent",
        variant: int = 0,
        prune: float = 1e-5,
    ) -> None:
        """rest_positions (V, 3); face_offsets (faces + 1,); face_vertices (C,), face after face; weights (V, J)."""
    @staticmethod
    def compute(
        skin: Skin,
        face_offsets: _Integers,
        face_vertices: _Integers,
        smoothing: float = 3.0,
        weight_smoothing: float = 1.0,
        blend: float = 0.8,
        iterations: int = 20,
        laplacian: _Laplacian = "cotangent",
        variant: int = 0,
        prune: float = 1e-5,
        progress: Progress | None = None,
    ) -> DirectDeltaMush | None:
        """The same from a Skin, to be run in a thread of its own. face_offsets (faces + 1,); face_vertices (C,), face
        after face. Returns None if progress was cancelled."""
    def arrays(self) -> dict[str, Any]:
        """Returns what was computed, to be saved and passed to from_arrays."""
    @staticmethod
    def from_arrays(
        skin: Skin,
        variant: int,
        pruned: float,
        offsets: _Integers,
        joints: _Integers,
        omega: _Reals,
        centers: _Reals,
        scales: _Reals,
    ) -> DirectDeltaMush:
        """Restores what arrays() returned, for a Skin with the same rest positions and joints. offsets (V + 1,); joints
        (N,); omega (N, 10), (N, 4) or (N, 1); centers (V, 3); scales (V,)."""
    @property
    def variant(self) -> int:
        """0 to 5."""
    @property
    def entry_count(self) -> int:
        """N, pairs of a vertex and a joint."""
    @property
    def bytes(self) -> int:
        """How many bytes of memory it takes, without its skin."""
    @property
    def pruned(self) -> float:
        """The largest error of a vertex because joints were left out, as a fraction of the spread of its joints'
        motions."""

class Bends:
    """Influences of bones with segments, split between the ends of the segment that a vertex is at. Immutable."""

    def __init__(
        self,
        vertices: _Integers,
        offsets: _Integers,
        bones: _Integers,
        weights: _Reals,
        first_joints: _Integers,
        segments: _Integers,
        axes: _Reals,
    ) -> None:
        """vertices (N,), ascending; offsets (N + 1,); bones and weights (M,): their influences, not yet split;
        first_joints and segments (B,); axes (B, 4): p is at share axes[:3] . p + axes[3] of a bone's length."""
    @property
    def vertex_count(self) -> int:
        """N."""
    @property
    def influence_count(self) -> int:
        """M."""

class Layer:
    """What one armature does to a mesh. Immutable, except for changes to its skin."""

    def __init__(
        self,
        skin: Skin,
        method: _Method,
        stretch: _Stretch = "polar",
        rest_frames: _Reals | None = None,
        mask: _Reals | None = None,
        share: _Reals | None = None,
        bends: Bends | None = None,
        split_space: _Reals | None = None,
        data: MethodData | None = None,
    ) -> None:
        """rest_frames (J, 4, 4), relative to the armature; mask and share (V,). The first layer of a
        deformer has no share, and every other layer has one. split_space (4, 4): the space in which the
        skin's own weights were split, if there are bends. data: the method's own data for each vertex."""
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def joint_count(self) -> int:
        """J."""

class ShapeKeys:
    """Relative shape keys, as Blender adds them, to the bit. Immutable."""

    def __init__(
        self,
        positions: Sequence[_Reals],
        relative_to: _Integers | Sequence[int],
        weights: Sequence[_Reals | None] | None = None,
    ) -> None:
        """positions: K arrays (V, 3), the first of which is the base; relative_to (K,); weights: K
        entries, each None or (V,)."""
    @property
    def count(self) -> int:
        """K."""
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def delta_count(self) -> int:
        """How many vertices are stored because they differ, summed over all keys."""
    @property
    def base(self) -> _Float32:
        """(V, 3), read-only: the first key."""

class Topology:
    """Which vertices are joined by edges, and the faces around each. Immutable."""

    def __init__(
        self,
        vertex_count: int,
        edges: _Integers,
        face_offsets: _Integers | None = None,
        corner_vertices: _Integers | None = None,
    ) -> None:
        """edges (E, 2), in the order in which sums are taken; face_offsets (faces + 1,);
        corner_vertices (C,), face after face."""
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def edge_count(self) -> int:
        """E."""
    @property
    def corner_count(self) -> int:
        """C."""

class Stage:
    """What a CorrectiveSmooth, a Smooth or another stage does in one frame. Immutable."""

    def apply(self, positions: _Float32) -> None:
        """Works on positions (V, 3), C-contiguous, in place."""

class CorrectiveSmooth:
    """Blender's Corrective Smooth modifier. Immutable except for set_rest_positions."""

    def __init__(
        self,
        topology: Topology,
        rest_positions: _Reals | None = None,
        weights: _Reals | None = None,
        invert: bool = False,
        pin_boundary: bool = False,
        corner_angle: _CornerAngle = "polynomial",
    ) -> None:
        """rest_positions (V, 3), or None for only_smooth; weights (V,); corner_angle: "polynomial" as in
        Blender 4.1 and later, "arc_cosine" as before."""
    @property
    def vertex_count(self) -> int:
        """V."""
    def set_rest_positions(self, positions: _Reals) -> None:
        """Sets another rest shape. positions (V, 3). Not while another thread uses the object."""
    def stage(
        self,
        factor: float = 0.5,
        iterations: int = 5,
        scale: float = 1.0,
        smooth_type: _SmoothType = "simple",
        only_smooth: bool = False,
    ) -> Stage:
        """Returns a stage with the modifier's settings in a frame."""

class Smooth:
    """Blender's Smooth modifier, to the bit. Immutable."""

    def __init__(self, topology: Topology, weights: _Reals | None = None, invert: bool = False) -> None:
        """weights (V,)."""
    @property
    def vertex_count(self) -> int:
        """V."""
    def stage(
        self, factor: float = 0.5, iterations: int = 1, use_x: bool = True, use_y: bool = True, use_z: bool = True
    ) -> Stage:
        """Returns a stage with the modifier's settings in a frame."""

class Hook:
    """Blender's Hook modifier, except for a custom falloff curve. Immutable."""

    def __init__(
        self, vertex_count: int, vertices: _Integers | None = None, weights: _Reals | None = None, invert: bool = False
    ) -> None:
        """vertices (H,): the hooked ones, None for all that have a weight; weights (V,)."""
    @property
    def vertex_count(self) -> int:
        """V."""
    def stage(
        self,
        matrix: _Reals,
        strength: float = 1.0,
        falloff: _Falloff = "none",
        radius: float = 0.0,
        center: Sequence[float] = (0, 0, 0),
        uniform: _Reals | None = None,
    ) -> Stage:
        """matrix (4, 4), in mesh space; uniform (3, 3): distances are measured after this transform."""

class MixedLayers:
    """Layers as a stage, as Blender's Armature modifiers behind others: all start from the shape that the stage gets.
    Immutable; several threads may use one object at once."""

    def __init__(self, layers: Sequence[Layer]) -> None:
        """layers: one or more, mixed in this order."""
    @property
    def vertex_count(self) -> int:
        """V."""
    def stage(self, poses: Sequence[tuple[_Float32, _Float64 | None]]) -> Stage:
        """poses: (matrices (J, 4, 4), mesh_from_armature (4, 4) or None) per layer; kept, not copied."""

class Lattice:
    """Blender's Lattice modifier. Immutable."""

    def __init__(self, vertex_count: int, weights: _Reals | None = None, invert: bool = False) -> None:
        """weights (V,)."""
    @property
    def vertex_count(self) -> int:
        """V."""
    def stage(
        self,
        points: _Reals,
        counts: Sequence[int],
        first: Sequence[float],
        step: Sequence[float],
        interpolation: Sequence[_Spline],
        matrix: _Reals,
        strength: float = 1.0,
        point_weights: _Reals | None = None,
    ) -> Stage:
        """points (P, 3), in lattice space, along u first; counts, first, step, interpolation: for u, v and w, of the
        points at rest; matrix (4, 4), lattice space from mesh space; point_weights (P,)."""

class SurfaceDeform:
    """Blender's Surface Deform modifier. Immutable."""

    def __init__(
        self,
        vertex_count: int,
        vertices: _Integers,
        offsets: _Integers,
        attachments: _Integers,
        corner_offsets: _Integers,
        corners: _Integers,
        corner_weights: _Reals,
        distances: _Reals,
        influences: _Reals,
        weights: _Reals | None = None,
        invert: bool = False,
    ) -> None:
        """vertices (B,); offsets (B + 1,), of the attachments; attachments, distances, influences (N,);
        corner_offsets (N + 1,); corners (C,); corner_weights (W,); weights (V,)."""
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def least_target_count(self) -> int:
        """How many vertices a target must have at least."""
    def stage(self, target: _Reals, matrix: _Reals, strength: float = 1.0) -> Stage:
        """target (T, 3), in its own space; matrix (4, 4), mesh space from there, as when the mesh was bound."""

class MeshDeform:
    """Blender's Mesh Deform modifier, bound without Dynamic. Immutable."""

    def __init__(
        self,
        offsets: _Integers,
        cage_vertices: _Integers,
        cage_weights: _Reals,
        cage_positions: _Reals,
        weights: _Reals | None = None,
        invert: bool = False,
    ) -> None:
        """offsets (V + 1,); cage_vertices, cage_weights (N,), of each influence; cage_positions (C, 3), when bound;
        weights (V,)."""
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def cage_vertex_count(self) -> int:
        """C."""
    def stage(self, cage: _Reals, matrix: _Reals, back: _Reals) -> Stage:
        """cage (C, 3), in its own space; matrix (4, 4), from there to the space of cage_positions; back (3, 3), from
        that to mesh space."""

class Stencils:
    """How each vertex of one mesh is made from those of another, as a weighted sum: what the modifiers Subdivision,
    Mirror and Array do. Immutable."""

    def __init__(
        self,
        offsets: _Integers,
        vertices: _Integers,
        weights: _Reals,
        vertex_count: int,
        scales: _Reals | None = None,
        shifts: _Reals | None = None,
    ) -> None:
        """offsets (R + 1,): stencil r has the entries offsets[r] up to offsets[r + 1]; vertices (N,), of the mesh
        before; weights (N,), finite; vertex_count: V, of that mesh; scales (R, 3), finite, by which the sums are
        multiplied, -1 along the axis of a mirror; shifts (R, 3), finite, what is added then, in the unit of the
        positions."""
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def count(self) -> int:
        """R."""
    @property
    def entry_count(self) -> int:
        """N."""
    @property
    def pattern_count(self) -> int:
        """How many different rows of weights, scales and shifts there are: equal ones are stored once."""
    def apply(self, positions: _Float32, out: _Float32 | None = None) -> _Float32:
        """Makes the vertices: p'(r) = s(r) sum_k w(r, k) p(i(r, k)) + t(r), axis by axis.

        positions (V, 3); out (R, 3), not overlapping positions. Returns out.
        """

class Deformer:
    """Everything that happens to one mesh in a frame: shape keys, skinning layers with their masks and mix,
    and the stages after them. Immutable; several threads may use one object at once."""

    def __init__(
        self,
        layers: Sequence[Layer] = [],
        keys: ShapeKeys | None = None,
        vertex_count: int | None = None,
        stencils: Stencils | None = None,
    ) -> None:
        """layers: mixed in this order; may be empty if there are keys. vertex_count: in place of both, for
        stages alone. stencils: of V vertices, make the result from the shape behind the stages."""
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def result_count(self) -> int:
        """R, of the result: V without stencils."""
    def deform(
        self,
        poses: Sequence[tuple[_Float32, _Float64 | None]],
        out: _Float32,
        key_values: _Float32 | None = None,
        rest_positions: _Float32 | None = None,
        stages: Sequence[Stage] = (),
        milliseconds: _Float64 | None = None,
    ) -> None:
        """Deforms one frame. poses: (matrices (J, 4, 4), mesh_from_armature (4, 4) or None) per layer; out
        (R, 3); key_values (K,); rest_positions (V, 3) in place of those of the skin and of the keys; stages
        work on the result in this order; milliseconds (S + 1,), out: the time of keys and layers, then of
        each stage; with stencils (S + 2,), the last of which is theirs."""

def forward_kinematics(
    skeleton: Skeleton, local: npt.NDArray[_Float], out: npt.NDArray[_Float] | None = None
) -> npt.NDArray[_Float]:
    """Computes F(j) = F(parent) R(j) T(j). local and out (J, 4, 4) or (F, J, 4, 4), any strides; out may be
    local itself and is returned."""

def skinning_matrices(skeleton: Skeleton, world: _Float32 | _Float64, out: _Float32 | None = None) -> _Float32:
    """Computes F(j) A(j)^-1. world and out (J, 4, 4) or (F, J, 4, 4), any strides. Returns out."""

def rotation_transforms(rotations: _Reals, out: _Float64 | None = None) -> _Float64:
    """Computes T(j) of joints that only rotate. rotations (J, 4), unit, w x y z; out (J, 4, 4). Returns out."""

def group_influences(
    offsets: _Integers, groups: _Integers, weights: _Reals, joint_of_group: _Integers, normalize: bool = True
) -> tuple[_Int64, _Int32, _Float32, int, int]:
    """Converts weights of vertex groups, of each vertex v from offsets[v] up to offsets[v + 1], to influences:
    normalize divides them by the sum of those whose group has a joint. offsets (V + 1,); groups, weights (M,);
    joint_of_group (G,), -1 for none. Returns offsets (V + 1,), joints (N,) and weights (N,), as Skin takes them; the
    number of vertices that no joint moves; and the number of those whose weights do not sum to 1."""

def skin_linear(skin: Skin, matrices: _Float32, out: _Float32 | None = None) -> _Float32:
    """Linear blend skinning: v' = sum_j w_j M(j) v. matrices (J, 4, 4) or (F, J, 4, 4), any strides; out
    (V, 3) or (F, V, 3), C-contiguous. Returns out."""

def skin_dual_quaternion(
    skin: Skin,
    matrices: _Float32,
    out: _Float32 | None = None,
    stretch: _Stretch = "polar",
    rest_frames: _Reals | None = None,
) -> _Float32:
    """Dual quaternion skinning (Kavan et al. 2008).

    matrices (J, 4, 4) or (F, J, 4, 4), out (V, 3) or (F, V, 3), as in skin_linear; stretch: what happens to scale and
    shear; rest_frames (J, 4, 4), for all except "polar".
    """

def skin_blended(
    skin: Skin,
    shares: BlendShares,
    matrices: _Float32,
    out: _Float32 | None = None,
    stretch: _Stretch = "polar",
    rest_frames: _Reals | None = None,
) -> _Float32:
    """v' = linear + share (dual quaternion - linear).

    matrices (J, 4, 4) or (F, J, 4, 4), out (V, 3) or (F, V, 3), as in skin_linear; stretch, rest_frames (J, 4, 4), as
    in skin_dual_quaternion.
    """

def skin_rotation_centers(
    skin: Skin, centers: RotationCenters, matrices: _Float32, out: _Float32 | None = None
) -> _Float32:
    """v' = R (v - p) + sum_j w_j M(j) p.

    matrices (J, 4, 4) or (F, J, 4, 4), out (V, 3) or (F, V, 3), as in skin_linear.
    """

def skin_direct_delta_mush(ddm: DirectDeltaMush, matrices: _Float32, out: _Float32 | None = None) -> _Float32:
    """v' = R v + q - R p.

    matrices (J, 4, 4) or (F, J, 4, 4), out (V, 3) or (F, V, 3), as in skin_linear.
    """

def skin_all(
    jobs: Sequence[
        tuple[Skin, _Float32, _Float32, _Method]
        | tuple[Skin, _Float32, _Float32, _Method, _Stretch, _Reals]
        | tuple[Skin, _Float32, _Float32, _Method, _Stretch, _Reals | None, MethodData | None]
    ],
) -> None:
    """Skins several meshes at once, with all threads working on all of them. A job is (skin, matrices, out,
    method[, stretch, rest_frames[, data]]), as in Layer and skin_dual_quaternion."""

def read_dmat(path: _Path) -> _Float64:
    """Reads a .dmat file, text or binary: (rows, columns)."""

def write_dmat(path: _Path, array: _Reals, binary: bool = False) -> None:
    """Writes a file that read_dmat reads back bit for bit. array (rows, columns)."""

def read_skeleton(path: _Path, convention: _Convention | None = None) -> RigSkeleton:
    """Reads a .bf or .tgf file. convention overrides the one that a .bf file indicates."""

def write_skeleton(path: _Path, skeleton: RigSkeleton) -> None:
    """Writes .bf or .tgf, depending on the path's ending."""

def read_rig(
    folder: _Path,
    *,
    skeleton: _Path | None = None,
    mesh: _Path | None = None,
    weights: _Path | None = None,
    pose: _Path | None = None,
    convention: _Convention | None = None,
    quaternion_order: Literal["wxyz", "xyzw"] = "wxyz",
) -> Rig:
    """Reads a rig folder. Files have their usual names, or the given names relative to the folder. weights="auto":
    made from the bones by automatic_weights, instead of read."""

def write_rig(folder: _Path, rig: Rig, *, skeleton: _Path = "skeleton.bf") -> None:
    """Writes into an existing folder. skeleton: the name of its file, ending in .bf or .tgf."""

def colours_apart(
    vertex_count: int, edges: _Integers, face_offsets: _Integers, face_vertices: _Integers, steps: int, most: int = 256
) -> _Int32 | None:
    """Colours vertices so that those of one colour are more than so many steps apart. A step leads to another vertex of
    the same edge or face.

    edges (E, 2); face_offsets (faces + 1,); face_vertices (C,), face after face. Returns (V,), colours from 0 on; None
    if more than `most` would be needed.
    """

def set_thread_count(count: int) -> None:
    """Lets later calls use at most count threads; 0 means as many as the machine has."""

def thread_count() -> int:
    """Returns the number of threads that the next call may use."""

def instruction_sets() -> list[str]:
    """Returns the names of the instruction sets that this machine can run, best first."""

def instruction_set() -> str:
    """Returns the name of the instruction set in use."""

def set_instruction_set(name: str) -> None:
    """Uses this instruction set from now on, or the best for "auto". Waits until running skinning calls have ended."""

class WeightReport:
    """What automatic_weights did. Immutable."""

    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def part_count(self) -> int:
        """How many connected parts the mesh has; coincident vertices are connected."""
    @property
    def surface_count(self) -> int:
        """How many vertices have weights from heat on the surface."""
    @property
    def volume_count(self) -> int:
        """How many have them from heat in the volume: those of fragments and loose vertices."""
    @property
    def nearest_count(self) -> int:
        """How many follow the nearest bone through the air."""
    @property
    def fixed_count(self) -> int:
        """How many were given, with those that coincide with them."""
    @property
    def rigid_count(self) -> int:
        """How many are in rigid parts."""
    @property
    def bones_outside(self) -> _Int32:
        """Bones of which nothing is inside the mesh, ascending."""
    @property
    def voxel_size(self) -> float:
        """In the unit of the positions; 0 if all of them are equal."""
    @property
    def seconds(self) -> float:
        """How long it took."""

class AutomaticWeights:
    """Weights for a Skin, from automatic_weights. Immutable."""

    @property
    def offsets(self) -> _Int64:
        """(V + 1,), read-only: where the entries of each vertex begin."""
    @property
    def joints(self) -> _Int32:
        """(N,), read-only, ascending at each vertex."""
    @property
    def weights(self) -> _Float32:
        """(N,), read-only, above 0, with sum 1 at each vertex."""
    @property
    def ways(self) -> _UInt8:
        """(V,), read-only: how each vertex got its weights: 0 surface, 1 volume, 2 nearest, 3 fixed, 4 rigid."""
    @property
    def parts(self) -> _Int32:
        """(V,), read-only: the connected part of each vertex."""
    @property
    def report(self) -> WeightReport: ...

def automatic_weights(
    positions: _Reals,
    face_offsets: _Integers,
    face_vertices: _Integers,
    heads: _Reals,
    tails: _Reals,
    *,
    joints: _Integers | None = None,
    method: _WeightMethod = "heat",
    resolution: int = 128,
    stiffness: float = 8.0,
    max_influences: int = 0,
    least_weight: float = 0.01,
    fixed_vertices: _Integers | None = None,
    fixed_weights: WeightTable | _Reals | None = None,
    rigid_parts: _Integers | None = None,
    rigid_size: float = 0.0,
    rigid_follow: _RigidFollow = "attachment",
    progress: Progress | None = None,
) -> AutomaticWeights | None:
    """Computes weights for any mesh and any bones by heat diffusion, for a Skin.

    positions (V, 3), any unit and space; face_offsets (faces + 1,); face_vertices (C,), face after face; heads and
    tails (B, 3), in the same space; joints (B,), the joint of each bone, several bones may share one, None: bone b is
    joint b; fixed_vertices (F,) with fixed_weights (F, J), around which the others are solved; rigid_parts (V,), equal
    numbers for the vertices of a rigid part, -1 for the others; rigid_size: connected parts smaller than this share of
    the mesh are rigid, too. Returns None if progress was cancelled.
    """

class Decomposition:
    """Joints, weights and motions that play a deformation, from decompose. Immutable."""

    @property
    def joint_count(self) -> int:
        """J."""
    @property
    def offsets(self) -> _Int64:
        """(V + 1,), read-only: where the entries of each vertex begin."""
    @property
    def joints(self) -> _Int32:
        """(N,), read-only, ascending at each vertex."""
    @property
    def weights(self) -> _Float32:
        """(N,), read-only, above 0, with sum 1 at each vertex; given ones as they were."""
    @property
    def rest(self) -> _Float64:
        """(J, 4, 4), read-only: the joints at rest, unturned."""
    @property
    def poses(self) -> _Float64:
        """(F, J, 4, 4), read-only: skinning matrices; poses[f, j] @ rest[j] is the joint in frame f."""
    @property
    def rms(self) -> float:
        """The root of the mean square distance to the frames, in the unit of the positions."""
    @property
    def mean(self) -> float:
        """The mean distance."""
    @property
    def largest(self) -> float:
        """The largest distance."""
    @property
    def vertex_rms(self) -> _Float32:
        """(V,), read-only: of each vertex, over the frames."""
    @property
    def vertex_largest(self) -> _Float32:
        """(V,), read-only: the largest distance of each vertex."""
    @property
    def iterations(self) -> int:
        """How many were done."""

def decompose(
    rest: _Reals,
    frames: _Reals,
    face_offsets: _Integers,
    face_vertices: _Integers,
    *,
    bones: int = 0,
    heads: _Reals | None = None,
    matrices: _Reals | None = None,
    weights: _Reals | WeightTable | Skin | None = None,
    max_influences: int = 8,
    iterations: int = 30,
    smoothing: float = 1e-4,
    local: bool = True,
    tolerance: float = 1e-3,
    progress: Progress | None = None,
) -> Decomposition | None:
    """Finds joints and weights whose linear skinning plays a deformation (Le and Deng 2012).

    rest (V, 3); frames (F, V, 3), the same vertices in each frame; face_offsets (faces + 1,); face_vertices (C,), face
    after face. What is known: bones, the most joints to find; or heads (J, 3), where they begin; or matrices (F, J, 4,
    4), skinning matrices whose weights are found; or weights (V, J), a WeightTable or a Skin, whose motions are found.
    Returns None if progress was cancelled.
    """

class WeightTable:
    """The weights above 0 of V vertices in B bones: N in all, where a table has V x B. What the weight tools are given
    as a WeightTable, they return as one. Immutable."""

    def __init__(self, offsets: _Integers, bones: _Integers, weights: _Reals, bone_count: int) -> None:
        """offsets (V + 1,): vertex v has the entries offsets[v] up to offsets[v + 1]; bones (N,), in any order at a
        vertex; weights (N,), 0 or more."""
    @staticmethod
    def from_dense(weights: _Reals) -> WeightTable:
        """weights (V, B), 0 or more."""
    def dense(self) -> _Float32:
        """(V, B)."""
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def bone_count(self) -> int:
        """B."""
    @property
    def offsets(self) -> _Int64:
        """(V + 1,), read-only: where the entries of each vertex begin."""
    @property
    def bones(self) -> _Int32:
        """(N,), read-only, ascending at each vertex."""
    @property
    def weights(self) -> _Float32:
        """(N,), read-only, above 0."""

def smooth_weights(
    weights: WeightTable | _Reals,
    face_offsets: _Integers,
    face_vertices: _Integers,
    *,
    strength: float = 0.0,
    steps: int = 5,
    factor: float = 0.5,
    mask: _Reals | _Bool | None = None,
    locked: _Integers | None = None,
    positions: _Reals | None = None,
    progress: Progress | None = None,
) -> WeightTable | _Float32 | None:
    """Smooths weights (V, B) along edges: with a strength in one solve, (I + t L) w' = w, otherwise in steps.

    face_offsets (faces + 1,); face_vertices (C,), face after face; mask (V,): where it is 0, weights stay; locked (L,):
    bones whose weights stay; positions (V, 3): vertices that coincide get equal weights. Returns None if progress was
    cancelled.
    """

def reduce_weights(
    weights: WeightTable | _Reals,
    positions: _Reals,
    matrices: _Reals,
    *,
    max_influences: int = 4,
    rings: int = 0,
    face_offsets: _Integers | None = None,
    face_vertices: _Integers | None = None,
    locked: _Integers | None = None,
    progress: Progress | None = None,
) -> tuple[WeightTable | _Float32, _Float32, _Float32] | None:
    """Leaves each vertex at most max_influences of its weights (V, B), by how far it moves without the others.

    positions (V, 3), at rest; matrices (F, B, 4, 4), skinning matrices; rings: over how many edges of the faces
    weights fade out towards vertices that have lost the bone; face_offsets (faces + 1,); face_vertices (C,), face after
    face; locked (L,): bones whose weights stay, and count. Returns
    (weights (V, B), largest (V,), mean (V,)): how far each vertex moves over the poses; None if progress was cancelled.
    """

def mirror_weights(
    weights: WeightTable | _Reals,
    positions: _Reals,
    face_offsets: _Integers,
    face_vertices: _Integers,
    pairs: _Integers,
    *,
    axis: int = 0,
    origin: float = 0.0,
    from_positive: bool = True,
    middle: float = 1e-5,
    mask: _Reals | _Bool | None = None,
    progress: Progress | None = None,
) -> WeightTable | _Float32 | None:
    """Copies weights (V, B) from one side to the other, by the closest points of the mirrored surface.

    positions (V, 3); face_offsets (faces + 1,); face_vertices (C,), face after face; pairs (B,), the bone on the other
    side of each; origin: where the mirror is on the axis; middle: a
    share of the mesh's size, vertices so near the mirror are of both sides; mask (V,): below 0.5, weights stay.
    Returns None if progress was cancelled.
    """

def transfer_weights(
    source_positions: _Reals,
    source_face_offsets: _Integers,
    source_face_vertices: _Integers,
    source_weights: WeightTable | _Reals,
    positions: _Reals,
    face_offsets: _Integers,
    face_vertices: _Integers,
    *,
    distance: float = 0.05,
    angle: float = 30.0,
    flipped: bool = False,
    progress: Progress | None = None,
) -> tuple[WeightTable | _Float32, _Bool] | None:
    """Copies weights from one surface to another: from the closest points, smooth between them.

    source_positions (V, 3); source_face_offsets (source_faces + 1,); source_face_vertices (D,), face after face;
    source_weights (V, B); positions (W, 3); face_offsets (faces + 1,); face_vertices (C,), face after face; distance: a
    share of the diagonal of the target's bounding box; angle between normals in degrees; flipped: normals may be
    opposite. Returns (weights (W, B), matched (W,)), or None if progress was cancelled.
    """

class RigProgram:
    """An armature's bones, constraints, drivers and curves, evaluated as Blender does. Immutable; any number of threads
    may use it."""

    def __init__(self, description: dict[str, Any] | _Path) -> None:
        """Checks a description, or the file of one that `sinew rig` has written, and puts it in order. Raises
        ValueError, which names what is wrong or not covered."""
    @property
    def names(self) -> list[str]:
        """The bones' B unique names."""
    @property
    def rest(self) -> _Float32:
        """(B, 4, 4), the bones' rest matrices in armature space."""
    @property
    def parents(self) -> _Int32:
        """(B,), the parent of each bone or -1."""
    @property
    def segment_begin(self) -> _Int32:
        """(B + 1,), where each B-bone's matrices begin in segments(); other bones have none."""
    @property
    def joint_begin(self) -> _Int32:
        """(B + 1,), where each bone's joints begin in skinning_matrices(): one, or of a B-bone those of all ends of its
        segments."""
    @property
    def paths(self) -> dict[str, int]:
        """What evaluate() takes, and how many numbers each has: settings of bones and constraints, custom properties,
        and values from outside; see matrix_names too."""
    @property
    def driven(self) -> list[str]:
        """The numbers that drivers set, whatever is given."""
    @property
    def keyed(self) -> list[str]:
        """The numbers that follow curves unless they are given."""
    @property
    def matrix_names(self) -> list[str]:
        """The objects and other rigs' bones whose world matrices come from outside."""
    def edited(self, set: dict[str, Any], curves: list[dict[str, Any]]) -> RigProgram:
        """Returns the same rig after an edit of its pose or its keys, without putting it in order again.

        set: as of evaluate(), but for good and as Blender stores it: curves replace these values. Not for settings of
        constraints. curves: rows as the description's, which replace those of the same properties. Raises ValueError
        for a setting of a constraint, a number that is not finite, and a property without a curve.
        """
    def evaluate(self, frames: _Reals, set: dict[str, Any] = {}) -> _Float32:
        """Returns the bones' matrices in armature space, (F, B, 4, 4).

        frames (F,): times, which may be fractions. set: values for paths such as 'pose.bones["Hand"].location',
        (count,) for all frames or (F, count), and matrices from outside by name, (4, 4) or (F, 4, 4); they replace the
        description's values and curves, and drivers replace them. Raises ValueError for an unknown path, for a wrong
        shape, and if a driver divides by 0.
        """
    def skinning_matrices(self, frames: _Reals, set: dict[str, Any] = {}) -> _Float32:
        """Returns the matrices that move vertices from rest to pose, in armature space, (F, J, 4, 4), for skins whose
        joints are numbered as joint_begin says.

        frames (F,); arguments and errors: see evaluate().
        """
    def segments(self, frames: _Reals, set: dict[str, Any] = {}) -> _Float32:
        """Returns the matrices at the ends of the B-bones' segments, relative to their bones, (F, S, 4, 4).

        frames (F,); arguments and errors: see evaluate().
        """
    def values(self, frames: _Reals, paths: list[str], set: dict[str, Any] = {}) -> _Float32:
        """Returns what properties hold, (F, N), all numbers of each path one after the other.

        frames (F,); other arguments and errors: see evaluate().
        """
    def places(self, paths: list[str]) -> _Int32:
        """Returns where the numbers of paths are among all numbers of the rig, (P,), for rig_records. It is the same in
        a rig that `edited` returns. Raises ValueError for an unknown path.
        """
    def profile(self, frames: _Reals, set: dict[str, Any] = {}) -> dict[str, float]:
        """Evaluates frames on one thread and returns the seconds that its parts took, all frames together: 'curves',
        'drivers', 'bones' with their constraints, 'ik' and 'segments' of B-bones.

        frames (F,); arguments and errors: see evaluate().
        """

def rig_records(
    rigs: list[tuple[RigProgram, _Reals, _Integers, dict[str, Any]]], fields: list[tuple[str, int, int]]
) -> list[tuple[_UInt8, _Float32] | str]:
    """Returns what Blender's evaluation would leave in the memory of the bones of several rigs, which are computed at
    the same time.

    rigs: of each (program, (F,) times, (P,) places of numbers, see RigProgram.places, and what evaluate() takes as
    `set`). fields: (name, first, count) of what a bone holds, in this order: 'channel_matrix', 'pose_matrix', 'head'
    and 'tail'; 'values' are `count` of the bone's numbers from `first` on, in the order of rig_bone_settings().
    Returns of each rig a tuple of its records, (F, N), and those numbers, (F, P); or a sentence if a driver divides by
    0. A record is what host.record_pose returns, with the rig's dual quaternions. Raises ValueError for an unknown
    place or field.
    """

class RigRecordsAhead:
    """What rig_records returns, computed by other threads meanwhile."""

    def __init__(
        self, rigs: list[tuple[RigProgram, _Reals, _Integers, dict[str, Any]]], fields: list[tuple[str, int, int]]
    ) -> None:
        """Begins, and returns at once. Arguments and errors: see rig_records."""
    def found(self) -> list[tuple[_UInt8, _Float32] | str]:
        """Waits for the threads, and returns what rig_records returns."""

def rig_bone_settings() -> list[tuple[str, int]]:
    """Returns the settings of a bone in the order of its `values`, and how many numbers each has."""

def rig_constraint_settings() -> dict[str, dict[str, tuple[int, str, float, float, float]]]:
    """Returns the settings of each type of constraint, and of each how many numbers it has, their type, which is
    'FLOAT', 'INT', 'BOOLEAN' or 'ENUM', their default, and their limits."""
