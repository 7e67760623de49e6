"""The skinning methods that Blender's Armature modifier does not have: what a mesh's settings say of them, and the data
of its own that a method has for each vertex. What takes long to compute is computed by precomputing.py and kept in the
.blend; here it is read."""

import hashlib
from dataclasses import dataclass

import numpy as np

from ..blender import kept_arrays
from ..native import sinew_native

BLENDED, CENTERS, MUSH = "BLENDED", "ROTATION_CENTERS", "DIRECT_DELTA_MUSH"
PRECOMPUTED = {CENTERS, MUSH}
LIKE_DUAL_QUATERNION = {"DUAL_QUATERNION", BLENDED, CENTERS}  # more than like linear skinning, as far as one can tell
OWN = {BLENDED, *PRECOMPUTED}

# What is the matter with the data that a method has kept in the file.
ABSENT, STALE, UNFIT = "ABSENT", "STALE", "UNFIT"


@dataclass(frozen=True)
class Method:
    """What a mesh's settings say. kind "": the method of its Armature modifier."""

    kind: str = ""
    share: tuple = ()  # of BLENDED: name of a vertex group, whether it is inverted, the share where there is no group
    settings: tuple = ()  # of what is precomputed, (name, value) in pairs
    made_of: str = ""  # of the arrays in the file, as made_of gives it
    faces: str = ""  # a digest

    @classmethod
    def of(cls, settings, faces):
        """settings: `object.sinew` of the original; faces: function that gives a digest of its mesh's faces."""
        kind, skinning = settings.own_method, settings.skinning
        if kind == BLENDED:
            return cls(kind, (skinning.share_group, skinning.share_invert, skinning.share))
        if kind in PRECOMPUTED:
            made_of = kept_arrays.made_of(skinning.data)
            return cls(kind, (), settings_of(kind, skinning), made_of, faces())
        return cls()


def settings_of(kind, skinning):
    """((name, value), ...), as sinew_native names them."""
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


def is_like_dual_quaternion(name, skinning):
    """Whether that method with those settings comes nearer to dual quaternion than to linear skinning."""
    if name == BLENDED and not skinning.share_group:
        return skinning.share >= 0.5
    return name in LIKE_DUAL_QUATERNION


def made_of(method, rest, influences, joint_count, bone_names):
    """A string that is another one whenever a precomputation would come out otherwise. Its second half tells on whom
    old data would fit at least."""
    content = digest(
        repr((method.kind, method.settings, method.faces)).encode(),
        np.ascontiguousarray(rest, np.float32),
        influences.offsets,
        influences.joints,
        np.asarray(influences.weights, np.float32),
    )
    return f"{content}:{digest(repr((method.kind, len(rest), joint_count, bone_names)).encode())}"


def digest(*parts):
    found = hashlib.blake2b(digest_size=16)
    for part in parts:
        found.update(part if isinstance(part, bytes) else np.ascontiguousarray(part).tobytes())
    return found.hexdigest()


def shares(method, weights, count):
    """BlendShares of a mesh with count vertices. weights: layers.Weights."""
    group, invert, share = method.share
    found = weights.of_group(group) if group else None
    if found is None:
        return sinew_native.BlendShares(np.full(count, share, np.float32))
    found = np.clip(found, 0, 1).astype(np.float32)
    return sinew_native.BlendShares(1 - found if invert else found)


def compute(kind, settings, skin, faces, progress):
    """{name: array}, from any thread; None if progress was cancelled."""
    kinds = {CENTERS: sinew_native.RotationCenters, MUSH: sinew_native.DirectDeltaMush}
    found = kinds[kind].compute(skin, *faces, **dict(settings), progress=progress)
    if found is None:
        return None
    if kind == CENTERS:
        return {"centers": found.centers, "has_center": found.has_center}
    return {name: np.asarray(value) for name, value in found.arrays().items()}


class Kept:
    """What a mesh's method has kept in the file, as native data: made when the file has something else, and not when
    somebody paints weights."""

    def __init__(self):
        self._made_of, self._data = "", None

    def read(self, kind, text, wanted, skin):
        """(data or None, what is the matter or ""). text: with the arrays; wanted: made_of of what would be computed
        now; skin: sinew_native.Skin."""
        has = kept_arrays.made_of(text)
        if not has:
            return None, ABSENT
        if has.partition(":")[2] != wanted.partition(":")[2]:
            return None, UNFIT
        if has != self._made_of:
            self._data = _native(kind, kept_arrays.read(text), skin)
            self._made_of = has
        return self._data, "" if has == wanted else STALE


def _native(kind, arrays, skin):
    if kind == CENTERS:
        return sinew_native.RotationCenters(arrays["centers"], arrays["has_center"])
    scalars = {name: arrays.pop(name).item() for name in ("variant", "pruned")}
    return sinew_native.DirectDeltaMush.from_arrays(skin, **scalars, **arrays)
