"""Skeletal deformation: forward kinematics, skinning, shape keys, smoothing and the files of a rig folder.

Letters: V vertices, J joints, P poses, F frames, N influences of all vertices together. Matrices are
indexed m[..., row, column] and move column vectors. A mistake raises ValueError with a one-sentence message.
tests/python/test_stub.py compares this file with the compiled module.
"""

import os
from collections.abc import Callable, Sequence
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
        """parents: (J,) integers, each joint's parent, -1 for a root; a parent may come after its child.
        rest: (J, 4, 4), R(j), each joint's rest transform relative to its parent, or to the world for a root.
        Raises ValueError for a parent that does not exist, a cycle, a number that is not finite, a rest transform that
        cannot be inverted.
        """
    @property
    def joint_count(self) -> int:
        """J."""
    @property
    def parents(self) -> _Int32:
        """(J,) int32, read-only: each joint's parent, -1 for a root."""
    @property
    def rest(self) -> _Float64:
        """(J, 4, 4) float64, read-only: R(j), relative to the parent."""
    @property
    def rest_world(self) -> _Float64:
        """(J, 4, 4) float64, read-only: A(j), relative to the world."""
    @property
    def inverse_rest(self) -> _Float64:
        """(J, 4, 4) float64, read-only: A(j)^-1."""

class RigSkeleton(Skeleton):
    """A skeleton as a .bf or .tgf file describes it: a Skeleton whose rest transforms are translations, with a bone to
    draw and a column of weights for each joint.
    """

    def __init__(
        self,
        parents: _Integers,
        heads: _Reals,
        tails: _Reals,
        weight_columns: _Integers,
        names: list[str] = [],
        convention: _Convention = "joint",
    ) -> None:
        """parents: (J,) integers, each joint's parent, -1 for a root; a parent may come after its child.
        heads: (J, 3), world: where each joint turns, the translation of A(j).
        tails: (J, 3), world: where its bone is drawn to.
        weight_columns: (J,) integers, the joint's column of weights, or -1; no column may belong to two joints.
        names: J unique names; if empty, they are made from the joints' numbers.
        convention: "joint", a row of the file stands for a joint and turns about it; or "bone", for the bone that ends
        there and turns about the parent's place.
        Raises ValueError if the parts do not fit each other, for a cycle, and for a number that is not finite.
        """
    @property
    def heads(self) -> _Float64:
        """(J, 3) float64, read-only, world: where each joint turns."""
    @property
    def tails(self) -> _Float64:
        """(J, 3) float64, read-only, world: where its bone is drawn to."""
    @property
    def weight_columns(self) -> _Int32:
        """(J,) int32, read-only: the joint's column of weights, or -1."""
    @property
    def names(self) -> list[str]:
        """J unique names."""
    @property
    def convention(self) -> _Convention:
        """\"bone" or "joint"."""

class PoseClip:
    """P poses of J joint rotations. Immutable."""

    def __init__(self, rotations: _Reals) -> None:
        """rotations: (P, J, 4), quaternions w x y z, each on top of its joint's rest transform; they are normalized.
        Raises ValueError if there is no pose or no joint, and for a quaternion that is not finite or has length 0.
        """
    @property
    def joint_count(self) -> int:
        """J."""
    @property
    def pose_count(self) -> int:
        """P."""
    @property
    def rotations(self) -> _Float64:
        """(P, J, 4) float64, w x y z, unit length. A copy."""
    def sample(self, time: float, loop: bool = False) -> _Float64:
        """Returns the rotations, (J, 4) float64 w x y z, at a time counted in poses, by spherical interpolation.

        time: 0 is the first pose, P - 1 the last.
        loop: the first pose follows the last, and time wraps at P; otherwise time is clamped to the ends.
        Raises ValueError for a time that is not finite.
        """

class BvhClip:
    """F frames of J joints as a .bvh file has them: without rest rotations and scales. Immutable."""

    def __init__(
        self,
        names: list[str],
        parents: _Integers,
        offsets: _Reals,
        frame_time: float,
        locations: _Reals,
        rotations: _Reals,
        ends: _Reals | None = None,
    ) -> None:
        """names: J names.
        parents: (J,) integers, each joint's parent, -1 for a root.
        offsets: (J, 3), at rest: where each joint is relative to its parent, or to the world for a root.
        frame_time: seconds from one frame to the next.
        locations: (F, J, 3), on top of the offset, relative to the parent.
        rotations: (F, J, 4), quaternions w x y z, relative to the parent; they are normalized.
        ends: (J, 3), at rest: where the bone of a joint without children ends, relative to the joint; all 0 if None.
        Raises ValueError if the parts do not fit each other, for a cycle, for no frame, and for a number that is not
        finite.
        """
    @property
    def names(self) -> list[str]:
        """J names."""
    @property
    def skeleton(self) -> Skeleton:
        """The Skeleton, whose rest transforms are translations."""
    @property
    def offsets(self) -> _Float64:
        """(J, 3) float64, read-only, at rest: where each joint is relative to its parent."""
    @property
    def ends(self) -> _Float64:
        """(J, 3) float64, read-only, at rest: where the bone of a joint without children ends, relative to it."""
    @property
    def frame_time(self) -> float:
        """Seconds from one frame to the next."""
    @property
    def frame_count(self) -> int:
        """F."""
    @property
    def locations(self) -> _Float64:
        """(F, J, 3) float64, read-only: on top of the offset, relative to the parent."""
    @property
    def rotations(self) -> _Float64:
        """(F, J, 4) float64, w x y z, unit length. A copy."""
    @property
    def local(self) -> _Float64:
        """(F, J, 4, 4) float64: T(j), as forward_kinematics takes them. A copy."""

class Rig:
    """Mesh, skeleton, weights and poses that belong together."""

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
        """positions: (V, 3), rest positions.
        face_offsets: (faces + 1,) integers, where each face's vertices begin.
        face_vertices: (C,), vertex numbers, face after face.
        skeleton: J joints.
        weights: (V, columns), a column for each joint that has a weight column.
        poses: of J joints, or None.
        animation: (F, J, 4, 4), skinning matrices, or None.
        face_materials: (faces,) integers into material_names, -1 for none; or None.
        material_names: in order of first use.
        material_library: the file that describes the materials, or an empty string.
        Raises ValueError if the parts do not fit each other.
        """
    @property
    def positions(self) -> _Float32:
        """(V, 3) float32, read-only: rest positions."""
    @property
    def face_offsets(self) -> _Int32:
        """(faces + 1,) int32, read-only: where each face's vertices begin."""
    @property
    def face_vertices(self) -> _Int32:
        """int32, read-only: vertex numbers, face after face."""
    @property
    def face_materials(self) -> _Int32:
        """(faces,) int32, read-only: index into material_names, or -1. Empty if the file has no materials."""
    @property
    def material_names(self) -> list[str]:
        """In order of first use."""
    @property
    def material_library(self) -> str:
        """The file that describes the materials, or an empty string."""
    @property
    def skeleton(self) -> RigSkeleton:
        """The RigSkeleton."""
    @property
    def weights(self) -> _Float64:
        """(V, columns) float64, read-only: column c belongs to the joint whose weight column is c."""
    @property
    def clamped_weights(self) -> int:
        """How many weights of the file were below 0 or above 1, see read_rig."""
    @property
    def poses(self) -> PoseClip | None:
        """PoseClip, or None."""
    @property
    def animation(self) -> _Float64 | None:
        """(F, J, 4, 4) float64, read-only: skinning matrices, or None."""

