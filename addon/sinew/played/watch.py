"""What the pose of an armature depends on, and whether any of it was edited.

A pose is a function of time and of evaluated copies: of the armature, of what its constraints and drivers read, of what
those use in turn, and so on, as Blender itself lists who uses whom. Time changes a copy in place. Before anything else
does, Blender copies the data-block again, and the copy has no mark (host/marks.py). So there is no list of settings
that matter: a record holds as long as all marks are there.

The actions of an idle armature have no copy. Of these, what is stored is compared when they were tagged
(changes.look_at_actions)."""

from collections.abc import Iterable, Sequence
from typing import Any

import bpy

from ..blender import animation, dependencies, values
from ..blender.values import is_alive
from ..host import driver_memory, evaluations, key_blocks, keyframes, marks
from .keys import keys_of

_WITHOUT_COPY = (bpy.types.Curve, bpy.types.Key, bpy.types.Object)
_expected: dict[int, set[int]] = {}  # by view layer: keys of data-blocks that this package has had copied
_awaited: dict[int, Any] = {}  # by view layer: see wait_for


class Watch:
    """The marks on what the pose of one armature depends on, in one dependency graph."""

    def __init__(
        self,
        rig: Any,
        blocks: Iterable[Any],
        action: Any,
        follow: Sequence[Any],
        graph: Any,
        unseen: Sequence[Any] = (),
    ) -> None:
        """Marks the copies of these original data-blocks.

        rig: the armature object; action: its own, whose edits are told apart from others, or None. follow:
        (data-block of shape keys, numbers) as in Followers.keyed. Blender copies these after an edit of the mesh too:
        then all but the points is compared. unseen: actions that the armature plays though they have no copy."""
        self.action = action
        self.follow = [(values.key_of(keys), numbers) for keys, numbers in follow]
        self._states = {values.key_of(keys): _state_of(keys) for keys, _numbers in follow}
        self.blocks = [
            each for each in blocks if each != action and (each in unseen or each.evaluated_get(graph).is_evaluated)
        ]
        self._stored = {
            values.key_of(each): keys_of(each) for each in self.blocks if isinstance(each, bpy.types.Action)
        }
        self._is_edited = False  # one of these, while it had no copy
        self.keys = [values.key_of(each) for each in self.blocks]
        self._own = {values.key_of(rig), values.key_of(rig.data)}
        self._busy: set[int] = set()  # keys of the other blocks that the last evaluation has changed
        self.mark(graph)

    def is_like(self, other: "Watch") -> bool:
        """Whether two watch the same, of shape keys with the same drivers and settings."""
        same = self.keys == other.keys and self._states.keys() == other._states.keys()
        return same and all(_are_equal(state, other._states[key]) for key, state in self._states.items())

    def mark(self, graph: Any) -> None:
        """Marks all, as they are now."""
        for block in self.blocks:
            _mark(block, graph)
        self.mark_keys(graph)

    def mark_keys(self, graph: Any) -> None:
        """Marks the action."""
        if self.action is not None:
            _mark(self.action, graph)

    def holds(self, graph: Any) -> bool:
        """Whether nothing but time, and this package, has changed any of them."""
        expected = _expected.get(graph.view_layer.as_pointer(), ())
        if self._is_edited:
            return False
        try:
            for key, block in zip(self.keys, self.blocks):
                copy = block.evaluated_get(graph)
                if not copy.is_evaluated:  # an idle armature's actions, and a hidden curve of its own, have no copy
                    if key not in self._stored and (
                        not isinstance(block, _WITHOUT_COPY) or evaluations.is_tagged(block)
                    ):
                        return False
                elif key in expected:
                    marks.mark_copy(copy)
                elif not marks.is_marked_copy(copy):
                    if key not in self._states or not _are_equal(_state_of(block), self._states[key]):
                        return False
                    marks.mark_copy(copy)
        except ReferenceError:  # it no longer exists
            return False
        return True

    def note_edited(self, action: Any) -> bool:
        """Notes that an action that has no copy was tagged. Returns whether it is the armature's own."""
        stored = self._stored.get(values.key_of(action))
        self._is_edited |= stored is not None and not stored.is_like(keys_of(action))
        return action == self.action

    def are_keys_edited(self, graph: Any) -> bool:
        """Whether the action may have been edited. Of an idle armature it is not in the graph."""
        try:
            if self.action is None:
                return False
            copy = self.action.evaluated_get(graph)
            return not marks.is_marked_copy(copy) if copy.is_evaluated else evaluations.is_tagged(self.action)
        except ReferenceError:
            return True

    def are_keys_tagged(self, graph: Any) -> bool:
        """Whether the action was edited since the last evaluation, which a live armature plays, too. Call it before an
        evaluation: in one, time tags it."""
        return is_alive(self.action) and _is_copy_tagged(self.action, graph)

    def is_tagged(self, graph: Any, is_new_frame: bool) -> bool:
        """Whether somebody has edited any of them since the last evaluation. Before a change of the frame that is
        exact. Otherwise a handler may have asked for the evaluation, and what the one that has called it has changed is
        left to `holds`."""
        expected = _expected.get(graph.view_layer.as_pointer(), set())
        left = expected if is_new_frame else expected | self._busy
        try:
            return self._is_edited or any(
                evaluations.is_tagged(block.evaluated_get(graph))
                for key, block in zip(self.keys, self.blocks)
                if key not in left and key not in self._states
            )
        except ReferenceError:
            return True

    def may_be_edited(self, graph: Any) -> bool:
        """Whether somebody may have edited any of them since Blender has evaluated them, or the action."""
        try:
            is_tagged = any(evaluations.is_tagged(block.evaluated_get(graph)) for block in self.blocks)
        except ReferenceError:
            return True
        return is_tagged or self.are_keys_edited(graph) or not self.holds(graph)

    def mark_expected(self, graph: Any) -> None:
        """Marks those that were expected to be copied."""
        expected = _expected.get(graph.view_layer.as_pointer(), ())
        for key, block in zip(self.keys, self.blocks):
            if key in expected and is_alive(block):
                _mark(block, graph)

    def expect_edited(self, graph: Any) -> None:
        """Says that what has been edited until now is known. Blender copies it in the next evaluation."""
        expect(graph, (block for block in self.blocks if evaluations.is_tagged(block.evaluated_get(graph))))

    def note(self, graph: Any) -> None:
        """Notes what the evaluation whose handlers run has changed. It evaluates a played armature only if somebody has
        edited it."""
        self._busy = {
            key
            for key, block in zip(self.keys, self.blocks)
            if key not in self._own and evaluations.is_tagged(block.evaluated_get(graph))
        }


