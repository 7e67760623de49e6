"""The skinning methods that Blender's Armature modifier does not have: a mesh's settings for them, and a method's own
data for each vertex. Data that takes long to compute is computed by install/precomputing.py and saved in the .blend;
here it is read."""

import hashlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..blender import kept_arrays
from ..native import sinew_native

BLENDED, CENTERS, MUSH = "BLENDED", "ROTATION_CENTERS", "DIRECT_DELTA_MUSH"
PRECOMPUTED = {CENTERS, MUSH}
LIKE_DUAL_QUATERNION = {"DUAL_QUATERNION", BLENDED, CENTERS}  # closer to it than to linear skinning, in general
OWN = {BLENDED, *PRECOMPUTED}

# Why a method's saved data cannot be used.
ABSENT, STALE, UNFIT = "ABSENT", "STALE", "UNFIT"


@dataclass(frozen=True)
class Method:
    """A mesh's settings. kind "": the method of its Armature modifier."""

    kind: str = ""
    share: tuple = ()  # of BLENDED: name of a vertex group, whether it is inverted, the share without a group
    settings: tuple = ()  # of a precomputed method, (name, value) pairs
    made_of: str = ""  # of the arrays in the file, as returned by made_of
    faces: str = ""  # a digest of the faces

    @classmethod
    def of(cls, settings: Any, faces: Callable[[], str]) -> "Method":
        """Reads the settings. settings: `object.sinew` of the original; faces: function that returns a digest of its
        mesh's faces."""
        kind, skinning = settings.own_method, settings.skinning
        if kind == BLENDED:
            return cls(kind, (skinning.share_group, skinning.share_invert, skinning.share))
        if kind in PRECOMPUTED:
            made_of = kept_arrays.made_of(skinning.data)
            return cls(kind, (), settings_of(kind, skinning), made_of, faces())
        return cls()


def settings_of(kind: str, skinning: Any) -> tuple[tuple[str, Any], ...]:
    """Returns the settings of a precomputed method as (name, value) pairs, with the names of sinew_native."""
    if kind == CENTERS:
        return (("sigma", skinning.sigma),)
    return (
        ("smoothing", skinning.smoothing),
        ("weight_smoothing", skinning.weight_smoothing),
        ("blend", skinning.blend),
        ("iterations", skinning.iterations),
        ("laplacian", skinning.laplacian.lower()),
        ("variant", int(skinning.variant)),
    )


def is_like_dual_quaternion(name: str, skinning: Any) -> bool:
    """Whether a method with those settings is closer to dual quaternion than to linear skinning."""
    if name == BLENDED and not skinning.share_group:
        return skinning.share >= 0.5
    return name in LIKE_DUAL_QUATERNION


def made_of(method: Method, rest: np.ndarray, influences: Any, joint_count: int, bone_names: Sequence[str]) -> str:
    """Returns a string that changes whenever the result of a precomputation would change. Its second half, after the
    colon, changes only when old data would no longer fit the mesh and its bones. rest (V, 3); influences: the
    Influences of the mesh."""
    content = digest(
        repr((method.kind, method.settings, method.faces)).encode(),
        np.ascontiguousarray(rest, np.float32),
        influences.offsets,
        influences.joints,
        np.asarray(influences.weights, np.float32),
    )
    return f"{content}:{digest(repr((method.kind, len(rest), joint_count, bone_names)).encode())}"


def digest(*parts: bytes | np.ndarray) -> str:
    """Returns a hash of arrays and bytes, as hexadecimal digits."""
    found = hashlib.blake2b(digest_size=16)
    for part in parts:
        found.update(part if isinstance(part, bytes) else np.ascontiguousarray(part).tobytes())
    return found.hexdigest()


def shares(method: Method, weights: Any, count: int) -> Any:
    """Returns the sinew_native.BlendShares of a mesh with count vertices. weights: layers.Weights."""
    group, invert, share = method.share
    found = weights.of_group(group) if group else None
    if found is None:
        return sinew_native.BlendShares(np.full(count, share, np.float32))
    found = np.clip(found, 0, 1).astype(np.float32)
    return sinew_native.BlendShares(1 - found if invert else found)


def compute(
    kind: str, settings: Iterable[tuple[str, Any]], skin: Any, faces: Sequence[np.ndarray], progress: Any
) -> dict[str, np.ndarray] | None:
    """Computes a method's data and returns {name: array}, or None if progress was cancelled. From any thread.
    settings: as returned by settings_of; skin: sinew_native.Skin; faces: as sinew_native takes them; progress:
    sinew_native.Progress."""
    kinds = {CENTERS: sinew_native.RotationCenters, MUSH: sinew_native.DirectDeltaMush}
    found = kinds[kind].compute(skin, *faces, **dict(settings), progress=progress)
    if found is None:
        return None
    if kind == CENTERS:
        return {"centers": found.centers, "has_center": found.has_center}
    return {name: np.asarray(value) for name, value in found.arrays().items()}


class Kept:
    """The data that a mesh's method has saved in the file, as a native object. It is made again only when the data in
    the file has changed, not when weights are painted."""

    def __init__(self) -> None:
        self._made_of, self._data = "", None

    def read(self, kind: str, text: Any, wanted: str, skin: Any) -> tuple[Any, str]:
        """Returns (data or None, ABSENT, STALE, UNFIT or ""). text: the text data-block with the arrays; wanted:
        made_of for what would be computed now; skin: sinew_native.Skin."""
        has = kept_arrays.made_of(text)
        if not has:
            return None, ABSENT
        if has.partition(":")[2] != wanted.partition(":")[2]:
            return None, UNFIT
        if has != self._made_of:
            self._data = _native(kind, kept_arrays.read(text), skin)
            self._made_of = has
        return self._data, "" if has == wanted else STALE


def _native(kind: str, arrays: dict[str, np.ndarray], skin: Any) -> Any:
    if kind == CENTERS:
        return sinew_native.RotationCenters(arrays["centers"], arrays["has_center"])
    scalars = {name: arrays.pop(name).item() for name in ("variant", "pruned")}
    return sinew_native.DirectDeltaMush.from_arrays(skin, **scalars, **arrays)