class Skin:
    """The mesh at rest and what moves each vertex. Immutable except for set_rest_positions."""

    def __init__(
        self, rest_positions: _Reals, offsets: _Integers, joints: _Integers, weights: _Reals, joint_count: int
    ) -> None:
        """rest_positions: (V, 3), space of the mesh.
        offsets: (V + 1,) integers; vertex v has the influences offsets[v] up to offsets[v + 1].
        joints: (N,) integers, each in 0 to J - 1.
        weights: (N,), used as they are; those of a vertex should sum to 1.
        joint_count: J, how many matrices a frame has.
        All influences are kept, in their order. A vertex without any, or with only zeros, stays at rest.
        Raises ValueError for sizes that do not fit, a joint that does not exist, a number that is not finite.
        """
    @staticmethod
    def from_dense(rest_positions: _Reals, weights: _Reals) -> Skin:
        """A skin from a dense table of weights.

        rest_positions: (V, 3), space of the mesh.
        weights: (V, J), column j for joint j; exact zeros are left out.
        Raises ValueError as the constructor does.
        """
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
        """The most influences that a vertex has."""
    @property
    def unweighted_count(self) -> int:
        """How many vertices nothing moves."""
    @property
    def largest_sum_error(self) -> float:
        """The largest |sum of weights - 1| of a vertex that something moves."""
    @property
    def rest_positions(self) -> _Float32:
        """(V, 3) float32, read-only, space of the mesh."""
    @property
    def offsets(self) -> _Int64:
        """(V + 1,) int64, read-only: where each vertex's influences begin."""
    @property
    def joints(self) -> _Int32:
        """(N,) int32, read-only."""
    @property
    def weights(self) -> _Float32:
        """(N,) float32, read-only."""
    def set_rest_positions(self, positions: _Reals) -> None:
        """Sets another rest shape, for example after a change of shape keys; influences stay. Do not call it while
        another thread skins with it.

        positions: (V, 3), space of the mesh; copied.
        Raises ValueError, and changes nothing, for another number of vertices or a number that is not finite.
        """

class MethodData:
    """A method's own data for each vertex: the base class of BlendShares, RotationCenters and DirectDeltaMush.
    Immutable.
    """

    @property
    def method(self) -> str:
        """The one method that takes it."""
    @property
    def vertex_count(self) -> int:
        """V."""

class BlendShares(MethodData):
    """The share of dual quaternion skinning of each vertex, for the method "blended"."""

    def __init__(self, shares: _Reals) -> None:
        """shares: (V,), each from 0, linear skinning, to 1, dual quaternion skinning; the ends give exactly the bits of
        these two. Copied.
        Raises ValueError, naming the vertex, for a share that is not from 0 to 1.
        """
    @property
    def shares(self) -> _Float32:
        """(V,) float32, read-only."""

