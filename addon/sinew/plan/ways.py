"""Chooses the path of a bound mesh: through an attribute, its canvas, its shape keys, or Blender's own modifier.

Sinew deforms in the pass in which Blender evaluates the mesh, so it has to know the Armature modifier's input without
Blender. Where it does not, Blender's own modifier deforms, in the same pass. Does not use Blender.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ..blender import modifier_types
from . import fronts, runs
from .situation import Modifier, Situation, Tail

ATTRIBUTE, CANVAS, KEYS, BLENDER = "ATTRIBUTE", "CANVAS", "KEYS", "BLENDER"
# A node group has a fixed cost, so with fewer vertices Blender's own modifier is faster.
# Measured: docs/speed.md, Small meshes.
FEWEST_VERTICES = {ATTRIBUTE: 3_000, CANVAS: 4_000, KEYS: 500}


@dataclass(frozen=True)
class Way:
    """The path of a mesh."""

    kind: str
    reason: str = ""  # of BLENDER, a sentence for users
    wants_keys: bool = False  # it would take the path through shape keys if it had any
    is_small: bool = False  # it could take another path, but Blender is faster with so few vertices
    is_of_bones: bool = False  # it could take another path with other bones
    front: tuple[str, ...] = ()  # of CANVAS, names of the modifiers that only the canvas evaluates
    tail: Tail | None = None  # of CANVAS: it evaluates these modifiers at rest, and stencils place their vertices
    has_copy: bool = False  # the canvas has a copy of the mesh, not the mesh itself
    has_keys: bool = False  # Sinew reads the shape keys, and has Blender add none of them
    # Of CANVAS: all of the result is the canvas's, which takes less time than to look up its positions. Nothing tells
    # which vertex of the mesh one of the result was made from.
    takes_all: bool = False

    @property
    def on_canvas(self) -> tuple[str, ...]:
        """Names of the modifiers that the canvas evaluates."""
        return self.tail.names if self.tail is not None else self.front

    @property
    def in_pass(self) -> bool:
        """Whether Sinew deforms, in Blender's pass."""
        return self.kind in {ATTRIBUTE, CANVAS, KEYS}

    @property
    def has_own(self) -> bool:
        """Whether Sinew's modifier places the vertices."""
        return self.kind in {ATTRIBUTE, CANVAS}


def choose(situation: Situation) -> Way:
    """Returns the path of a mesh object."""
    carrier = situation.carrier
    if situation.is_bound and (carrier is None or carrier.type == "ARMATURE" and carrier.lacks_target):
        return Way(BLENDER, "Its armature is gone: choose another one, or unbind")
    way = whatever_its_size(situation)
    fewest = FEWEST_VERTICES.get(way.kind, 0)
    run = runs.of(situation)
    if situation.wants_more or way.tail is not None or _has_slow_stage(situation, run):
        return way
    if way.kind == CANVAS and fewest and situation.is_canvas_slow and not run.stages:
        return Way(BLENDER, _shared(situation, "which Blender's own modifier deforms sooner in this version"))
    armatures = 1 + sum(map(len, run.mixes))
    if situation.vertex_count * armatures < fewest:
        reason = f"It has fewer than {fewest:,} vertices, which Blender's own modifier deforms sooner"
        return Way(BLENDER, reason, is_small=True)
    return way


def _has_slow_stage(situation: Situation, run: runs.Run) -> bool:
    """Whether Blender's own modifier takes so long for a stage of the run that Sinew is faster with any number of
    vertices. What follows another object's shape is not that slow, and Sinew has to read the shape on each frame."""
    kinds = {situation.modifier(name).type for name in run.stages}
    return not kinds <= modifier_types.CAGES | {"ARMATURE"}


