"""What was measured of a scene, as numbers and sentences. Milliseconds a frame throughout, medians over the frames."""

import re
from dataclasses import asdict, dataclass, field
from statistics import median

MOST_FRAMES = 40
# How a number came about.
CLOCK = "Blender's clock"
DIFFERENCE = "difference"  # of frames with and without
OWN_CLOCK = "Sinew's clock"
LEAST_NOISE = 0.01  # below that no clock of a whole frame can be trusted
# The median of differences of N frames is off by less than so many median deviations / sqrt(N), 19 times of 20: two
# standard errors of a median of normal numbers, of which each difference has one and a half.
NOISE_FACTOR = 3.2
# What has a memory of the frames before is left alone.
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

last = []  # the Profile that the panel shows, of the open file: names, never references


@dataclass
class Part:
    """One thing that an object's evaluation does."""

    name: str
    kind: str  # POSE, KEYS, SINEW, or a modifier's type
    ms: float | None  # None: `how` says why it was not measured
    how: str
    noise_ms: float = 0.0  # of a difference: less than that is lost, and is 0


@dataclass
class ObjectCost:
    name: tuple  # of the object, and the path of its library or None
    type: str
    parts: list = field(default_factory=list)
    is_bound: bool = False
    saves: Part | None = None  # what Accelerate takes off a frame; None: it was not tried
    reason: str = ""  # why Accelerate does nothing for it
    remarks: list = field(default_factory=list)  # sentences

    @property
    def ms(self):
        return sum(part.ms for part in self.parts if part.ms is not None)


@dataclass
class Profile:
    frames: list
    frame_ms: float  # the whole call that sets the frame
    noise_ms: float  # what two measurements of the same differ by
    objects: list  # dearest first
    shared: list = field(default_factory=list)  # of Part: what is measured of all objects together

    @property
    def rest_ms(self):
        """What the frame takes beside all that was measured. Negative: that adds up to more than the frame, since
        Blender does several things at the same time."""
        return self.frame_ms - sum(cost.ms for cost in self.objects) - sum(part.ms for part in self.shared)

    @property
    def rest(self):
        """(name, milliseconds) of the last row, with which all rows add up to the frame."""
        return (EVERYTHING_ELSE if self.rest_ms >= 0 else AT_THE_SAME_TIME), self.rest_ms

    def document(self):
        """As JSON has it."""
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


def parse_frames(words):
    """ "A-B" as (A, B); a frame may be negative. Raises ValueError."""
    found = re.fullmatch(r"(-?\d+)-(-?\d+)", words)
    if not found:
        raise ValueError(f"{words} is not a range of frames; write it like 1-40")
    return check_frames(int(found[1]), int(found[2]))


def check_frames(first, last):
    """Returns both. Raises ValueError."""
    if last < first:
        raise ValueError(f"the last frame ({last}) comes before the first ({first}): swap them")
    return first, last


def frames_of(scene):
    """The first and the last that playing shows."""
    if scene.use_preview_range:
        return scene.frame_preview_start, scene.frame_preview_end
    return scene.frame_start, scene.frame_end


def spread(first, last, most=MOST_FRAMES):
    """The frames from first to last, both included; of more than `most` as many, evenly spread."""
    count = last - first + 1
    if count <= most:
        return list(range(first, last + 1))
    return [first + round(i * (count - 1) / (most - 1)) for i in range(most)]


def blocks(frames, size):
    return [frames[start : start + size] for start in range(0, len(frames), size)]


def set_difference(parts, before, without, after):
    """How much less a frame takes without something that these parts share evenly. Lists of the same frames, with it
    before and after, since a machine's pace drifts."""
    noise_ms = noise(before, after)
    difference = median((a + b) / 2 - c for a, c, b in zip(before, without, after))
    for part in parts:
        part.noise_ms = noise_ms
        part.ms = difference / len(parts) if difference > noise_ms else 0.0


def noise(before, after):
    """What a difference may be off by: half the drift between the two, or the scatter."""
    drifts = [a - b for a, b in zip(before, after)]
    drift = median(drifts)
    scatter = median(abs(each - drift) for each in drifts)
    return max(abs(drift) / 2, NOISE_FACTOR * scatter / len(drifts) ** 0.5, LEAST_NOISE)


def order(objects):
    """Those that cost something, dearest first."""
    return sorted((cost for cost in objects if cost.parts), key=lambda cost: -cost.ms)


def part_text(part):
    if part.ms is None:
        return part.how
    return f"{part.ms:.2f} ms" if part.ms or not part.noise_ms else f"below {part.noise_ms:.2f} ms"


def verdict(cost):
    """What Accelerate has to do with an object, in a few words or a sentence; "" where it does not apply."""
    if cost.is_bound:
        return cost.reason or "accelerated"
    if cost.saves is not None:
        return f"saves {part_text(cost.saves)}"
    return cost.reason


def after_deforming(modifiers, deforming):
    """Names of what follows the deforming ones and can be switched off for a while. modifiers: (name, type) of those
    that are shown, in their order; deforming: the types that Sinew may take over."""
    kinds = [kind in deforming for _, kind in modifiers]
    tail = modifiers[kinds.index(False) :] if False in kinds else []
    return {name for name, kind in tail if kind not in SIMULATIONS}


def about_subdivision(modifiers):
    """Sentences. modifiers: (name, type) of those that are shown, in their order, where the preferences leave
    subdivision to the graphics card."""
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


def heading(profile):
    frames = profile.frames
    which = f"frame {frames[0]}" if len(frames) == 1 else f"{len(frames)} frames from {frames[0]} to {frames[-1]}"
    return f"{which}: {profile.frame_ms:.2f} ms per frame, give or take {profile.noise_ms:.2f} ms"


def rows(profile):
    """(what, its time, what Accelerate has to do with it) for each object, each followed by its parts; then what
    belongs to none. The objects and these add up to the frame."""
    found = []
    for cost in profile.objects:
        found.append((cost.name[0], f"{cost.ms:.2f} ms", verdict(cost)))
        found += [(f"  {part.name}", part_text(part), "") for part in cost.parts]
    return found + [(name, text, "") for name, text in last_rows(profile)]


def last_rows(profile):
    """(what, its time) of what belongs to no object."""
    name, ms = profile.rest
    return [*((part.name, part_text(part)) for part in profile.shared), (name, f"{ms:.2f} ms")]


def about_rest(profile):
    """A sentence about the last row, or ""."""
    if profile.rest_ms >= 0:
        return ""
    return (
        f"What was measured adds up to {-profile.rest_ms:.2f} ms more than the frame: Blender evaluates several things "
        "at the same time"
    )


def remarks(profile):
    found = [f"{cost.name[0]}: {remark}" for cost in profile.objects for remark in cost.remarks]
    return found + [sentence for sentence in [about_rest(profile)] if sentence]
