"""Accelerates the rigs of bound meshes: those that can be computed are played although nobody has asked for it, as long
as nothing is edited. Such a rig looks and is posed as if it were live; one that cannot be computed stays Blender's.

To read a large rig takes 0.05 s. So it is done while the user does nothing, one rig after the other. In the background,
where nobody waits, all of them are read once so many frames were changed that it pays."""

from typing import Any

from ..blender import armatures, dependencies
from ..description import reading
from ..host import contract, features
from ..run import characters
from . import changes, comparing, elsewhere, playing, reasons, resting, rigs, states

# A rig with less to compute costs less than what it takes to write its pose into Blender. A constraint or a driver
# counts for as much as a bone.
LEAST_WORK = 60
MOST_TO_SKIP = 64  # steps, before a rig that could not be computed is tried again
_seen: Any = None  # after which evaluations, in which view layer and for which rigs' states _found was found
_found: list[Any] = []  # armature objects that may be accelerated


def accelerate(scene: Any, layer: Any) -> None:
    """Accelerates all rigs that can be, if the scene asks for it: before many frames are played. Call it in the main
    thread, outside an evaluation."""
    layer.update()
    end_rests()
    _accelerate(scene, layer)


def accelerate_unasked(scene: Any, graph: Any) -> None:
    """Accelerates the rigs in the background, in a handler after an evaluation. graph: what was evaluated; exporters
    have their own."""
    if not (playing.is_busy() or states.keeps_live()) and graph == graph.view_layer.depsgraph:
        _accelerate(scene, graph.view_layer)


def _accelerate(scene: Any, layer: Any) -> None:
    number = playing.evaluation_count()
    while scene.sinew_accelerates_rigs and _step(scene, layer, number):
        pass


def end_rests() -> None:
    """Says that the user does nothing, or that frames are played without edits."""
    for rig in rigs.known():
        rig.trial.rest.end()


def rest_edited(layer: Any) -> None:
    """Has rigs that are not accelerated rest if somebody has edited them since the last evaluation. Call it before
    one."""
    for ob in _worth(layer) if _can_take_over() else ():
        if resting.is_edited(ob, layer.depsgraph):
            rigs.learn(ob).trial.rest.note_live(True, True)


def _can_take_over() -> bool:
    return reading.CAN_READ and contract.has(features.PLAYING)


def step(scene: Any, layer: Any, number: int) -> bool:
    """Takes the next step, in the main thread, outside an evaluation, while the user does nothing. number: of the
    evaluations until now; a rig that could not be computed is tried again only if there were others since. Returns
    whether there may be another step."""
    # As between the last step of a drag and the evaluation after it, when bones are not yet where their channels are.
    layer.update()
    return _step(scene, layer, number)


def _step(scene: Any, layer: Any, number: int) -> bool:
    if not _can_take_over() or rigs.whole_frame(scene) is None:
        return False
    for rig in rigs.idle():
        if not rig.is_played and rig.source.program is None and not rig.source.refusal:
            states.read_ahead(rig)
            return True
    own = [rigs.learn(ob) for ob in _found_by(number, layer)]
    own = [rig for rig in own if not rig.is_idle and (rig.trial.needs_program or not rig.is_wanted)]
    for rig in own:
        if rig.trial.tried_at != number:
            changes.trust_again(rig)
    own = [rig for rig in own if not (rig.stays_live or rig.trust.is_distrusted) and rig.ob.mode in ("OBJECT", "POSE")]
    own = [rig for rig in own if not rig.trial.rest.left and (rig.trial.tries == 0 or rig.trial.tried_at != number)]
    due = [rig for rig in own if rig.trial.tries_to_skip == 0]
    for rig in own:
        rig.trial.tries_to_skip = max(rig.trial.tries_to_skip - 1, 0)
    for rig in due:
        states.want(rig, True)
        if not (rig.source.is_proven and rig.trust.is_posable):
            reasons.look_at_each([rig], scene, layer)
            _note(rig, not rig.reason, number)
            return True
        if not rig.source.compared:
            if comparing.compare(rig, scene):
                states.keep_played(scene, layer)
            rig.reason = rig.source.refusal or ("" if rig.source.compared else _why_not_compared(rig, scene))
            _note(rig, bool(rig.source.compared), number)
            return True
    if due:
        states.take_over(due, scene, layer)
    for rig in due:
        _note(rig, rig.is_played, number)
    return len(due) < len(own)


