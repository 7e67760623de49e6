"""USD files: a mesh with points on each frame, or with a skeleton (UsdSkel). Uses the module pxr, but not Blender.

Letters: F frames, V vertices, J joints. Matrices act on column vectors here and are transposed for USD.
"""

import errno
import os
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

import numpy as np

from . import leftovers
from .frame_range import FrameRange


def load(expose: Callable[[], Any] | None = None, advice: str = "") -> None:
    """Makes sure that pxr can be imported. expose(): lets Python find Blender's own copy. Raises ValueError."""
    for attempt in (None, expose):
        if attempt is not None:
            attempt()
        with suppress(ImportError):
            from pxr import Usd, UsdGeom, UsdSkel  # noqa: F401

            return
    raise ValueError(f"USD needs the Python package usd-core, which this Blender does not have{advice}")


def row_matrices(matrices: np.ndarray) -> Any:
    """Converts (N, 4, 4) to a Vt.Matrix4dArray."""
    from pxr import Vt

    return Vt.Matrix4dArray.FromNumpy(np.ascontiguousarray(np.swapaxes(matrices, -1, -2), np.float64))


def row_matrix(matrix: np.ndarray) -> Any:
    from pxr import Gf

    return Gf.Matrix4d(*np.asarray(matrix, np.float64).T.reshape(-1).tolist())


class UsdFile:
    """One object's file, a context manager: it appears under its name when `save` is called, and not at all if
    something fails before that. Raises OSError if it cannot be written."""

    def __init__(self, path: str, name: str, frames: FrameRange, rate: float, meters: float) -> None:
        """name: of the object; rate: frames per second; meters: length of a unit."""
        from pxr import Tf, Usd, UsdGeom

        self.path = path
        leftovers.remove_dead(f"{path}.part", ".usdc")
        self._temporary = leftovers.own_name(f"{path}.part", ".usdc")
        with self._naming():
            self.stage = Usd.Stage.CreateNew(self._temporary)
        self.root = f"/{Tf.MakeValidIdentifier(name)}"
        self.stage.SetStartTimeCode(frames.first)
        self.stage.SetEndTimeCode(list(frames)[-1])
        self.stage.SetTimeCodesPerSecond(rate)
        self.stage.SetFramesPerSecond(rate)
        UsdGeom.SetStageUpAxis(self.stage, UsdGeom.Tokens.z)
        UsdGeom.SetStageMetersPerUnit(self.stage, meters)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stage = None
        with suppress(FileNotFoundError):
            os.remove(self._temporary)

    def save(self) -> None:
        with self._naming():
            self.stage.GetRootLayer().Save()
        self.stage = None
        with open(self._temporary, "r+b") as file:
            os.fsync(file.fileno())
        os.replace(self._temporary, self.path)

    def _naming(self):
        return _Naming(self.path)

    def _define_mesh(self, path, topology, scheme):
        """topology: face_offsets (faces + 1,), face_vertices."""
        from pxr import UsdGeom, Vt

        offsets, vertices = topology
        mesh = UsdGeom.Mesh.Define(self.stage, path)
        mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.diff(offsets).astype(np.int32)))
        mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(np.asarray(vertices, np.int32)))
        mesh.CreateSubdivisionSchemeAttr(scheme)
        return mesh


def _extent(positions):
    from pxr import Vt

    ends = np.array([positions.min(axis=0), positions.max(axis=0)]) if len(positions) else np.zeros((2, 3))
    return Vt.Vec3fArray.FromNumpy(ends.astype(np.float32))


class PointsFile(UsdFile):
    """A mesh whose points are written for each frame."""

    def begin(self, topology: tuple[np.ndarray, np.ndarray], scheme: str) -> None:
        mesh = self._define_mesh(self.root, topology, scheme)
        self.stage.SetDefaultPrim(mesh.GetPrim())
        self._points, self._extent = mesh.CreatePointsAttr(), mesh.CreateExtentAttr()
        self._world = mesh.AddTransformOp()

    def write(self, frame: int, positions: np.ndarray, world: np.ndarray) -> None:
        """positions (V, 3) float32, world (4, 4)."""
        from pxr import Vt

        self._points.Set(Vt.Vec3fArray.FromNumpy(positions), frame)
        self._extent.Set(_extent(positions), frame)
        self._world.Set(row_matrix(world), frame)


