"""The measured costs of a scene, as numbers and sentences. All times are milliseconds per frame, medians over the
frames."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from statistics import median
from typing import Any

MOST_FRAMES = 40
# How a number was measured.
CLOCK = "Blender's clock"
DIFFERENCE = "difference"  # between frames with it and frames without it
OWN_CLOCK = "Sinew's clock"
LEAST_NOISE = 0.01  # differences between whole frames below this cannot be trusted
# In 19 of 20 cases, the error of the median of N frames' differences is less than this many median deviations /
# sqrt(N): two standard errors of the median of normally distributed numbers. The deviations are those of
# before - after, with the variance of two measurements; a difference has that of one and a half.
NOISE_FACTOR = 3.2
# Modifiers that remember earlier frames are not switched off.
SIMULATIONS = {
    "CLOTH",
    "COLLISION",
    "DYNAMIC_PAINT",
    "EXPLODE",
    "FLUID",
    "OCEAN",
    "PARTICLE_INSTANCE",
    "PARTICLE_SYSTEM",
    "SOFT_BODY",
}

EVERYTHING_ELSE = "Everything else"
AT_THE_SAME_TIME = "Done at the same time"

last: list["Profile"] = []  # the open file's Profile, which the panel shows: it holds names, never references


@dataclass
class Part:
    """One part of an object's evaluation."""

    name: str
    kind: str  # POSE, KEYS, SINEW, or a modifier's type
    ms: float | None  # None: `how` says why it was not measured
    how: str
    noise_ms: float = 0.0  # of a difference: anything smaller cannot be measured and counts as 0


@dataclass
class ObjectCost:
    name: tuple  # the object's name, and the path of its library or None
    type: str
    parts: list = field(default_factory=list)
    is_bound: bool = False
    saves: Part | None = None  # the time that Accelerate saves per frame; None: it was not tried
    reason: str = ""  # why Accelerate does nothing for it
    remarks: list = field(default_factory=list)  # sentences

    @property
    def ms(self) -> float:
        return sum(part.ms for part in self.parts if part.ms is not None)


@dataclass
class Profile:
    frames: list
    frame_ms: float  # the whole call that sets the frame
    noise_ms: float  # how much two measurements of the same thing differ
    objects: list  # most expensive first
    shared: list = field(default_factory=list)  # of Part: what is measured for all objects together

    @property
    def rest_ms(self) -> float:
        """The frame's time minus everything that was measured. Negative if the parts add up to more than the frame,
        since Blender does several things at the same time."""
        return self.frame_ms - sum(cost.ms for cost in self.objects) - sum(part.ms for part in self.shared)

    @property
    def rest(self) -> tuple[str, float]:
        """(name, milliseconds) of the last row, which makes all rows add up to the frame."""
        return (EVERYTHING_ELSE if self.rest_ms >= 0 else AT_THE_SAME_TIME), self.rest_ms

    def document(self) -> dict[str, Any]:
        """Returns the profile as a JSON document."""
        objects = [
            {**asdict(cost), "name": cost.name[0], "library": cost.name[1], "ms": cost.ms} for cost in self.objects
        ]
        return {
            "frames": self.frames,
            "frame_ms": self.frame_ms,
            "noise_ms": self.noise_ms,
            "objects": objects,
            "shared": [asdict(part) for part in self.shared],
            "everything_else_ms": max(self.rest_ms, 0.0),
            "at_the_same_time_ms": max(-self.rest_ms, 0.0),
        }


def parse_frames(words: str) -> tuple[int, int]:
    """Parses "A-B" as (A, B); a frame may be negative. Raises ValueError."""
    found = re.fullmatch(r"(-?\d+)-(-?\d+)", words)
    if not found:
        raise ValueError(f"{words} is not a range of frames; write it like 1-40")
    return check_frames(int(found[1]), int(found[2]))


def check_frames(first: int, last: int) -> tuple[int, int]:
    """Returns both frames. Raises ValueError if they are in the wrong order."""
    if last < first:
        raise ValueError(f"the last frame ({last}) comes before the first ({first}): swap them")
    return first, last


def frames_of(scene: Any) -> tuple[int, int]:
    """Returns the first and the last frame that playback shows."""
    if scene.use_preview_range:
        return scene.frame_preview_start, scene.frame_preview_end
    return scene.frame_start, scene.frame_end


def spread(first: int, last: int, most: int = MOST_FRAMES) -> list[int]:
    """Returns the frames from first to last, both included; if there are more than `most`, that many, evenly spread."""
    count = last - first + 1
    if count <= most:
        return list(range(first, last + 1))
    return [first + round(i * (count - 1) / (most - 1)) for i in range(most)]