class Progress:
    """The progress of a long computation, and a way to cancel it. Make it in one thread and pass it to a computation in
    another.
    """

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
        which cannot be interrupted: 0.2 s for 300,000 vertices, 0.4 s in transfer_weights.
        """

class RotationCenters(MethodData):
    """Optimized centers of rotation (Le and Hodgins 2016), for the method "rotation_centers"."""

    def __init__(self, centers: _Reals, has_center: _Bool) -> None:
        """Restores arrays that compute() made before.

        centers: (V, 3), space of the rest mesh.
        has_center: (V,) bool; a vertex without a center moves linearly, and its row of centers is ignored.
        Raises ValueError for sizes that do not fit and for a center that is not finite.
        """
    @staticmethod
    def compute(
        skin: Skin,
        face_offsets: _Integers,
        face_vertices: _Integers,
        sigma: float = 0.1,
        progress: Progress | None = None,
    ) -> RotationCenters | None:
        """For each vertex, the mean of the mesh's surface, weighted by how similar the weights there are to the
        vertex's own. The GIL is released.

        skin: V vertices at rest; weights that are not above 0 count as 0. It must not change meanwhile.
        face_offsets: (faces + 1,) integers, where each face begins in face_vertices.
        face_vertices: (C,) integers, the vertices around each face; a polygon counts as a fan of triangles.
        sigma: above 0; the larger it is, the less similar weights need to be.
        progress: a Progress that another thread watches, or None.
        A vertex has no center if fewer than two joints move it, or if no triangle has similar weights. Triangles whose
        weights differ by less than a sixteenth of sigma are taken together. Returns None if progress was cancelled,
        which Ctrl C does, too. Raises ValueError for what does not fit.
        """
    @property
    def centers(self) -> _Float32:
        """(V, 3) float32, zeros for vertices without a center. A copy."""
    @property
    def has_center(self) -> _Bool:
        """(V,) bool. A copy."""
    @property
    def count(self) -> int:
        """How many vertices have a center."""

class DirectDeltaMush(MethodData):
    """Direct delta mush (Le and Lewis 2019): a skin prepared for skin_direct_delta_mush and for the method
    "direct_delta_mush". Immutable.
    """

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
        """rest_positions: (V, 3), space of the mesh.
        face_offsets: (faces + 1,) integers, where the corners of each face begin.
        face_vertices: (C,) integers, the vertices around each face, face after face; a polygon counts as a fan of
        triangles.
        weights: (V, J), column j for joint j.
        smoothing: lambda, 0 to 1,000, how strongly each iteration smooths the shape.
        weight_smoothing: kappa, 0 to 1,000, the same for the weights that `blend` uses.
        blend: alpha, 0 to 1, how much of the translation comes from smoothed weights alone.
        iterations: p, 0 to 1,000, how many times both are smoothed; 0 is linear skinning.
        laplacian: "cotangent", or "uniform" for edges that all count the same.
        variant: what is kept. 0: ten numbers per vertex and joint, the full method. 1: ten, turned by the inverse
        transpose of the deformation, which shears. 2: four, turned by blended quaternions, so that translations of
        joints no longer turn the surface. 3: four, by blended matrices. 4: one, turned as 2 about the smoothed rest
        position. 5: one, linear skinning by the smoothed weights.
        prune: 0 to 1: for each vertex, joints are left out that together move it by less than this fraction of the
        spread of its joints' motions.
        Takes seconds for large meshes. Raises ValueError for sizes that do not fit, a vertex that does not exist, a
        setting out of range, a number that is not finite.
        """
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
        """The same from a Skin, to be run in a thread of its own.

        skin: a Skin, which must not change meanwhile.
        face_offsets: (faces + 1,) integers, where the corners of each face begin.
        face_vertices: (C,) integers, the vertices around each face, face after face; a polygon counts as a fan of
        triangles.
        smoothing: lambda, 0 to 1,000, how strongly each iteration smooths the shape.
        weight_smoothing: kappa, 0 to 1,000, the same for the weights that `blend` uses.
        blend: alpha, 0 to 1, how much of the translation comes from smoothed weights alone.
        iterations: p, 0 to 1,000, how many times both are smoothed; 0 is linear skinning.
        laplacian: "cotangent", or "uniform" for edges that all count the same.
        variant: what is kept. 0: ten numbers per vertex and joint, the full method. 1: ten, turned by the inverse
        transpose of the deformation, which shears. 2: four, turned by blended quaternions, so that translations of
        joints no longer turn the surface. 3: four, by blended matrices. 4: one, turned as 2 about the smoothed rest
        position. 5: one, linear skinning by the smoothed weights.
        prune: 0 to 1: for each vertex, joints are left out that together move it by less than this fraction of the
        spread of its joints' motions.
        progress: a Progress that another thread watches, or None. If it is cancelled, None is returned. Ctrl C cancels
        it, too.
        Raises ValueError as the constructor does.
        """
    def arrays(self) -> dict[str, Any]:
        """Returns what was computed, to be saved and passed to from_arrays: variant, pruned; offsets (V + 1,) int64,
        where each vertex's N entries begin; joints (N,) int32; omega (N, 10), (N, 4) or (N, 1) float32: second moment
        xx xy xz yy yz zz about the center, first moment x y z, share, or the last of them; centers (V, 3) float32, the
        smoothed rest positions; scales (V,) float32.
        """
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
        """Restores what arrays() returned, for a Skin with the same rest positions and joints.

        offsets: (V + 1,) integers.
        joints: (N,) integers.
        omega: (N, 10), (N, 4) or (N, 1).
        centers: (V, 3).
        scales: (V,).
        Raises ValueError for sizes that do not fit, a joint that does not exist, a number that is not finite.
        """
    @property
    def variant(self) -> int:
        """0 to 5."""
    @property
    def entry_count(self) -> int:
        """N, pairs of a vertex and a joint."""
    @property
    def bytes(self) -> int:
        """How many bytes it takes, without its skin."""
    @property
    def pruned(self) -> float:
        """The largest error of a vertex because joints were left out, as a fraction of the spread of its joints'
        motions; at most `prune`, except with very many joints.
        """

class Bends:
    """Influences of bones with segments, which are split between the two ends of the segment that a vertex is at: N
    vertices with M influences of B bones. Immutable.
    """

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
        """vertices: (N,) integers, ascending: the vertices with an influence of a bone with segments.
        offsets: (N + 1,) integers: vertices[i] has the influences offsets[i] to offsets[i + 1].
        bones: (M,) integers in 0..B-1: all influences of these vertices, not yet split, in stored order.
        weights: (M,) float32.
        first_joints: (B,) integers, the first joint of each bone.
        segments: (B,) integers: 1 is an ordinary bone with one joint, n > 1 one with n + 1.
        axes: (B, 4) float64: a point p of the armature's space lies at share axes[b, :3] . p + axes[b, 3] of the bone's
        length, 0 at the head and 1 at the tail; points beyond count as at the end.
        All are copied. Raises ValueError for sizes that do not fit and for numbers that are out of range or not finite.
        """
    @property
    def vertex_count(self) -> int:
        """N."""
    @property
    def influence_count(self) -> int:
        """M."""

class HalfTurn(ValueError):
    """Joints are half a turn apart, see Layer."""

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
        refuse_half_turns: bool = False,
    ) -> None:
        """skin: a Skin of V vertices and J joints; several layers may share it.
        method: "linear" or "dual_quaternion"; or, with data, "blended", "rotation_centers" or "direct_delta_mush".
        stretch: of dual quaternions, as in skin_dual_quaternion.
        rest_frames: (J, 4, 4), as in skin_dual_quaternion, but relative to the armature.
        mask: (V,), how much of the motion each vertex gets: p' = p + mask (skinned(p) - p). None: all of it.
        share: (V,), for a layer that is mixed in: shape += share (own - shape). The first layer has no share, and every
        other layer has one.
        bends: a Bends: influences that are split in the skin as at its rest positions and in split_space. On each
        frame, those of vertices that shape keys move are split again at their new place; with other rest positions, or
        in another space, all are.
        split_space: (4, 4), the space in which the skin was split, None if it is the pose's.
        data: the method's own data for each vertex: a BlendShares, a RotationCenters or a DirectDeltaMush, which bends
        do not change; None for a method without data.
        refuse_half_turns: with dual quaternions, whoever deforms raises HalfTurn, a ValueError, if joints that move the
        same vertices, or some beside them, are half a turn apart, but for rounding, on which it then depends which way
        lies between them.
        All except skin, bends and data are copied. Raises ValueError for sizes that do not fit and for numbers that are
        not finite.
        """
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def joint_count(self) -> int:
        """J."""

class ShapeKeys:
    """Relative shape keys, as Blender adds them, to the bit. Of each key only the differences are stored. Immutable."""

    def __init__(
        self,
        positions: Sequence[_Reals],
        relative_to: _Integers | Sequence[int],
        weights: Sequence[_Reals | None] | None = None,
    ) -> None:
        """positions: K arrays (V, 3), the first of which is the base. They are read once and not kept.
        relative_to: (K,) integers, the key that each one is relative to; a key that is relative to a missing one adds
        nothing.
        weights: K entries, each None or (V,): how much each vertex takes of the key.
        Raises ValueError for sizes that differ and for numbers that are not finite.
        """
    @property
    def count(self) -> int:
        """K."""
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def delta_count(self) -> int:
        """How many vertices of all keys are stored because they differ."""
    @property
    def base(self) -> _Float32:
        """(V, 3) float32, read-only: the first key."""

class Topology:
    """Which vertices are joined by edges, and the faces around each. Immutable."""

    def __init__(
        self,
        vertex_count: int,
        edges: _Integers,
        face_offsets: _Integers | None = None,
        corner_vertices: _Integers | None = None,
    ) -> None:
        """vertex_count: V.
        edges: (E, 2) integers. Sums over neighbors are taken in this order, as in Blender. Edges without a face are
        allowed.
        face_offsets: (faces + 1,) integers, where the corners of each face begin. None: there are no faces.
        corner_vertices: (C,) integers, the vertices around each face, face after face.
        All are copied. Raises ValueError for a vertex out of range, for offsets that do not fit, for a face with fewer
        than three corners and for one with a side that is not an edge.
        """
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
    """What a CorrectiveSmooth, a Smooth or another stage does in one frame: made by their stage(...), for apply or for
    Deformer.deform. Immutable.
    """

    def apply(self, positions: _Float32) -> None:
        """Works in place. Several threads may call it at once.

        positions: (V, 3) float32, C-contiguous.
        Raises ValueError, and writes nothing, if the shape or dtype does not fit.
        """

class CorrectiveSmooth:
    """Blender's Corrective Smooth modifier: smooths the shape, then adds what smoothing removes from the rest shape,
    turned with the faces. It equals Blender's result to the bit, except with arc cosines. Immutable except for
    set_rest_positions; several threads may use one at once.
    """

    def __init__(
        self,
        topology: Topology,
        rest_positions: _Reals | None = None,
        weights: _Reals | None = None,
        invert: bool = False,
        pin_boundary: bool = False,
        corner_angle: _CornerAngle = "polynomial",
    ) -> None:
        """topology: a Topology of V vertices.
        rest_positions: (V, 3), the shape that keeps its detail: Blender's original or bound coordinates. None: for
        only_smooth.
        weights: (V,), how much of it each vertex gets; None: all of it.
        invert: use 1 - weight instead of each weight. Without weights it has no effect.
        pin_boundary: vertices on edges with only one face get weight 0.
        corner_angle: "polynomial" as in Blender 4.1 and later, "arc_cosine" as before.
        All but topology is copied. Vertices of weight 0 stay, and cost nothing. Raises ValueError for sizes that do not
        fit and for numbers that are not finite.
        """
    @property
    def vertex_count(self) -> int:
        """V."""
    def set_rest_positions(self, positions: _Reals) -> None:
        """Sets another rest shape. Do not call it while another thread uses the object.

        positions: (V, 3), copied.
        Raises ValueError for another number of positions and for one that is not finite.
        """
    def stage(
        self,
        factor: float = 0.5,
        iterations: int = 5,
        scale: float = 1.0,
        smooth_type: _SmoothType = "simple",
        only_smooth: bool = False,
    ) -> Stage:
        """factor: any finite number, even outside of 0 to 1.
        iterations: if 0 or less, nothing happens.
        scale: multiplies what is added.
        smooth_type: "simple" or "length_weighted".
        only_smooth: nothing is added.
        What smoothing removes from the rest shape is kept from frame to frame while factor, iterations and smooth_type
        stay the same. Raises ValueError for an unknown name, for numbers that are not finite, and without rest
        positions unless only_smooth.
        """

class Smooth:
    """Blender's Smooth modifier, to the bit: moves vertices towards the mean of the midpoints of their edges. A vertex
    without edges has the mean 0. Immutable; several threads may use one at once.
    """

    def __init__(self, topology: Topology, weights: _Reals | None = None, invert: bool = False) -> None:
        """topology: a Topology of V vertices.
        weights: (V,), how much of it each vertex gets; None: all of it.
        invert: use 1 - weight instead of each weight. Without weights it has no effect.
        All but topology is copied. Vertices of weight 0 or less stay, and cost nothing. Raises ValueError for sizes
        that do not fit and for numbers that are not finite.
        """
    @property
    def vertex_count(self) -> int:
        """V."""
    def stage(
        self, factor: float = 0.5, iterations: int = 1, use_x: bool = True, use_y: bool = True, use_z: bool = True
    ) -> Stage:
        """factor: any finite number, even outside of 0 to 1.
        iterations: if 0 or less, nothing happens.
        use_x, use_y, use_z: the axes along which vertices move.
        Raises ValueError for a factor that is not finite.
        """

class Hook:
    """Blender's Hook modifier: moves vertices by a matrix, x += part (M x - x), part = strength falloff weight.
    Immutable; several threads may use one at once.
    """

    def __init__(
        self, vertex_count: int, vertices: _Integers | None = None, weights: _Reals | None = None, invert: bool = False
    ) -> None:
        """vertex_count: V.
        vertices: (H,) integers, the hooked vertices; one that is listed twice is moved twice. None: all that have a
        weight.
        weights: (V,), how much of it each vertex gets; None: all of it.
        invert: use 1 - weight instead of each weight. Without weights it has no effect.
        All are copied. Without vertices and weights nothing is hooked, as in Blender. Raises ValueError for a vertex
        out of range, for sizes that do not fit and for numbers that are not finite.
        """
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
        """matrix: (4, 4), M, in the space of the mesh.
        strength: any finite number.
        falloff: how the strength falls from the center to the radius: "none", "constant", "linear", "smooth", "sharp",
        "root", "sphere" or "inverse_square".
        radius: 0 is no falloff.
        center: x, y, z in the space of the mesh.
        uniform: (3, 3): a transform in which distances are measured. None: the space of the mesh.
        Raises ValueError for an unknown falloff, for shapes that do not fit and for numbers that are not finite.
        """

class MixedLayers:
    """Layers as a stage, as Blender's Armature modifiers behind others: all start from the shape that the stage gets,
    and their results are mixed by their shares. Immutable; several threads may use one at once.
    """

    def __init__(self, layers: Sequence[Layer]) -> None:
        """layers: one or more Layer objects, mixed in this order. The rest positions of their skins have no effect, and
        bends are split where the vertices are in the shape that the stage gets. Raises ValueError if there are none, if
        their numbers of vertices differ, if the first has a share, or if another has none.
        """
    @property
    def vertex_count(self) -> int:
        """V."""
    def stage(self, poses: Sequence[tuple[_Float32, _Float64 | None]]) -> Stage:
        """poses: (matrices, space) per layer, as in Deformer.deform. The arrays are kept, not copied. Raises ValueError
        if a shape or dtype does not fit.
        """

class Lattice:
    """Blender's Lattice modifier: moves vertices with the points of a lattice around them. Immutable; several threads
    may use one at once.
    """

    def __init__(self, vertex_count: int, weights: _Reals | None = None, invert: bool = False) -> None:
        """vertex_count: V.
        weights: (V,), how much of it each vertex gets; None: all of it. Vertices of weight 0 or less stay, and cost
        nothing.
        invert: use 1 - weight instead of each weight. Without weights it has no effect.
        All are copied. Raises ValueError for sizes that do not fit and for numbers that are not finite.
        """
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
        """points: (P, 3), the points in this frame, in the space of the lattice; u changes fastest.
        counts: how many there are along u, v and w; their product is P.
        first, step: where the points at rest begin along each axis, and the distance between them.
        interpolation: along each axis "linear", "cardinal", "catmull_rom" or "bspline".
        matrix: (4, 4), from the space of the mesh to that of the lattice.
        strength: any finite number.
        point_weights: (P,), how much of the effect is kept around each point; None: all of it.
        All are copied. Raises ValueError for an unknown interpolation, for sizes that do not fit, for numbers that are
        not finite and for a matrix without inverse.
        """

class SurfaceDeform:
    """Blender's Surface Deform modifier: vertices are attached to faces of a target. Immutable; several threads may use
    one at once.
    """

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
        """vertex_count: V.
        vertices: (B,), the bound ones.
        offsets: (B + 1,), where the attachments of each begin.
        attachments: (N,), how each is attached to a face: 0 to the first three corners, 1 to all corners, 2 to the
        first two and the mean of all.
        corner_offsets: (N + 1,), where the corners of each attachment's face begin.
        corners: (C,), vertices of the target, around each face.
        corner_weights: (W,), of the attachments in turn: one for each corner if it is attached to all, otherwise three.
        distances: (N,), along the normal of the face.
        influences: (N,), the share of each attachment.
        weights: (V,), how much of it each vertex gets; None: all of it. Vertices of weight 0 stay, and cost nothing.
        invert: use 1 - weight instead of each weight. Without weights it has no effect.
        All are copied. Raises ValueError for sizes that do not fit, for what is out of range and for numbers that are
        not finite.
        """
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def least_target_count(self) -> int:
        """How many vertices a target must have at least."""
    def stage(self, target: _Reals, matrix: _Reals, strength: float = 1.0) -> Stage:
        """target: (T, 3), its positions in this frame, in its own space.
        matrix: (4, 4), from that space to the mesh's, as when the mesh was bound.
        strength: any finite number.
        All are copied. Raises ValueError for shapes that do not fit and for a strength that is not finite.
        """

class MeshDeform:
    """Blender's Mesh Deform modifier, bound without Dynamic: vertices follow the weighted mean of how far the vertices
    of a cage have moved. Immutable; several threads may use one at once.
    """

    def __init__(
        self,
        offsets: _Integers,
        cage_vertices: _Integers,
        cage_weights: _Reals,
        cage_positions: _Reals,
        weights: _Reals | None = None,
        invert: bool = False,
    ) -> None:
        """offsets: (V + 1,), where the influences of each vertex begin.
        cage_vertices, cage_weights: (N,), of each influence.
        cage_positions: (C, 3), when the mesh was bound.
        weights: (V,), how much of it each vertex gets; None: all of it. Vertices of weight 0 or less stay, and cost
        nothing, as do those without influences.
        invert: use 1 - weight instead of each weight. Without weights it has no effect.
        All are copied. Raises ValueError for sizes that do not fit, for what is out of range and for numbers that are
        not finite.
        """
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def cage_vertex_count(self) -> int:
        """C."""
    def stage(self, cage: _Reals, matrix: _Reals, back: _Reals) -> Stage:
        """cage: (C, 3), its positions in this frame, in its own space.
        matrix: (4, 4), from that space to the one of cage_positions.
        back: (3, 3), from there to the space of the mesh.
        All are copied. Raises ValueError for shapes that do not fit and for a matrix that is not finite.
        """

class Stencils:
    """How each vertex of one mesh is made from those of another, as a weighted sum: what the modifiers Subdivision,
    Mirror and Array do. Immutable.
    """

    def __init__(
        self,
        offsets: _Integers,
        vertices: _Integers,
        weights: _Reals,
        vertex_count: int,
        scales: _Reals | None = None,
        shifts: _Reals | None = None,
    ) -> None:
        """offsets: (R + 1,) integers; stencil r has the entries offsets[r] up to offsets[r + 1].
        vertices: (N,) integers, of the mesh before.
        weights: (N,), finite. Equal rows are stored once.
        vertex_count: V, of the mesh before.
        scales: (R, 3), finite, by which the sums are multiplied: -1 along the axis of a mirror; None: 1.
        shifts: (R, 3), finite, what is added then, in the unit of the positions; None: 0.

        All are copied. Raises ValueError for what does not fit.
        """
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
        """How many different rows of weights, scales and shifts there are."""
    def apply(self, positions: _Float32, out: _Float32 | None = None) -> _Float32:
        """Makes the vertices: p'(r) = s(r) sum_k w(r, k) p(i(r, k)) + t(r), axis by axis, in float32 and in the order
        of the entries, so that any number of threads gives the same bits. The GIL is released.

        positions: (V, 3) float32, C-contiguous.
        out: (R, 3) float32, C-contiguous, not overlapping positions; made if None.

        Returns out. Raises ValueError for another shape or dtype.
        """

class Deformer:
    """Everything that happens to one mesh in a frame: shape keys, skinning layers with their masks and mix, and the
    stages after them. Immutable; several threads may use one at once.
    """

    def __init__(
        self,
        layers: Sequence[Layer] = [],
        keys: ShapeKeys | None = None,
        vertex_count: int | None = None,
        stencils: Stencils | None = None,
    ) -> None:
        """layers: Layer objects, mixed in this order; none at all if there are keys.
        keys: ShapeKeys, or None: the rest positions of the first layer's skin are deformed.
        vertex_count: V, in place of both, for stages alone.
        stencils: Stencils of V vertices, which make the result from the shape behind the stages, or None.
        Raises ValueError if their numbers of vertices differ, if the first layer has a share, or if another layer has
        none.
        """
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def result_count(self) -> int:
        """R, the number of vertices of the result: V without stencils."""
    def deform(
        self,
        poses: Sequence[tuple[_Float32, _Float64 | None]],
        out: _Float32,
        key_values: _Float32 | None = None,
        rest_positions: _Float32 | None = None,
        stages: Sequence[Stage] = (),
        milliseconds: _Float64 | None = None,
    ) -> None:
        """Deforms one frame.

        poses: (matrices, space) per layer: matrices (J, 4, 4) float32, as in skin_linear, in the space of the armature;
        space (4, 4) float64, from there to the mesh's, None if they are the same.
        out: (R, 3) float32, C-contiguous, space of the mesh: where to write.
        key_values: (K,) float32, the value of each key, 0 for those that are muted; None: 0 for all.
        rest_positions: (V, 3) float32, C-contiguous, in place of those of the skin and of the keys; must not overlap
        out.
        stages: Stage objects, which work on the result in this order.
        milliseconds: (S + 1,) float64, S the number of stages, C-contiguous: receives the time that keys and layers
        took, then that of each stage; with stencils (S + 2,), the last of which is theirs; None: nothing is written.
        If a method cannot include the space in its matrices (dual quaternions: one that shears or scales unevenly), the
        points are transformed one by one. A space without an inverse gets zeros for it, as in Blender. Raises
        ValueError, and writes nothing, if a shape or dtype does not fit.
        """

def forward_kinematics(
    skeleton: Skeleton, local: npt.NDArray[_Float], out: npt.NDArray[_Float] | None = None
) -> npt.NDArray[_Float]:
    """Computes F(j) = F(parent) R(j) T(j) for each joint of each frame.

    local: T(j), (J, 4, 4) or (F, J, 4, 4), float32 or float64, any strides.
    out: where to write F(j), shape and dtype of local, any strides; it may be local itself, but must not overlap it in
    any other way; made if None.
    Returns out. Raises ValueError if a shape or dtype does not fit.
    """

def skinning_matrices(skeleton: Skeleton, world: _Float32 | _Float64, out: _Float32 | None = None) -> _Float32:
    """Computes F(j) A(j)^-1 for each joint of each frame, as the skinning functions expect it.

    world: F(j), (J, 4, 4) or (F, J, 4, 4), float32 or float64, any strides.
    out: (J, 4, 4) or (F, J, 4, 4) as world, float32, where to write, any strides; made if None.
    Returns out. Raises ValueError if a shape or dtype does not fit.
    """

def local_transforms(
    skeleton: Skeleton, world: _Float32 | _Float64, may_move: Sequence[bool] | None = None
) -> tuple[_Float64, _Float64, _Float64, _Float64]:
    """Computes the location, rotation and scale of each joint from which forward_kinematics makes these poses: what is
    keyed.

    world: F(j), (F, J, 4, 4), float32 or float64, any strides.
    may_move: J bools, whether a joint may have a location; all may if None.
    Returns locations (F, J, 3), rotations (F, J, 4), unit quaternions w x y z, each on the short way from the frame
    before, scales (F, J, 3), and F(j) as these play it, (F, J, 4, 4), all float64. A joint that shears relative to its
    parent gets the nearest rotation and scale, and its children are relative to that.
    Raises ValueError if a shape or dtype does not fit, for a number that is not finite, and if a joint that has
    children has a scale of 0 along an axis.
    """

def rotation_transforms(rotations: _Reals, out: _Float64 | None = None) -> _Float64:
    """Computes T(j) of joints that only rotate.

    rotations: (J, 4), unit quaternions w x y z.
    out: where to write, (J, 4, 4) float64, any strides; made if None.
    Returns out. Raises ValueError if a shape or dtype does not fit.
    """

def group_influences(
    offsets: _Integers, groups: _Integers, weights: _Reals, joint_of_group: _Integers, normalize: bool = True
) -> tuple[_Int64, _Int32, _Float32, int, int]:
    """Converts weights of vertex groups to influences, as Blender's Armature modifier does.

    offsets: (V + 1,) integers; vertex v has the entries offsets[v] up to offsets[v + 1].
    groups: (M,) integers, the group of each entry; one that does not exist moves nothing.
    weights: (M,).
    joint_of_group: (G,) integers, the joint of each group, negative if it moves nothing.
    normalize: weights of groups that move something are divided by their sum; False: they stay as they are, for dual
    quaternions, whose sums are divided anyway.
    Zeros are left out, and a vertex whose weights sum to 1e-4 or less stays at rest.
    Returns offsets (V + 1,) int64, joints (N,) int32 and weights (N,) float32, as Skin takes them; how many vertices no
    joint moves; and of how many the weights, as given, are more than 0.05 from a sum of 1.
    Raises ValueError for sizes that do not fit.
    """

def skin_linear(skin: Skin, matrices: _Float32, out: _Float32 | None = None) -> _Float32:
    """Linear blend skinning: v' = sum_j w_j M(j) v.

    matrices: F(j) A(j)^-1, (J, 4, 4) or (F, J, 4, 4), float32, indexed m[j, row, column]; any strides, a transposed
    view is read in place; the last row is taken to be 0 0 0 1.
    out: where to write, (V, 3) or (F, V, 3), float32, C-contiguous, space of the mesh; made if None.
    Returns out. Raises ValueError if a shape or dtype does not fit.
    """

def skin_dual_quaternion(
    skin: Skin,
    matrices: _Float32,
    out: _Float32 | None = None,
    stretch: _Stretch = "polar",
    rest_frames: _Reals | None = None,
) -> _Float32:
    """Dual quaternion skinning (Kavan et al. 2008).

    matrices: F(j) A(j)^-1, (J, 4, 4) or (F, J, 4, 4), float32, indexed m[j, row, column]; any strides, a transposed
    view is read in place; the last row is taken to be 0 0 0 1.
    out: where to write, (V, 3) or (F, V, 3), float32, C-contiguous, space of the mesh; made if None.
    stretch: what happens to scale and shear: "polar", decomposed and blended linearly; "frame", along the axes of the
    joint's rest frame, as Blender 3.4 does; "frame_each", each joint on its own, as Blender 4.0 and later do.
    rest_frames: with "frame" and "frame_each", (J, 4, 4): each joint's rest transform relative to the space of the
    mesh, without scale; None with "polar".
    Returns out. Raises ValueError if a shape or dtype does not fit.
    """

def skin_blended(
    skin: Skin,
    shares: BlendShares,
    matrices: _Float32,
    out: _Float32 | None = None,
    stretch: _Stretch = "polar",
    rest_frames: _Reals | None = None,
) -> _Float32:
    """Linear and dual quaternion skinning, blended: v' = linear + share (dual quaternion - linear).

    shares: a BlendShares of V vertices.
    matrices: F(j) A(j)^-1, (J, 4, 4) or (F, J, 4, 4), float32, indexed m[j, row, column]; any strides, a transposed
    view is read in place; the last row is taken to be 0 0 0 1.
    out: where to write, (V, 3) or (F, V, 3), float32, C-contiguous, space of the mesh; made if None.
    stretch: as in skin_dual_quaternion.
    rest_frames: (J, 4, 4), likewise.
    Returns out. Raises ValueError if a shape or dtype does not fit.
    """

def skin_rotation_centers(
    skin: Skin, centers: RotationCenters, matrices: _Float32, out: _Float32 | None = None
) -> _Float32:
    """Skinning about optimized centers of rotation (Le and Hodgins 2016): v' = R (v - p) + sum_j w_j M(j) p.

    centers: a RotationCenters of V vertices.
    matrices: F(j) A(j)^-1, (J, 4, 4) or (F, J, 4, 4), float32, indexed m[j, row, column]; any strides, a transposed
    view is read in place; the last row is taken to be 0 0 0 1.
    out: where to write, (V, 3) or (F, V, 3), float32, C-contiguous, space of the mesh; made if None.
    Scale and shear are blended linearly and applied to v - p first.
    Returns out. Raises ValueError if a shape or dtype does not fit.
    """

def skin_direct_delta_mush(ddm: DirectDeltaMush, matrices: _Float32, out: _Float32 | None = None) -> _Float32:
    """Direct delta mush: v' = R v + q - R p, where R is the rotation nearest to how the smoothed neighborhood is
    deformed.

    ddm: a DirectDeltaMush of V vertices and J joints.
    matrices: F(j) A(j)^-1, (J, 4, 4) or (F, J, 4, 4), float32, indexed m[j, row, column]; any strides, a transposed
    view is read in place; the last row is taken to be 0 0 0 1.
    out: where to write, (V, 3) or (F, V, 3), float32, C-contiguous, space of the mesh; made if None.
    Returns out. Raises ValueError if a shape or dtype does not fit.
    """

def skin_all(
    jobs: Sequence[
        tuple[Skin, _Float32, _Float32, _Method]
        | tuple[Skin, _Float32, _Float32, _Method, _Stretch, _Reals]
        | tuple[Skin, _Float32, _Float32, _Method, _Stretch, _Reals | None, MethodData | None]
    ],
) -> None:
    """Skins several meshes at once, with all threads working on all of them.

    jobs: tuples (skin, matrices, out, method), optionally followed by stretch and rest_frames (for dual quaternions),
    and then by data. matrices and out are as in skin_linear, but out is not None; method and data are as in Layer.
    The same bits as one call per job. Raises ValueError, and writes nothing, if a shape or dtype does not fit or two
    results overlap.
    """

def read_dmat(path: _Path) -> _Float64:
    """Reads a .dmat file, text or binary, as float64 (rows, columns). Raises ValueError, naming the file, if it cannot
    be read.
    """

def write_dmat(path: _Path, array: _Reals, binary: bool = False) -> None:
    """Writes a file that read_dmat reads back bit for bit.

    array: (rows, columns), real numbers, written as float64.
    binary: as little-endian float64 instead of text.
    Raises ValueError if the file cannot be written.
    """

def read_skeleton(path: _Path, convention: _Convention | None = None) -> RigSkeleton:
    """Reads a .bf or .tgf file as a RigSkeleton.

    convention: "bone" or "joint" overrides the one that a .bf file indicates ("bone" if the weight index of a root is
    -1); a .tgf file is always "bone".
    Raises ValueError, naming file and line, for what cannot be read.
    """

def write_skeleton(path: _Path, skeleton: RigSkeleton) -> None:
    """Writes a .bf or .tgf file, depending on the path's ending. Raises ValueError if the format cannot hold the
    skeleton or the file cannot be written.
    """

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
    """Reads a rig folder: mesh.obj, weights.dmat, skeleton.bf or skeleton.tgf and, if they exist, pose.dmat and
    anim.dmat. Weights below 0 or above 1, which Blender's vertex groups cannot hold, become 0 or 1, and the weights of
    their vertices are divided by their sum; clamped_weights is how many there were. (read_dmat returns the weights as
    they are in the file.)

    skeleton, mesh, weights, pose: other names for the files, relative to the folder. weights="auto": made from the
    bones by automatic_weights, instead of read.
    convention: as in read_skeleton.
    quaternion_order: "wxyz" or "xyzw", of the pose file; Euler angles in it are degrees.
    Raises ValueError, naming the file, for what cannot be read or does not fit the other files.
    """

def write_rig(folder: _Path, rig: Rig, *, skeleton: _Path = "skeleton.bf") -> None:
    """Writes a rig into an existing folder, under the names that read_rig looks for.

    skeleton: the name of its file, ending in .bf or .tgf.
    Raises ValueError if the format cannot hold the skeleton or a file cannot be written.
    """

def read_bvh(path: _Path) -> BvhClip:
    """Reads a .bvh file as a BvhClip. Axes and units are the file's. Raises ValueError, naming file and line, for what
    cannot be read.
    """

def write_bvh(path: _Path, clip: BvhClip) -> None:
    """Writes a .bvh file that read_bvh reads back as the same motion, to rounding, with joints in depth-first order.
    Roots, and joints that have a location, get position channels.

    clip: a BvhClip.
    Raises ValueError for a name that the format cannot hold, and if the file cannot be written.
    """

def colours_apart(
    vertex_count: int, edges: _Integers, face_offsets: _Integers, face_vertices: _Integers, steps: int, most: int = 256
) -> _Int32 | None:
    """Colours vertices so that those of one colour are more than so many steps apart. A step leads to another vertex of
    the same edge or face.

    edges: (E, 2) integers.
    face_offsets: (faces + 1,) integers, where the corners of each face begin.
    face_vertices: (C,) integers, face after face.

    Returns (V,) int32, colours from 0 on; None if more than `most` would be needed. Raises ValueError for what does not
    fit.
    """

def set_thread_count(count: int) -> None:
    """Lets later calls use at most `count` threads, the calling one included, and never more than the machine has; 0
    means as many as it has. Results never depend on it. Raises ValueError for a negative number.
    """

def thread_count() -> int:
    """The number of threads the next call may use, at least 1."""

def instruction_sets() -> list[str]:
    """The names of the instruction sets that this machine can run, best first."""

def instruction_set() -> str:
    """The instruction set in use."""

def set_instruction_set(name: str) -> None:
    """Uses this instruction set from now on, or the best for "auto". Results of two sets agree to rounding, not to the
    bit. Waits until skinning calls in other threads have ended. Raises ValueError for an unknown name.
    """

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
        """(N,) int32: bones of which nothing is inside the mesh, ascending. A copy."""
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
        """(V + 1,) int64, read-only: where the entries of each vertex begin."""
    @property
    def joints(self) -> _Int32:
        """(N,) int32, read-only, ascending at each vertex."""
    @property
    def weights(self) -> _Float32:
        """(N,) float32, read-only, above 0, with sum 1 at each vertex."""
    @property
    def ways(self) -> _UInt8:
        """(V,) uint8, read-only: how each vertex got its weights: 0 surface, 1 volume, 2 nearest, 3 fixed, 4 rigid."""
    @property
    def parts(self) -> _Int32:
        """(V,) int32, read-only: the connected part of each vertex."""
    @property
    def report(self) -> WeightReport:
        """The WeightReport."""

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
    """Computes weights for any mesh and any bones by heat diffusion, for a Skin. Every vertex gets some.

    With positions scaled to size 1 and coincident vertices welded, L the Laplacian of the surface (cotangents, clamped
    to 0..20) and A the area of each vertex: (L + A H) w_j = A H p_j, H_i = stiffness / d_i^2, where d_i is the distance
    to the nearest bone through the solid, longer for bones that are not behind the surface (divided by ((cos + 1.001) /
    2)^1.5), and p_ij is 1 if that bone is j. Near ties are shared. After Baran and Popovic 2007, with distances through
    voxels in place of visibility. A voxel is solid where the surface meets it or the generalized winding number is
    above 1/2 or below -1/2. For parts of fewer than 16 triangles or smaller than four voxels, and for loose vertices,
    the same equation is solved among the voxels.

    positions: (V, 3), finite, in any unit and space.
    face_offsets: (faces + 1,) integers, where the corners of each face begin; empty: there are no faces.
    face_vertices: (C,) integers, the vertices around each face, face after face; a polygon counts as a fan of
    triangles.
    heads, tails: (B, 3), the ends of the bones, in the space of the positions. One bone at least. Lengths may be 0.
    joints: (B,) integers, the joint of each bone; several bones may share one, as segments do. None: bone b is joint b.
    J is one more than the largest.
    method: "heat"; "volume" for heat among voxels at all vertices, which is softer in folds and continuous from part to
    part; "nearest" for the nearest bone through the air.
    resolution: 8 to 256, voxels along the longest side of the mesh; a bulky mesh gets fewer.
    stiffness: 0.001 to 1,000,000, how closely weights follow the nearest bone. Blender's bone heat is about 4.
    max_influences: the largest number for a vertex; 0: any.
    least_weight: 0 to 0.5, smaller weights are left out. Then each vertex's weights are divided by their sum.
    fixed_vertices: (F,) integers, those whose weights are given; the others are solved for around them.
    fixed_weights: (F, J), or a WeightTable, 0 or more with a sum above 0 in each row.
    rigid_parts: (V,) integers: all vertices with the same number, 0 or more, get the same weights; -1: no part.
    rigid_size: 0 to 1: connected parts whose bounding box has a diagonal shorter than this share of the mesh's are
    rigid, too.
    rigid_follow: "attachment": a rigid part gets the weights of the closest point of the rest of the surface; "bone":
    it follows one bone.
    progress: a Progress that another thread watches, or None. If it is cancelled, None is returned. Ctrl C cancels it,
    too.
    Returns AutomaticWeights: the same bits for any number of threads. Raises ValueError for sizes that do not fit,
    vertices that do not exist, numbers that are not finite, no bones, settings out of range.
    """

class Decomposition:
    """Joints, weights and motions that play a deformation, from decompose. Immutable."""

    @property
    def joint_count(self) -> int:
        """J."""
    @property
    def offsets(self) -> _Int64:
        """(V + 1,) int64, read-only: where the entries of each vertex begin."""
    @property
    def joints(self) -> _Int32:
        """(N,) int32, read-only, ascending at each vertex."""
    @property
    def weights(self) -> _Float32:
        """(N,) float32, read-only, above 0, with sum 1 at each vertex; given ones as they were."""
    @property
    def rest(self) -> _Float64:
        """(J, 4, 4), read-only: the joints at rest, unturned, at `heads` or in the middle of what they move."""
    @property
    def poses(self) -> _Float64:
        """(F, J, 4, 4), read-only: skinning matrices. poses[f, j] @ rest[j] is the joint in frame f."""
    @property
    def rms(self) -> float:
        """The root of the mean square distance between what skinning gives and the frames, over all vertices and
        frames, in the unit of the positions.
        """
    @property
    def mean(self) -> float:
        """The mean distance."""
    @property
    def largest(self) -> float:
        """The largest distance."""
    @property
    def vertex_rms(self) -> _Float32:
        """(V,) float32, read-only: of each vertex, over the frames."""
    @property
    def vertex_largest(self) -> _Float32:
        """(V,) float32, read-only: the largest distance of each vertex."""
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
    """Smooth skinning decomposition: finds joints and weights whose linear skinning plays a deformation, such as a
    vertex cache, cloth or Direct Delta Mush.

    Minimizes sum |x_fv - sum_j w_vj M_fj u_v|^2 over rigid motions M and over weights w, which are not negative and sum
    to 1, in turns (Le and Deng 2012). A motion is a weighted Procrustes problem, the weights of a vertex are least
    squares on a simplex. Weights are kept smooth by a term smoothing F size^2 |w - w*|^2, where w* = (I + L)^-1 w, L
    counts neighbors by how little the distance to them changes (Le and Deng 2014), and size is the root mean square
    distance from the centroid. Parts that no face connects are tied where they are nearest; coincident vertices that
    move alike get equal weights.

    rest: (V, 3), the mesh at rest.
    frames: (F, V, 3), the same vertices in each frame, in the same space and unit. One frame at least.
    face_offsets: (faces + 1,) integers, where the corners of each face begin; empty: there are no faces.
    face_vertices: (C,) integers, the vertices around each face, face after face.
    Exactly one of these says what is known:
    bones: at most so many joints are found, up to 2,048, with weights and motions. Fewer if fewer give the frames
    exactly.
    heads: (J, 3), where joints begin: each vertex belongs to the nearest one, then weights and motions are found.
    Together with matrices or weights: only the positions in `rest` of the result.
    matrices: (F, J, 4, 4), skinning matrices of any kind: weights for them are found.
    weights: (V, J), 0 or more, a WeightTable or a Skin: rigid motions for these weights are found.

    max_influences: 1 to 64, the most weights of a vertex. Those go that raise its error least.
    iterations: 1 to 10,000, how many at most.
    smoothing: 0 to 1, see above.
    local: vertices follow only joints that move something near them. False: any joint is tried at every vertex, for
    less error with more influences and time.
    tolerance: 0 to 1, ends when three iterations one after the other lower the error by less than this share.
    progress: a Progress that another thread watches, or None. If it is cancelled, None is returned. Ctrl C cancels it,
    too. rest and frames must not change meanwhile.
    Returns a Decomposition: the same bits for any number of threads. Raises ValueError for sizes that do not fit,
    vertices that do not exist, numbers that are not finite, settings out of range, and if nothing or too much is known.
    """

class WeightTable:
    """The weights above 0 of V vertices in B bones: N in all, where a table has V x B. What the weight tools are given
    as a WeightTable, they return as one. Immutable.
    """

    def __init__(self, offsets: _Integers, bones: _Integers, weights: _Reals, bone_count: int) -> None:
        """offsets: (V + 1,) integers; vertex v has the entries offsets[v] up to offsets[v + 1].
        bones: (N,) integers, in any order at a vertex; weights of a bone that it names twice are added.
        weights: (N,), 0 or more.
        bone_count: B.
        Raises ValueError if the parts do not fit each other, for bones that do not exist, and for weights below 0 or
        not finite.
        """
    @staticmethod
    def from_dense(weights: _Reals) -> WeightTable:
        """weights: (V, B), 0 or more."""
    def dense(self) -> _Float32:
        """Returns (V, B) float32."""
    @property
    def vertex_count(self) -> int:
        """V."""
    @property
    def bone_count(self) -> int:
        """B."""
    @property
    def offsets(self) -> _Int64:
        """(V + 1,) int64, read-only: where the entries of each vertex begin."""
    @property
    def bones(self) -> _Int32:
        """(N,) int32, read-only, ascending at each vertex."""
    @property
    def weights(self) -> _Float32:
        """(N,) float32, read-only, above 0."""

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
    """Smooths the weights of all bones along the edges of faces. The sum of a vertex's weights is smoothed alike, so
    that sums of 1 stay; what is below a millionth of it (with a strength, a hundred-thousandth) is left out.

    weights: a WeightTable, or (V, B), 0 or more, a column for each bone.
    face_offsets: (faces + 1,) integers, where the corners of each face begin.
    face_vertices: (C,) integers, the vertices around each face, face after face.
    strength: 0 to 1,000,000. If above 0, in one solve: (I + t L) w' = w, where t is the strength and L w is w less the
    mean of the neighbors; it reaches about sqrt(t) edges. 0: in steps.
    steps: 0 to 10,000, how many times w is moved towards the mean of the neighbors.
    factor: 0 to 1, how far each step goes.
    mask: (V,), booleans or numbers from 0, which stays, to 1: multiplies the factor. With a strength, vertices below
    0.5 stay. None: all are smoothed.
    locked: (L,) integers, bones whose weights stay. The others' are scaled to the sum that they had.
    positions: (V, 3): vertices that coincide get equal weights. None: they are smoothed apart.
    Returns the weights; those of vertices without faces stay. progress: a Progress, from which another thread can read
    how far it is, and cancel; or None.
    Returns None if progress was cancelled. The same bits for any number of threads. Raises ValueError for sizes that do
    not fit, vertices and bones that do not exist, numbers that are not finite, settings out of range.
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
    """Leaves each vertex at most max_influences weights, chosen by how far it moves in given poses without the others.
    What is kept is fitted anew by least squares, not negative, with the sum of before, unless that makes the largest
    move longer.

    weights: a WeightTable, or (V, B), 0 or more, a column for each bone.
    positions: (V, 3), rest positions.
    matrices: (F, B, 4, 4), skinning matrices: a clip, or test poses. One at least.
    max_influences: 1 to 64.
    rings: 0 to 64: the weights of a bone fade out over so many edges towards vertices that have lost it, against seams.
    Above 0 it needs faces.
    face_offsets: (faces + 1,) integers, or None.
    face_vertices: (C,) integers, or None.
    locked: (L,) integers, bones whose weights stay, and count. A vertex keeps one other at least.
    Returns (weights, largest, mean): the weights, and (V,) float32 each, how far each vertex moves over the poses, in
    the unit of positions; 0 where nothing changed. progress: a Progress, from which another thread can read how far it
    is, and cancel; or None.
    Returns None if progress was cancelled. The same bits for any number of threads. Raises ValueError for sizes that do
    not fit, vertices and bones that do not exist, numbers that are not finite, settings out of range.
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
    """Copies weights from one side to the other. Each vertex gets those of the closest point of the mirrored surface,
    so that both sides may have different vertices.

    weights: a WeightTable, or (V, B), 0 or more, a column for each bone.
    positions: (V, 3), rest positions.
    face_offsets: (faces + 1,) integers, where the corners of each face begin.
    face_vertices: (C,) integers, the vertices around each face, face after face.
    pairs: (B,) integers, the bone on the other side of each; a bone in the middle is its own.
    axis: 0, 1 or 2 for x, y or z.
    origin: where the mirror is on that axis.
    from_positive: copies to the negative side; False: the other way.
    middle: 0 to 1, share of the mesh's longest side: vertices so near the mirror get the mean of their own and their
    mirrored weights.
    mask: (V,), booleans or numbers: vertices below 0.5 stay. None: all may change.
    Returns the weights. progress: a Progress, from which another thread can read how far it is, and cancel; or None.
    Returns None if progress was cancelled. The same bits for any number of threads. Raises ValueError for sizes that do
    not fit, vertices and bones that do not exist, numbers that are not finite, settings out of range, pairs that do not
    agree, no faces on the side that is copied.
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
    """Copies weights from a surface to another one, as from a body to clothes. A vertex is matched if the closest point
    of the source has weights, is near and faces the same way; it gets the weights there. The others get the smoothest
    weights that agree with these (L M^-1 L w = 0, L the Laplacian of cotangents, clamped to 0.01..20, M the areas;
    after Abdrashitov et al. 2023), and where some would be negative, the nearest ones that are not. A part of the
    target without a match follows one point rigidly: the nearest with weights, of another part or of the source. The
    unit does not matter.

    source_positions: (V, 3).
    source_face_offsets: (source_faces + 1,) integers. One face at least.
    source_face_vertices: (D,) integers.
    source_weights: a WeightTable, or (V, B), 0 or more.
    positions: (W, 3), in the same space.
    face_offsets: (faces + 1,) integers.
    face_vertices: (C,) integers. Vertices without faces are parts of their own.
    distance: above 0, share of the diagonal of the target's bounding box.
    angle: 0 to 180 degrees, between the normals.
    flipped: normals may also be opposite, as those of inner layers.
    Returns (weights, matched): W rows with sum 1, and (W,) bool. Vertices that coincide get equal weights. progress: a
    Progress, from which another thread can read how far it is, and cancel; or None.
    Returns None if progress was cancelled. The same bits for any number of threads. Raises ValueError for sizes that do
    not fit, vertices and bones that do not exist, numbers that are not finite, settings out of range, a source without
    faces or weights.
    """