class SkeletonFile(UsdFile):
    """A mesh that a skeleton moves, with the joints' motions for each frame."""

    def begin(
        self,
        topology: tuple[np.ndarray, np.ndarray],
        scheme: str,
        rest: np.ndarray,
        influences: tuple[np.ndarray, np.ndarray],
        skeleton: Any,
    ) -> None:
        """rest (V, 3); influences: joints (V, K), weights (V, K), which sum to 1; skeleton: names, parents (J,), -1 for
        a root, bind (J, 4, 4) rigid, parents first."""
        from pxr import Gf, Sdf, UsdGeom, UsdSkel, Vt

        root = UsdSkel.Root.Define(self.stage, self.root)
        self.stage.SetDefaultPrim(root.GetPrim())
        self._world = root.AddTransformOp()
        mesh = self._define_mesh(f"{self.root}/mesh", topology, scheme)
        mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(rest))
        mesh.CreateExtentAttr(_extent(rest))
        joints, weights = influences
        binding = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
        binding.CreateGeomBindTransformAttr(Gf.Matrix4d(1))
        width = joints.shape[1]
        indices = binding.CreateJointIndicesPrimvar(False, width)
        indices.Set(Vt.IntArray.FromNumpy(np.ascontiguousarray(joints, np.int32).reshape(-1)))
        shares = binding.CreateJointWeightsPrimvar(False, width)
        shares.Set(Vt.FloatArray.FromNumpy(np.ascontiguousarray(weights, np.float32).reshape(-1)))

        tokens = Vt.TokenArray(joint_paths(skeleton.names, skeleton.parents))
        bones = UsdSkel.Skeleton.Define(self.stage, f"{self.root}/skeleton")
        bones.CreateJointsAttr(tokens)
        bones.CreateJointNamesAttr(Vt.TokenArray(list(skeleton.names)))
        bones.CreateBindTransformsAttr(row_matrices(skeleton.bind))
        bones.CreateRestTransformsAttr(row_matrices(local_to(skeleton.parents, skeleton.bind)))
        bones.GetPrim().CreateAttribute("purpose", Sdf.ValueTypeNames.Token).Set(UsdGeom.Tokens.guide)
        binding.CreateSkeletonRel().SetTargets([bones.GetPath()])
        animation = UsdSkel.Animation.Define(self.stage, f"{self.root}/skeleton/animation")
        animation.CreateJointsAttr(tokens)
        self._tracks = (
            animation.CreateTranslationsAttr(),
            animation.CreateRotationsAttr(),
            animation.CreateScalesAttr(),
        )
        UsdSkel.BindingAPI.Apply(bones.GetPrim()).CreateAnimationSourceRel().SetTargets([animation.GetPath()])
        self._skeleton = skeleton

    def write(self, frame: int, posed: np.ndarray, world: np.ndarray) -> np.ndarray:
        """Writes posed (J, 4, 4), the joints in the space of the mesh, and world (4, 4). Returns (J, 4, 4): the joints
        as a reader gets them, since scales are stored with eleven bits and shear is not stored at all."""
        from pxr import UsdSkel

        parts = UsdSkel.DecomposeTransforms(row_matrices(local_to(self._skeleton.parents, posed)))
        for track, values in zip(self._tracks, parts):
            track.Set(values, frame)
        self._world.Set(row_matrix(world), frame)
        local = np.swapaxes(np.array(UsdSkel.MakeTransforms(*parts), np.float64), -1, -2)
        kept = np.empty_like(local)
        for joint, parent in enumerate(self._skeleton.parents):
            kept[joint] = local[joint] if parent < 0 else kept[parent] @ local[joint]
        return kept


def local_to(parents: np.ndarray, matrices: np.ndarray) -> np.ndarray:
    """Returns (J, 4, 4): each joint relative to its parent."""
    return np.array(
        [
            matrix if parent < 0 else np.linalg.solve(matrices[parent], matrix)
            for parent, matrix in zip(parents, matrices)
        ]
    )


def joint_paths(names: Iterable[str], parents: np.ndarray) -> list[str]:
    """Returns a path such as "hips/spine/neck" for each joint. Names are made valid and unique."""
    from pxr import Tf

    paths: list[str] = []
    for name, parent in zip(names, parents):
        start = f"{paths[parent]}/" if parent >= 0 else ""
        path = unique = start + Tf.MakeValidIdentifier(name)
        number = 0
        while unique in paths:
            number += 1
            unique = f"{path}_{number}"
        paths.append(unique)
    return paths


class _Naming:
    """Turns errors of pxr into an OSError with the file's name."""

    def __init__(self, path):
        self._path = path

    def __enter__(self):
        pass

    def __exit__(self, _kind, error, _trace):
        from pxr import Tf

        if isinstance(error, Tf.ErrorException):
            said = str(error.args[0].commentary).strip() if error.args else "it cannot be written"
            raise OSError(errno.EIO, said, self._path) from error