def blocks(frames: list[int], size: int) -> list[list[int]]:
    return [frames[start : start + size] for start in range(0, len(frames), size)]


def set_difference(
    parts: Sequence[Part], before: Sequence[float], without: Sequence[float], after: Sequence[float]
) -> None:
    """Sets how much less time a frame takes without something whose cost these parts share evenly. The lists hold times
    of the same frames; `before` and `after` are both with it, since a machine's speed drifts."""
    noise_ms = noise(before, after)
    difference = median((a + b) / 2 - c for a, c, b in zip(before, without, after))
    for part in parts:
        part.noise_ms = noise_ms
        part.ms = difference / len(parts) if difference > noise_ms else 0.0


def noise(before: Sequence[float], after: Sequence[float]) -> float:
    """Returns the possible error of a difference: half the drift between the two lists, or the scatter."""
    drifts = [a - b for a, b in zip(before, after)]
    drift = median(drifts)
    scatter = median(abs(each - drift) for each in drifts)
    return max(abs(drift) / 2, NOISE_FACTOR * scatter / len(drifts) ** 0.5, LEAST_NOISE)


def order(objects: Iterable[ObjectCost]) -> list[ObjectCost]:
    """Returns the objects that cost something, the most expensive first."""
    return sorted((cost for cost in objects if cost.parts), key=lambda cost: -cost.ms)


def part_text(part: Part) -> str:
    if part.ms is None:
        return part.how
    return f"{part.ms:.2f} ms" if part.ms or not part.noise_ms else f"below {part.noise_ms:.2f} ms"


def verdict(cost: ObjectCost) -> str:
    """Returns what Accelerate does or would do for an object, in a few words or a sentence; "" if it does not apply."""
    if cost.is_bound:
        return cost.reason or "accelerated"
    if cost.saves is not None:
        return f"saves {part_text(cost.saves)}"
    return cost.reason


def after_deforming(modifiers: Sequence[tuple[str, str]], deforming: set[str]) -> set[str]:
    """Returns the names of modifiers that follow the deforming ones and can be switched off for a while. modifiers:
    (name, type) of those that are shown, in order; deforming: the types that Sinew may take over."""
    kinds = [kind in deforming for _, kind in modifiers]
    tail = modifiers[kinds.index(False) :] if False in kinds else []
    return {name for name, kind in tail if kind not in SIMULATIONS}


def about_subdivision(modifiers: Sequence[tuple[str, str]]) -> list[str]:
    """Returns sentences about subdivision, if the preferences allow it on the graphics card. modifiers: (name, type)
    of those that are shown, in order."""
    types = [kind for _, kind in modifiers]
    if "SUBSURF" not in types:
        return []
    place = len(types) - 1 - types[::-1].index("SUBSURF")
    name, later = modifiers[place][0], modifiers[place + 1 :]
    if later:
        return [
            f"{later[0][0]} comes after {name}, so the processor has to subdivide: move it before {name} or switch "
            "it off in the viewport, and the graphics card can do that"
        ]
    return [f"{name} runs on the graphics card or while drawing, and that time is not in these numbers"]


def heading(profile: Profile) -> str:
    frames = profile.frames
    which = f"frame {frames[0]}" if len(frames) == 1 else f"{len(frames)} frames from {frames[0]} to {frames[-1]}"
    return f"{which}: {profile.frame_ms:.2f} ms per frame, give or take {profile.noise_ms:.2f} ms"


def rows(profile: Profile) -> list[tuple[str, str, str]]:
    """Returns (name, time, verdict on Accelerate) for each object, each followed by its parts, and then for what
    belongs to no object. The rows of the objects and the last ones add up to the frame."""
    found = []
    for cost in profile.objects:
        found.append((cost.name[0], f"{cost.ms:.2f} ms", verdict(cost)))
        found += [(f"  {part.name}", part_text(part), "") for part in cost.parts]
    return found + [(name, text, "") for name, text in last_rows(profile)]


def last_rows(profile: Profile) -> list[tuple[str, str]]:
    """Returns (name, time) of what belongs to no object."""
    name, ms = profile.rest
    return [*((part.name, part_text(part)) for part in profile.shared), (name, f"{ms:.2f} ms")]


def about_rest(profile: Profile) -> str:
    """Returns a sentence about the last row, or ""."""
    if profile.rest_ms >= 0:
        return ""
    return (
        f"What was measured adds up to {-profile.rest_ms:.2f} ms more than the frame: Blender evaluates several things "
        "at the same time"
    )


def remarks(profile: Profile) -> list[str]:
    found = [f"{cost.name[0]}: {remark}" for cost in profile.objects for remark in cost.remarks]
    return found + [sentence for sentence in [about_rest(profile)] if sentence]