def _state_of(keys: Any) -> tuple[Any, list[Any]]:
    """Returns all of shape keys but their points and values: the curves of their drivers, and the rest."""
    drivers = animation.drivers_of(keys)
    curves, found = keyframes.read(drivers), [dependencies.plain(keys, 0), key_blocks.settings(keys)]
    read = driver_memory.read_bytes(drivers, is_whole=True)
    if read is None:
        found += [dependencies.plain(each.driver) for each in drivers]
    found += [dependencies.plain(each) for i, each in enumerate(drivers) if read is None or not curves.is_local(i)]
    return curves, [read, *found]


def _are_equal(state: tuple[Any, list[Any]], other: tuple[Any, list[Any]]) -> bool:
    return state[1] == other[1] and state[0].differing(other[0]) == []


def _is_copy_tagged(block: Any, graph: Any) -> bool:
    copy = block.evaluated_get(graph)
    return copy.is_evaluated and evaluations.is_tagged(copy)


def _mark(block: Any, graph: Any) -> None:
    copy = block.evaluated_get(graph)
    if copy.is_evaluated:
        marks.mark_copy(copy)


def may_have_moved(block: Any, graph: Any) -> bool:
    """Whether somebody may have moved an object, or edited another data-block, that is watched, or has hidden it, so
    that Blender may not evaluate it."""
    if not is_alive(block):
        return True
    if isinstance(block, bpy.types.Object) and not block.visible_get(view_layer=graph.view_layer):
        return True
    data = getattr(block, "animation_data", None)  # an action has none
    action = data.action if data is not None else None
    copies_of = [each.evaluated_get(graph) for each in (block, action) if each is not None]
    return not all(
        each.is_evaluated and marks.is_marked_copy(each) and not evaluations.is_tagged(each) for each in copies_of
    )


def expect(graph: Any, blocks: Iterable[Any]) -> None:
    """Says that this package has Blender copy these original data-blocks in the next evaluation of a graph."""
    _expected.setdefault(graph.view_layer.as_pointer(), set()).update(map(values.key_of, blocks))


def expect_hand_back(graph: Any, rig: Any) -> None:
    """Says that Blender copies an armature and its actions again, because relations are built with them."""
    actions = (
        [each for each in rig.motion.watch.blocks if isinstance(each, bpy.types.Action)]
        if rig.motion.watch is not None
        else []
    )
    expect(graph, [rig.ob, rig.ob.data, *actions])


def wait_for(graph: Any, tagged: Any) -> None:
    """Says by which original object one can see that what was expected has happened: it is not tagged any more."""
    _awaited[graph.view_layer.as_pointer()] = tagged


def is_waiting() -> bool:
    """Whether anything is waited for, in any graph."""
    return bool(_awaited)


def has_happened(graph: Any) -> bool:
    """Whether Blender has made the next evaluation without calling handlers, as it does after handlers have tagged
    something on a new frame. Call it before an evaluation."""
    tagged: Any = _awaited.get(graph.view_layer.as_pointer())
    return is_alive(tagged) and not evaluations.is_tagged(tagged.evaluated_get(graph))


def expect_no_more(graph: Any) -> None:
    """Called after that evaluation."""
    _expected.pop(graph.view_layer.as_pointer(), None)
    _awaited.pop(graph.view_layer.as_pointer(), None)


def own_action(rig: Any) -> Any:
    """Returns the action of an armature object if its keyframes matter only at their own times, or None: NLA strips and
    constraints use actions at others."""
    data = rig.animation_data
    if data is None or data.action is None or animation.plays_strips(data):
        return None
    others = [each for bone in rig.pose.bones for each in dependencies.constraints_of(bone) if each.type == "ACTION"]
    return None if any(each.action == data.action for each in others) else data.action