def whatever_its_size(situation: Situation) -> Way:
    """Returns the path that a mesh would take with any number of vertices."""
    if situation.trouble:
        return Way(BLENDER, situation.trouble)
    if situation.animation_trouble:
        return Way(BLENDER, situation.animation_trouble)
    if situation.misses_bones:
        return Way(BLENDER, "Its library was saved by an earlier version of Sinew: open the library once, and save it")
    reason = _why_not_first(situation) or _why_not_idle(situation) or _why_not_switched(situation)
    if reason:
        return Way(BLENDER, reason)
    reason = _why_not_shared(situation) if situation.sharer_count > 1 else ""
    if reason:
        return Way(BLENDER, reason)
    if situation.weights_follow_shape:
        what = "Its shape keys move vertices" if situation.keys else "Mesh and armature move against each other"
        reason = (
            f"{what}, so the weights from envelopes or curved B-bones change on each frame: turn its bone envelopes "
            "off, and map its B-bones straight"
        )
        return Way(BLENDER, reason, is_of_bones=True)
    reason = situation.attribute_trouble if situation.keys is None else situation.key_trouble
    if reason:
        return Way(BLENDER, reason)
    if situation.keys is None:
        return _through_attribute(situation)
    way, tail = _through_keys(situation), tail_of(situation)
    if way.kind == KEYS and tail is not None:
        return Way(CANVAS, has_copy=True, takes_all=True, tail=tail, has_keys=True)
    return way


def _why_not_first(situation: Situation) -> str:
    """Returns why Blender has to evaluate a modifier before the first one that Sinew replaces, and what to do, or "".

    Shape keys have the deformed shape before all modifiers. A modifier that depends on the shape would see that.
    """
    taken = situation.taken[:1]
    for modifier in situation.modifiers if taken else ():
        if modifier.name in taken:
            break
        if modifier.is_own or modifier.does_nothing or modifier.is_beside_shape:
            continue
        where = ", in the library" if situation.is_linked or modifier.is_fixed else ""
        if modifier.type == "ARMATURE" and situation.is_bound:
            return (
                f"{modifier.full_name} comes before {taken[0]}, with which Sinew began: unbind the mesh and accelerate "
                f"it again, so that Sinew begins with {modifier.name}{where}"
            )
        if modifier.feeds:
            return (
                f"{modifier.full_name} changes the vertex group {modifier.feeds} before the mesh is deformed by it: "
                f"apply {modifier.name} if the weights may stay as they are{where}"
            )
        reason, name = fronts.why_not(situation)
        if reason and not modifier.keeps_shape:
            name = name or modifier.name
            return f"{reason}: move {name} behind {taken[0]} if the shape may be made in that order{where}"
        if situation.keys is not None:
            return (
                f"{modifier.full_name} comes before {taken[0]}, with which Sinew has to begin: move {modifier.name} "
                f"behind {taken[0]} if the shape may be made in that order{where}"
            )
    return ""


def _why_not_shared(situation: Situation) -> str:
    """Returns why Sinew cannot deform an object whose mesh others have too, and what to do, or ""."""
    if situation.keys is not None:
        return _shared(situation, "and Blender blends its shape keys for all of them")
    if situation.is_linked and situation.canvas is None:
        advice = "and this one is linked, so Sinew cannot add what it needs: make a library override of it"
        return f"{situation.sharer_count} objects share this mesh, {advice}"
    return ""


def _shared(situation: Situation, consequence: str) -> str:
    """Returns why the mesh is left to Blender although it would not be if no other object had it, and what to do."""
    advice = ": make it single-user" if situation.may_be_single_user else ""
    return f"{situation.sharer_count} objects share this mesh, {consequence}{advice}"


def _why_not_idle(situation: Situation) -> str:
    """Returns why Sinew has nothing to replace, or ""."""
    has_armature = situation.taken or situation.gets_armature
    idle = _why_by_parent(situation) if has_armature else why_idle(situation)
    return f"It {idle}" if idle else ""