def compare_more(scene: Any, layer: Any) -> bool:
    """Compares one of the rigs that are accelerated with Blender on more frames, while the user has done nothing for a
    while. Returns False if there is none left."""
    for rig in rigs.played():
        if rig.trial.needs_program and rig.source.is_proven and rig.home.scene == scene and not rig.source.is_compared:
            if comparing.compare(rig, scene, None):
                states.hand_back([rig] if rig.source.refusal else [], scene, layer)
            return True
    return False


def _why_not_compared(rig: rigs.Rig, scene: Any) -> str:
    """Returns why a rig cannot be compared with Blender on any frame, as a sentence."""
    name = elsewhere.edited(dependencies.chain(rig.ob), scene)
    return f"{name}, on which {rig.name} depends, has changes that are not keyed: key them" if name else ""


def _note(rig: rigs.Rig, has_succeeded: bool, number: int) -> None:
    rig.trial.tries = 0 if has_succeeded else min(2 * rig.trial.tries + 1, MOST_TO_SKIP)
    rig.trial.tries_to_skip, rig.trial.tried_at = rig.trial.tries, number


def _found_by(number: int, layer: Any) -> list[Any]:
    """Returns the armature objects that may be accelerated. number: of the evaluations until now; without another one,
    nothing was edited."""
    global _seen, _found
    known = frozenset((rig.key, rig.is_idle) for rig in rigs.known() if rig.is_idle or rig.trial.tries_to_skip)
    now = number, layer.as_pointer(), known
    if now != _seen:
        _seen, _found = now, _armatures(layer)
    return [ob for ob in _found if rigs.is_alive(ob)]


def forget() -> None:
    """Has all looked for again, as in another file."""
    global _seen
    _seen = None


def _armatures(layer: Any) -> list[Any]:
    """Returns what `_worth` does, each after those that it follows."""
    worth = _worth(layer)
    due = dependencies.in_order(ob for ob in worth if not _waits(ob))
    return rigs.moving(list(dict.fromkeys((*due, *worth))))


def _worth(layer: Any) -> list[Any]:
    """Returns the armature objects, hidden or not, of bound meshes that are seen in a view layer, if they are worth it
    and are not accelerated."""
    idle = {rig.ob for rig in rigs.idle()}
    moved = ((ob, [each for each in armatures.of_modifiers(ob) if each not in idle]) for ob in characters.known())
    found = {each: None for ob, own in moved if own and ob.visible_get(view_layer=layer) for each in own}
    return [ob for ob in found if _work(ob) >= LEAST_WORK]


def needs_a_mesh(ob: Any) -> bool:
    """Whether an armature object would be accelerated if one of its meshes were bound, and none is."""
    if ob is None or _work(ob) < LEAST_WORK:
        return False
    return not any(ob in armatures.of_modifiers(each) for each in characters.known())


def _waits(ob: Any) -> bool:
    """Whether to find what an armature object follows would not help it now."""
    rig = rigs.get(ob)
    return rig is not None and rig.trial.tries_to_skip > 0


def _work(ob: Any) -> int:
    """Returns about how much Blender evaluates for an armature object."""
    drivers = ob.animation_data.drivers if ob.animation_data is not None else ()
    count = len(ob.pose.bones) + len(drivers)
    return count if count >= LEAST_WORK else count + sum(len(bone.constraints) for bone in ob.pose.bones)