class RigProgram:
    """An armature's bones, constraints, drivers and curves, evaluated as Blender does."""

    def __init__(self, description: dict[str, Any] | _Path, keep_description: bool = True) -> None:
        """Checks a description, or the file of one that `sinew rig` has written, and puts it in order.

        keep_description: whether it can be pickled, for which it keeps a copy of the description.
        Raises ValueError, which names what is wrong or not covered.
        """
    @property
    def names(self) -> list[str]:
        """The bones' B unique names."""
    @property
    def rest(self) -> _Float32:
        """(B, 4, 4) float32, the bones' rest matrices in armature space."""
    @property
    def parents(self) -> _Int32:
        """B, the parent of each bone or -1."""
    @property
    def segment_begin(self) -> _Int32:
        """B + 1, where each B-bone's matrices begin in segments(); other bones have none."""
    @property
    def joint_begin(self) -> _Int32:
        """B + 1, where each bone's joints begin in skinning_matrices(): one, or of a B-bone those of all ends of its
        segments.
        """
    def skeleton(self, bones: Sequence[int]) -> Skeleton:
        """Returns bones as a Skeleton, for local_transforms() of evaluate()'s poses of these bones: at rest as in the
        rig, each below the nearest of its ancestors that is among them.

        bones: the numbers of J bones. Raises ValueError for a number that the rig does not have.
        """
    @property
    def paths(self) -> dict[str, int]:
        """What evaluate() takes, and how many numbers each has: settings of bones and constraints, custom properties,
        and values from outside; see matrix_names too.
        """
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
        """Returns the bones' matrices in armature space, (F, B, 4, 4) float32.

        frames: (F,) times, which may be fractions.
        set: values for paths such as 'pose.bones["Hand"].location', (count,) for all frames or (F, count), and matrices
        from outside by name, (4, 4) or (F, 4, 4); they replace the description's values and curves, and drivers replace
        them. Raises ValueError for an unknown path, for a wrong shape, for a rotation in a mode that its bone or object
        does not have, which would move nothing, and if a driver divides by 0.
        """
    def convert(self, poses: _Float32, bone: int, from_space: str, to_space: str) -> _Float32:
        """Returns the matrices of a bone in another space, (F, 4, 4) float32, with the bits of Object.convert_space.

        poses: (F, B, 4, 4), as evaluate() returns them.
        bone: its number.
        from_space: where the conversion begins: 'POSE' for what drivers read, 'WORLD' for constraints.
        to_space: 'WORLD', 'POSE', 'LOCAL' or 'LOCAL_WITH_PARENT'. Raises ValueError for any other name, and for a bone
        that the rig does not have.
        """
    def skinning_matrices(self, frames: _Reals, set: dict[str, Any] = {}) -> _Float32:
        """Returns the matrices that move vertices from rest to pose, in armature space, (F, J, 4, 4) float32, for skins
        whose joints are numbered as joint_begin says.

        frames: (F,) times.
        set: as in evaluate(), and so are the errors.
        """
    def segments(self, frames: _Reals, set: dict[str, Any] = {}) -> _Float32:
        """Returns the matrices at the ends of the B-bones' segments, relative to their bones, (F, S, 4, 4) float32.

        frames: (F,) times.
        set: as in evaluate(), and so are the errors.
        """
    def values(self, frames: _Reals, paths: list[str], set: dict[str, Any] = {}) -> _Float32:
        """Returns what properties hold, (F, N) float32, all numbers of each path one after the other.

        frames: (F,) times.
        set: as in evaluate(), and so are the errors.
        """
    def profile(self, frames: _Reals, set: dict[str, Any] = {}) -> dict[str, float]:
        """Evaluates frames on one thread and returns the seconds that its parts took, all frames together: 'curves',
        'drivers', 'bones' with their constraints, 'ik' and 'segments' of B-bones.

        frames: (F,) times.
        set: as in evaluate(), and so are the errors.
        """