def _why_not_switched(situation: Situation) -> str:
    """Returns why Sinew cannot follow the settings and switches of the Armature modifiers that it replaces, or ""."""
    taken = [situation.modifier(name) for name in situation.taken]
    reason = runs.why_not_known(taken[-1], situation.modifiers) if taken else ""
    if reason:
        return reason
    for modifier in taken:
        reason = runs.why_not_driven(modifier, f"{{}} of {modifier.name}") or modifier.trouble
        if reason:
            return reason
    if situation.tells_renders or any(modifier.is_switched for modifier in taken):
        return ""
    unlike = [modifier.name for modifier in taken if modifier.shown != taken[0].shown]
    if unlike:
        return (
            f"{taken[0].name} and {unlike[0]} are mixed, but their switches for viewport and renders differ: set them "
            "alike"
        )
    return ""


def why_idle(situation: Situation) -> str:
    """Returns why Sinew can replace nothing on a mesh without an armature, or "".

    The result is a sentence without its subject.
    """
    by_parent = _why_by_parent(situation)
    if by_parent:
        return by_parent
    run = runs.of(situation)
    if run.stages or situation.keys is not None and situation.keys.count > 1:
        return ""
    nothing = "has no armature, shape keys or smoothing that Sinew could take over: add one of them"
    return f"{nothing} ({run.end} comes first, and {run.reason})" if run.end else nothing


def _why_by_parent(situation: Situation) -> str:
    """Returns why the parent prevents Sinew from deforming the mesh, a sentence without its subject, or ""."""
    parent = situation.deforming_parent
    return (
        f"is deformed by its parent {parent} directly, before any modifier: set the parent type to Object"
        if parent
        else ""
    )


def _through_attribute(situation: Situation) -> Way:
    """Returns the path of a mesh without shape keys."""
    stages = runs.of(situation).stages
    reason = runs.why_no_own(situation, stages)
    if reason:
        return Way(BLENDER, f"{reason}: add a shape key, and Sinew uses that", wants_keys=True)
    front = fronts.of(situation.modifiers, situation.taken)
    tail = tail_of(situation)
    if not front and tail is None and situation.sharer_count == 1:
        return Way(ATTRIBUTE)
    return Way(
        CANVAS,
        front=tuple(modifier.name for modifier in front),
        has_copy=situation.sharer_count == 1,
        takes_all=bool(front or tail) or not situation.front_trouble and _is_idle_before(situation, stages),
        tail=tail,
    )


def tail_of(situation: Situation) -> Tail | None:
    """Returns what was found for the tail that the object has now, or None."""
    tail = situation.tail
    return tail if tail is not None and tail.names == runs.of(situation).tail else None


def _is_idle_before(situation: Situation, stages: Sequence[str]) -> bool:
    """Whether no modifier comes before those that Sinew replaces. stages: of the run."""
    for modifier in situation.modifiers:
        if modifier.name in situation.taken or modifier.name in stages:
            break
        if not modifier.is_own and not modifier.does_nothing:
            return False
    return True


def _through_keys(situation: Situation) -> Way:
    """Returns the path of a mesh with shape keys."""
    keys = situation.keys
    taken = [situation.modifier(name) for name in situation.taken]
    if keys is None or not keys.is_relative:
        return Way(BLENDER, "Its shape keys are absolute, which Sinew cannot blend: make them relative")
    if keys.is_one_shown:
        return Way(BLENDER, "Only the active shape key is shown: turn that off")
    if not situation.tells_renders and any(len({*each.shown}) > 1 and not each.is_switched for each in taken):
        return Way(
            BLENDER,
            "Its Armature modifier is shown only in the viewport or only in renders, which Sinew cannot tell apart on "
            "a mesh with shape keys: show it in both",
        )
    if taken and not taken[0].is_shown:
        return Way(BLENDER, _why_off(situation, taken[0]))
    return Way(KEYS, has_keys=True)


def _why_off(situation: Situation, modifier: Modifier) -> str:
    """Returns why an Armature modifier is switched off, or what to do."""
    caches = (each for each in situation.modifiers if each.type in modifier_types.CACHES and each.is_shown)
    cache = next(caches, None)
    if cache is not None:
        return f"{cache.name} plays a cache in place of {modifier.name}, which is switched off"
    return f"{modifier.name} is switched off: switch it on"
