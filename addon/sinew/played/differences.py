"""What Blender has evaluated where something else was computed: the panel names it, the log has it, and *Report* writes
all that is needed to find out why."""

import logging
import platform
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain
from types import MappingProxyType
from typing import Any

import bpy
import numpy as np

from ..description import driven_keys, equality, reading
from . import leading, rigs

log = logging.getLogger("sinew")
# Elsewhere compilers and mathematical functions are others than those with which Blender evaluates bones.
IS_EXACT = sys.platform == "linux" and platform.machine() == "x86_64"
TOLERANCE = 1e-6  # where it is not exact, of the size of the armature


@dataclass
class Difference:
    """A frame on which Blender's bones are others than those that were computed."""

    frame: float
    blender: np.ndarray  # (B, 4, 4) float32, the poses of all bones
    computed: np.ndarray
    given: Mapping[str, Any]  # values that were others than on that frame, by path

    @classmethod
    def between(
        cls, rig: rigs.Rig, copy: bpy.types.Object, frame: float, given: Mapping[str, Any] = MappingProxyType({})
    ) -> "Difference":
        """copy: evaluated on that frame; given: as above. What is not given of what it follows, is what that has on the
        frame."""
        if not all(name in given for leader in rig.source.leaders for name in (*leader.bones, *leader.numbers)):
            given = leading.inputs(rig, [frame]) | dict(given)
        computed = rig.source.program.evaluate(np.array([frame], np.float32), dict(given))[0]
        return cls(frame, equality.matrices_of(copy.pose.bones), computed, given)

    def is_any(self) -> bool:
        """Whether the matrices of any bone differ by more than they may."""
        size = 0.0 if IS_EXACT else max(1.0, float(np.nan_to_num(np.abs(self.blender)).max(initial=0)))
        return bool((equality.distances(self.computed, self.blender) > TOLERANCE * size).any())

    def sentence(self, ob: bpy.types.Object) -> str:
        far = equality.distances(self.computed, self.blender)
        bone = int((far > 0).argmax())  # the first, which others follow
        if not far[bone]:
            return f"on frame {self.frame:g}, channels or B-bones of {ob.name} are not those that were computed"
        row, column = divmod(int(np.abs(self.computed[bone] - self.blender[bone]).argmax()), 4)
        numbers = f"{self.computed[bone, row, column]:.9g} instead of {self.blender[bone, row, column]:.9g}"
        name = ob.pose.bones[bone].name
        return f'on frame {self.frame:g}, the bone "{name}" of {ob.name} would have {numbers} in its matrix'


def is_near(rig: rigs.Rig, copy: bpy.types.Object, time: float) -> bool:
    """Whether what is computed of an armature counts as what Blender has evaluated though it is not exactly that. copy:
    evaluated at that time."""
    return not IS_EXACT and rig.source.program is not None and not Difference.between(rig, copy, time).is_any()


def note(rig: rigs.Rig, difference: Difference) -> str:
    """Keeps a difference of an armature, which is read as a whole the next time, and logs it. Returns the sentence for
    the panel."""
    sentence = difference.sentence(rig.ob)
    if rig.trust.difference is None or rig.trust.difference.sentence(rig.ob) != sentence:
        log.warning("what was computed is not what Blender has: %s", sentence)
    rig.trust.difference, rig.motion.last = difference, None
    return sentence


def report(rig: rigs.Rig, graph: Any) -> dict[str, Any]:
    """Returns all that is needed to find out why an armature differs, for JSON: its description, and both poses."""
    keyed, found = rigs.keyed(rig, graph), rig.trust.difference
    return {
        "description": reading.read(rig.ob, graph, keyed, may_move=True).description,
        "driven keys": list(chain(*driven_keys.paths_of(keyed))),
        "frame": found.frame,
        "given": {path: np.asarray(value).tolist() for path, value in found.given.items()},
        "blender": found.blender.tolist(),
        "computed": found.computed.tolist(),
    }