class RigPlayer:
    """Computes what Blender's evaluation of a frame would leave in the memory of a rig's bones."""

    def __init__(self, program: RigProgram, parts: list[list[str]], fields: list[tuple[str, int, int]]) -> None:
        """parts: paths, of numbers that are returned too, in groups.
        fields: (name, first, count) of what a bone holds, in this order: 'channel_matrix', 'pose_matrix', 'head' and
        'tail'; 'values' are `count` of the bone's numbers from `first` on, in the order of rig_bone_settings(). Raises
        ValueError for a field or a path that the rig does not have.
        """
    @property
    def program(self) -> RigProgram:
        """The RigProgram."""
    def edited(self, set: dict[str, Any], curves: list[dict[str, Any]]) -> RigPlayer:
        """Returns a player of what RigProgram.edited() returns, with its arguments and errors."""
    @staticmethod
    def moments(rigs: list[tuple[RigPlayer, dict[str, Any]]], frame: float) -> list[list[Any] | str]:
        """Returns a frame of several rigs, which are computed at the same time.

        rigs: of each (player, what RigProgram.evaluate() takes as `set`).
        Returns of each a list: its record, (N,) uint8, which is what host.record_pose returns, with the rig's dual
        quaternions; then of each part its numbers. Or a sentence if a driver divides by 0.
        """
    @staticmethod
    def begin(players: list[RigPlayer], frame: float) -> None:
        """Has other threads compute a frame of several rigs, which moments() returns later if nothing is set. Each
        player keeps the last one that was begun.
        """

def rig_bone_settings() -> list[tuple[str, int]]:
    """The numbers of a bone that may change: name and how many. Those of the pose come first; a name that occurs again
    is the rest bone's.
    """

def rig_constraint_settings() -> dict[str, dict[str, tuple[int, str, float, float, float]]]:
    """The settings of each type of constraint, and of each how many numbers it has, their type, default and limits."""

class Task:
    """A function that runs in a thread of the library's own."""

    def __init__(self, work: Callable[[], Any]) -> None:
        """Begins at once, and returns. Python waits for it before it ends.

        work: what is called, without arguments. It must not use Blender's data.
        """
    @property
    def is_done(self) -> bool:
        """Whether the function has returned or raised."""
    def wait(self, seconds: float | None = None) -> bool:
        """Waits until the function has returned or raised.

        seconds: at most so long, or None. Returns whether it has.
        """
    def result(self) -> Any:
        """Waits, and returns what the function has returned, or raises what it has raised."""

class DriverExpression:
    """The expression of a scripted driver, in the part of Python that Blender computes itself. Immutable."""

    def __init__(self, text: str, names: Sequence[str]) -> None:
        """names: of the variables.
        Raises ValueError for what is not one of Blender's simple expressions, with the place.
        """
    @property
    def reads_frame(self) -> bool:
        """Whether it depends on the frame, other than by a variable of that name."""
    def value(self, variables: Sequence[float], frame: float = 0.0) -> float | None:
        """Returns the value. None if something is divided by 0 or has no value, such as the root of -1: Blender then
        switches the driver off.

        variables: a number for each name.
        frame: the time.
        Raises ValueError for another number of variables.
        """
