"""The armatures that are recorded or played, and what is recorded of them."""

import contextlib
import enum
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import bpy
import numpy as np

from ..blender import dependencies, values
from ..blender.values import is_alive
from ..host import evaluations, key_blocks, keyframes, poses
from ..host.places import Channel
from . import families, followers, records, settings
from .followers import Followers
from .resting import Rest
from .settings import Setting

DEFAULT_LIMIT = 2048  # megabytes for all records
store: records.Store = records.Store(DEFAULT_LIMIT * records.MEGABYTE)


class State(enum.Enum):
    """See states.py, which alone changes it."""

    LIVE = enum.auto()
    WANTED = enum.auto()
    PLAYED = enum.auto()
    POSED = enum.auto()
    SUSPECT = enum.auto()


class Data(NamedTuple):
    """What the drivers of an armature read of other data-blocks. It is compared after each evaluation."""

    still: tuple[tuple[Any, str, float], ...] = ()  # data-block, path, and value: what only edits change, of no objects
    computed: tuple[tuple[Any, str], ...] = ()  # what keyframes set, see Moment.data
    through: tuple[Any, ...] = ()  # the data-blocks by which drivers name that
    owners: tuple[Any, ...] = ()  # the data-blocks that have all this, no objects


@dataclass
class Source:
    """What the moments of one armature are computed from, see computing.py."""

    player: Any = None  # sinew_native.RigPlayer, whose numbers are those of a Moment
    settings: tuple[Setting, ...] = ()  # that keyframes and drivers set besides
    # If it moves as a whole: its parents and itself, each with the numbers of its place that keyframes set.
    place: tuple[tuple[Any, tuple[Channel, ...]], ...] = ()
    leaders: tuple[Any, ...] = ()  # what it follows of other armatures, leading.Leader
    moving: tuple[Any, ...] = ()  # the other objects that it computes, as it follows them, parents first
    data: Data = Data()  # what its drivers read of other data-blocks
    is_proven: bool = False  # it has computed what Blender has
    is_posable: bool = False  # keyframes set nothing but what is written on each frame
    refusal: str = ""  # why there is no program
    heads: dict[int, Any] = field(default_factory=dict)  # of bones, by frame, see onion/motion_paths.py
    compared: set[int] = field(default_factory=set)  # frames on which it is what Blender has, see comparing.py
    is_compared: bool = False  # on all frames of the scene's range on which it can be
    # What a frame takes here, and in Blender: medians over the same frames; 0: not measured.
    milliseconds: float = 0.0
    blender_milliseconds: float = 0.0

    @property
    def program(self) -> Any:
        """A sinew_native.RigProgram, or None."""
        return self.player and self.player.program

    @property
    def hangs(self) -> bool:
        """Whether its parents move."""
        return any(channels for _ob, channels in self.place[:-1])


@dataclass(slots=True)
class Home:
    """The view layer in which an armature is recorded and played."""

    scene: Any = None
    layer: int = 0  # its address


@dataclass(slots=True)
class Shown:
    """What was written last."""

    frame: float | None = None
    moment: Any = None  # the Moment of that frame; None: Blender has evaluated it
    family: families.Family = field(default_factory=families.Family)  # where it was put with it, if it moves as a whole


@dataclass(slots=True)
class Motion:
    """What is known of an armature's frames, and what that depends on."""

    record: records.Record
    computed: tuple[float, Any] | None = None  # what its program has computed last: (time, Moment)
    last: Any = None  # what its last program was read from, see computing.py
    watch: Any = None  # watch.Watch on what the record depends on; None: nothing is recorded
    keys: Any = None  # the keyframes that the record was made with, a keys.Keys
    has_edited_keys: bool = False  # they may not be those any more
    tempo: tuple[int, int] = (0, 0)  # how the scene has mapped its frames to times
    restless: int = 0  # frames that will not be recorded if somebody edits it on this one again
    to_skip: int = 0  # frames that are not recorded now
    skins: Any = None  # its onion skins (ghosts.Skins), if they are shown


@dataclass(slots=True)
class Trust:
    """Whether its programs have computed what Blender has."""

    is_distrusted: bool = False  # a moment that was computed was not what Blender has evaluated
    distrusted: Any = None  # as description.edits.settings_of returned it then
    has_differed: bool = False  # from what Blender has evaluated elsewhere, once
    difference: Any = None  # differences.Difference of its last program, or None
    is_posable: bool = False  # it may be POSED: such a program was proven
    posed_on: float | None = None  # the frame on which Blender has last evaluated it while it is POSED


@dataclass(slots=True)
class Trial:
    """How an armature is played that nobody has asked to record, see accelerating.py."""

    needs_program: bool = False  # it is to be played only if it is computed
    tries: int = 0
    tries_to_skip: int = 0
    tried_at: int = 0
    rest: Rest = field(default_factory=Rest)  # from edits on each frame


@dataclass(slots=True)
class Noticed:
    """What was seen of an armature at the last look, or when it was taken over."""

    is_selected: bool = False  # it was, or something of it, at the last look
    tracks: list[tuple[bool, bool]] = field(default_factory=list)  # as returned by tracks_of, at the last look
    animation: Any = None  # as returned by animation_of, when it was taken over
    actions: list[Any] = field(default_factory=list)  # that Blender had evaluated when it was taken over
    asks_for_keys: bool = False  # one of these was edited so that Blender would evaluate keyframes on this frame
    unseen: list[Any] = field(default_factory=list)  # what it follows, if relations were built without some of it
    data: tuple[tuple[Any, str, float], ...] = ()  # see known_data, when it was POSED
    hangs_unseen: bool = False  # relations were built without its parent, which moves


@dataclass(eq=False, slots=True)
class Rig:
    """An armature that may be played, with all that follows it."""

    ob: Any  # the original armature object
    key: int
    last_name: str  # when somebody has asked for it
    motion: Motion
    library: str | None = None  # that it is linked from; an override of it has the same name
    state: State = State.LIVE
    reason: str = ""  # why it is live although it is to be played, a sentence
    followers: Followers = field(default_factory=Followers)
    source: Source = field(default_factory=Source)
    home: Home = field(default_factory=Home)
    shown: Shown = field(default_factory=Shown)
    trust: Trust = field(default_factory=Trust)
    trial: Trial = field(default_factory=Trial)
    noticed: Noticed = field(default_factory=Noticed)

    @property
    def name(self) -> str:
        """The armature object's name, or its last one if that no longer exists."""
        if is_alive(self.ob):
            self.last_name = self.ob.name
        return self.last_name

    @property
    def is_played(self) -> bool:
        return self.state is State.PLAYED

    @property
    def is_idle(self) -> bool:
        """Whether Blender has built relations without its keyframes."""
        return self.state in (State.PLAYED, State.POSED)

    @property
    def is_wanted(self) -> bool:
        """Whether it is played whenever possible."""
        return self.state is not State.LIVE

    @property
    def stays_live(self) -> bool:
        """Whether its own switch leaves it to Blender."""
        return is_alive(self.ob) and not self.ob.sinew_accelerates_rig

    def try_at_once(self) -> None:
        """Has it tried again as soon as possible, see accelerating.py."""
        self.trial.tries = self.trial.tries_to_skip = 0

    @property
    def is_recorded(self) -> bool:
        """Whether its poses are recorded while Blender evaluates it: not if they can be computed. Of those that are
        wanted native, for their onion skins."""
        return not self.source.is_proven and (not self.trial.needs_program or self.motion.skins is not None)

    def at(self, time: float) -> Any:
        """Returns the Moment at that frame or between two, or None if it is neither recorded nor was computed last."""
        computed = self.motion.computed
        return computed[1] if computed is not None and computed[0] == time else self.motion.record.at(time)

    def origin(self, frame: int) -> Any:
        """Returns an object that lives, and stays the same, as long as the pose of that frame does; None if the pose is
        not known."""
        if self.source.is_proven:
            return self.source.player
        moment = self.motion.record.at(frame)
        return None if moment is None else moment.pose

    def clear(self) -> None:
        """Drops all that is recorded."""
        self.motion.record.clear()
        self.source, self.trust.difference = Source(), None
        self.motion.watch = self.motion.computed = self.motion.last = None
        if self.motion.skins is not None:
            self.motion.skins.clear()

    def live_in(self, scene: Any, layer: Any) -> None:
        """Records and takes it over in a view layer from now on."""
        self.home.scene, self.home.layer = scene, layer.as_pointer()

    def graph(self) -> Any:
        """Returns the dependency graph in which it is recorded and played, or None."""
        if not is_alive(self.home.scene):
            return None
        found = next((each for each in self.home.scene.view_layers if each.as_pointer() == self.home.layer), None)
        return found.depsgraph if found is not None else None


_rigs: dict[int, Rig] = {}


def set_limit(megabytes: int) -> None:
    """Sets how much memory all records may need together."""
    store.set_limit(megabytes * records.MEGABYTE)


def used_memory() -> int:
    """Returns how much memory all records need, in bytes."""
    return store.used


def has_any() -> bool:
    """Whether any armature is known."""
    return bool(_rigs)


def known() -> list[Rig]:
    """Returns the armatures that are recorded or played, without those that no longer exist."""
    for key in [key for key, rig in _rigs.items() if not is_alive(rig.ob)]:
        _rigs.pop(key).clear()
    return list(_rigs.values())


def at_home(graph: Any) -> list[Rig]:
    """Returns the armatures that are recorded and played in a graph."""
    scene, layer = graph.scene, graph.view_layer.as_pointer()
    return [rig for rig in known() if rig.home.layer == layer and is_alive(rig.home.scene) and rig.home.scene == scene]


def graphs(own: Iterable[Rig]) -> list[Any]:
    """Returns the graphs in which these are recorded and played, without duplicates."""
    return [graph for graph in {rig.home.layer: rig.graph() for rig in own}.values() if graph is not None]


def played() -> list[Rig]:
    """Returns the armatures that are played."""
    return [rig for rig in known() if rig.is_played]


def idle() -> list[Rig]:
    """Returns the armatures without whose keyframes Blender has built relations."""
    return [rig for rig in known() if rig.is_idle]


def get(ob: Any) -> Rig | None:
    """Returns what is known of an armature object, or None."""
    found = _rigs.get(values.key_of(ob))
    return found if found is not None and is_alive(found.ob) else None


def learn(ob: Any) -> Rig:
    """Records an original armature object from now on, whenever it plays. Returns what is known of it."""
    found = get(ob)
    if found is None:
        found = _rigs[values.key_of(ob)] = Rig(ob, values.key_of(ob), ob.name, Motion(records.Record(store)))
        found.library = ob.library.filepath if ob.library is not None else None
        found.noticed.tracks = tracks_of(ob)
    return found


def tracks_of(ob: Any) -> list[tuple[bool, bool]]:
    """Returns which NLA tracks of an object are on: whether each is muted, and whether it is the only one played."""
    data = ob.animation_data
    return [(track.mute, track.is_solo) for track in data.nla_tracks] if data is not None else []


def animation_of(ob: Any) -> Any:
    """Returns what is equal at two times if nothing of an object's animation was removed: Blender tags nothing then."""
    data = ob.animation_data
    if data is None:
        return None
    action = values.key_of(data.action) if data.action is not None else 0
    return action, len(data.drivers), [len(track.strips) for track in data.nla_tracks]


def forget() -> None:
    """Discards everything, as after a file was loaded."""
    for rig in _rigs.values():
        rig.clear()
    _rigs.clear()


def evaluated_copy(rig: Rig, graph: Any) -> Any:
    """Returns the evaluated copy of an armature, or None if the graph has none."""
    if graph is None:
        return None
    found = rig.ob.evaluated_get(graph)
    return found if found.is_evaluated else None


def is_hidden(rig: Rig, graph: Any) -> bool:
    """Whether an armature is hidden in a graph, so that Blender may evaluate only some of its bones."""
    return not rig.ob.visible_get(view_layer=graph.view_layer)


def is_without_keys(rig: Rig, graph: Any) -> bool:
    """Whether a graph evaluates no keyframes of an armature: its relations are those that `states` has built. A copy
    that Blender has made since has the action and tracks, but the graph has not."""
    found = {rig: None}
    queue = [rig]
    for each in queue:
        evaluated = evaluated_copy(each, graph)
        if evaluated is None or has_animation(each.ob):
            if not _has_lost_keys(each, evaluated, graph):
                return False
            continue
        new = [leader for leader in _leaders_of(each) if leader not in found]  # it is as those that it follows
        found.update(dict.fromkeys(new))
        queue += new
    return True


def _leaders_of(rig: Rig) -> list[Rig]:
    if rig.source.program is not None:
        return [each.rig for each in rig.source.leaders]
    # To look for them takes as long as a frame.
    return [each for each in map(get, dependencies.chain(rig.ob)[:-1]) if each is not None]


def _has_lost_keys(rig: Rig, evaluated: Any, graph: Any) -> bool:
    data = evaluated.animation_data if evaluated is not None else None
    if data is None:
        return False
    if data.action is None and not len(data.nla_tracks):
        return True
    played = [each.action for each in keyframes.actions_of(rig.ob)]
    return bool(played) and not any(each.evaluated_get(graph).is_evaluated for each in played)


def unseen_actions(rig: Rig, graph: Any) -> list[Any]:
    """Returns the actions of an idle armature that a graph does not have."""
    own = rig.noticed.actions if rig.is_idle else ()
    return [each for each in own if is_alive(each) and not each.evaluated_get(graph).is_evaluated]


def is_moved_by_objects(rig: Rig, graph: Any) -> bool:
    """Whether a change of the frame has had Blender evaluate an armature because of objects that it follows."""
    copy = evaluated_copy(rig, graph)
    return copy is not None and evaluations.is_tagged(copy) and follows_only_objects(rig)


class Moment(NamedTuple):
    """What is recorded of one frame."""

    pose: np.ndarray  # (N,) uint8, see host/poses.py
    keys: tuple[tuple[float, ...], ...]  # the values of the keys that followers.keyed lists
    settings: tuple[float, ...] = ()  # the values of those that source.settings lists
    place: tuple[float, ...] = ()  # the numbers that source.place lists
    data: tuple[float, ...] = ()  # those that source.data.computed lists

    @property
    def nbytes(self) -> int:
        return self.pose.nbytes + sum(map(sys.getsizeof, self.keys))


def moment_of(rig: Rig, graph: Any) -> Moment:
    """Returns what an evaluation has made of an armature."""
    values_now = tuple(key_blocks.values_of(keys.evaluated_get(graph), numbers) for keys, numbers in keyed(rig, graph))
    copy = evaluated_copy(rig, graph)
    own = settings.read(copy, rig.source.settings)
    return Moment(poses.record(copy), values_now, own, families.numbers_of(rig.source.place, graph))


def keyed(rig: Rig, graph: Any) -> list[tuple[Any, tuple[int, ...]]]:
    """Returns the shape keys that follow an armature and are in the graph."""
    return [
        (keys, numbers)
        for keys, numbers in rig.followers.keyed
        if is_alive(keys) and keys.evaluated_get(graph).is_evaluated and max(numbers) < len(keys.key_blocks)
    ]


def shows(rig: Rig, graph: Any, moment: Any) -> bool:
    """Whether the evaluated bones, the keys that follow them and the armature's place are exactly as recorded."""
    return moment is not None and is_placed(rig, graph, moment) and _show(graph, [(rig, moment)])[0]


def known_data(rig: Rig) -> tuple[tuple[Any, str, float], ...]:
    """Returns what an armature's last moment was computed with of other data-blocks: each with path and value."""
    data, moment = rig.source.data, rig.shown.moment
    computed = zip(data.computed, moment.data if moment is not None else ())
    return (*data.still, *((block, path, value) for (block, path), value in computed))


def have(known: Iterable[tuple[Any, str, float]], graph: Any) -> bool:
    """Whether data-blocks have, as evaluated, these values. known: as known_data returns it."""
    return all(_has(block, path, value, graph) for block, path, value in known)


def is_data_edited(rig: Rig, graph: Any) -> bool:
    """Whether Blender is about to evaluate something else of these data-blocks. Keyframes of theirs set none of it."""
    return any(
        not is_alive(block) or _is_tagged(block, graph) and not _has(block, path, value, None)
        for block, path, value in rig.source.data.still
    )


def _is_tagged(block: Any, graph: Any) -> bool:
    return evaluations.is_tagged(block.evaluated_get(graph))


def _has(block: Any, path: str, value: float, graph: Any) -> bool:
    """Whether a data-block has this value. graph: None for the original."""
    try:
        own = (block if graph is None else block.evaluated_get(graph)).path_resolve(path)
        return bool(np.float32(own) == np.float32(value))
    except (ReferenceError, ValueError, TypeError):  # it is gone
        return False


def is_placed(rig: Rig, graph: Any, moment: Moment) -> bool:
    """Whether an armature is where it was recorded, or what moves it is not."""
    return not rig.source.place or families.numbers_of(rig.source.place, graph) == moment.place


def are_left(graph: Any, own: Sequence[Rig]) -> list[bool]:
    """Whether the evaluated bones of armatures, and the keys that follow them, are as their last poses have left
    them."""
    found = iter(_show(graph, [(rig, rig.shown.moment) for rig in own if rig.shown.moment is not None]))
    return [rig.shown.moment is not None and next(found) and rig.shown.family.is_left(graph) for rig in own]


def is_left_by(rig: Rig, graph: Any) -> bool:
    """Whether an armature's bones, and the keys that follow it, are as its last pose has left them after the evaluation
    whose handlers run. What that has not evaluated is not looked at."""
    copy = evaluated_copy(rig, graph)
    if copy is not None and (evaluations.is_tagged(copy) or evaluations.is_tagged(copy.data)):
        return shows(rig, graph, rig.shown.moment) and rig.shown.family.is_left(graph)
    follow = keyed(rig, graph)
    has_evaluated = any(evaluations.is_tagged(keys.evaluated_get(graph)) for keys, _numbers in follow)
    return not has_evaluated and len(follow) == len(rig.shown.moment.keys) or _have_values(rig, graph, rig.shown.moment)


def _show(graph: Any, asked: Sequence[tuple[Rig, Moment]]) -> list[bool]:
    found = poses.are_posed((evaluated_copy(rig, graph), moment.pose) for rig, moment in asked)
    return [is_posed and _have_values(rig, graph, moment) for is_posed, (rig, moment) in zip(found, asked)]


def _have_values(rig: Rig, graph: Any, moment: Moment) -> bool:
    follow = keyed(rig, graph)
    return len(follow) == len(moment.keys) and all(
        key_blocks.values_of(keys.evaluated_get(graph), numbers) == recorded
        for (keys, numbers), recorded in zip(follow, moment.keys)
    )


def is_shown(rig: Rig, graph: Any, moment: Any) -> bool:
    """Whether a graph shows a recorded moment of an armature, played or live."""
    return evaluated_copy(rig, graph) is not None and shows(rig, graph, moment)


def show(rig: Rig, graph: Any, moment: Any) -> bool:
    """Writes what is recorded into the evaluated copies, and into the originals as Blender does. Returns False if the
    bones are others than those that were recorded."""
    is_shown = poses.play(evaluated_copy(rig, graph), moment.pose)
    poses.play_original(rig.ob, moment.pose)
    _write_settings(rig, graph, moment, ())
    _place(rig, graph, moment)
    for (keys, numbers), recorded in zip(keyed(rig, graph), moment.keys):
        key_blocks.set_values(keys.evaluated_get(graph), numbers, recorded)
        key_blocks.set_values(keys, numbers, recorded)
    return is_shown


def _write_settings(rig: Rig, graph: Any, moment: Moment, before: Sequence[float]) -> None:
    """Writes into the evaluated copy, too: drivers of others read it, and if what the armature follows is edited,
    Blender evaluates the bones with these settings."""
    settings.write(rig.ob, rig.source.settings, moment.settings, before or None)
    with contextlib.suppress(ValueError, KeyError):  # renamed: Blender copies it again before it evaluates it
        settings.write(evaluated_copy(rig, graph), rig.source.settings, moment.settings, before or None)


def _place(rig: Rig, graph: Any, moment: Moment) -> None:
    rig.shown.family.forget()
    if rig.source.place:
        rig.shown.family.write(rig.source.place, moment.place, rig.followers.carried, graph)


def show_next(graph: Any, steps: Iterable[tuple[Rig, Moment]]) -> list[bool]:
    """Does what `shows` and `show` do, for several armatures at once, and goes through the bones of each only once.
    steps: each with the Moment to show; `rig.shown.moment` must be shown. Returns False for those of which it is not:
    they have to be handed back, because some bones may have been written."""
    found = []
    for rig, moment in steps:
        follow = [(keys.evaluated_get(graph), keys, numbers) for keys, numbers in keyed(rig, graph)]
        is_left = rig.shown.moment is not None and len(follow) == len(rig.shown.moment.keys) == len(moment.keys)
        is_left = is_left and rig.shown.family.is_left(graph)
        is_left = is_left and all(
            key_blocks.values_of(evaluated, numbers) == recorded
            for (evaluated, _keys, numbers), recorded in zip(follow, rig.shown.moment.keys)
        )
        found.append((rig, moment, follow, is_left))
    stepped = iter(
        poses.step(
            (evaluated_copy(rig, graph), rig.ob, rig.shown.moment.pose, moment.pose)
            for rig, moment, _follow, is_left in found
            if is_left
        )
    )
    results = [is_left and next(stepped) for _rig, _moment, _follow, is_left in found]
    for (rig, moment, follow, _is_left), is_shown in zip(found, results):
        if is_shown:
            _write_settings(rig, graph, moment, rig.shown.moment.settings)
            _place(rig, graph, moment)
        for (evaluated, keys, numbers), recorded in zip(follow, moment.keys) if is_shown else ():
            key_blocks.set_values(evaluated, numbers, recorded)
            key_blocks.set_values(keys, numbers, recorded)
    return results


def whole_frame(scene: Any) -> int | None:
    """Returns the scene's frame, or None on a sub-frame."""
    return scene.frame_current if scene.frame_subframe == 0 else None


def time_of(scene: Any) -> float:
    """Returns the scene's frame, with the part of a frame that has passed since."""
    return scene.frame_current + scene.frame_subframe


def now(rig: Rig, scene: Any) -> Moment | None:
    """Returns what is recorded of the scene's frame, or None."""
    frame = whole_frame(scene)
    return rig.at(frame) if frame is not None else None


def has_animation(ob: Any) -> bool:
    """Whether an original data-block has an action or NLA tracks."""
    data = getattr(ob, "animation_data", None)
    return data is not None and (data.action is not None or len(data.nla_tracks) > 0)


def can_be_recorded(ob: Any) -> bool:
    """Whether poses of an armature object with keyframes may be recorded: what its drivers read of other data-blocks
    than objects would be known only if they were computed."""
    return has_animation(ob) and not dependencies.data_read_by(ob)


def moves(ob: Any) -> bool:
    """Whether an armature object has keyframes, or what it follows has."""
    return bool(moving([ob]))


def moving(armatures: Sequence[Any]) -> list[Any]:
    """Returns those of these armature objects that have keyframes, or follow what has."""
    found = {ob for ob in armatures if has_animation(ob) or (rig := get(ob)) is not None and rig.is_idle}
    found |= {ob for ob in armatures if ob not in found and _reads_what_is_animated(ob)}
    others = [ob for ob in armatures if ob not in found]
    found |= dependencies.reaching(others, dependencies.leaders_of, has_animation)
    return [ob for ob in armatures if ob in found or followers.moving(ob, dependencies.outside_of(ob))]


def _reads_what_is_animated(ob: Any) -> bool:
    read = dependencies.data_read_by(ob)
    return any(has_animation(each) or has_animation(getattr(each, "node_tree", None)) for each in read)


def follows_only_objects(rig: Rig) -> bool:
    """Whether an armature has no keyframes, nor have bones that it follows: none tell which relations Blender has."""
    return not (has_animation(rig.ob) or rig.source.leaders or len(dependencies.chain(rig.ob)) > 1)


def is_evaluated(block: Any, graph: Any) -> bool:
    """Whether Blender evaluates a data-block that follows an armature: it exists and is in the graph, in which a hidden
    curve is only as long as bones follow it, and is no armature that is idle."""
    if not is_alive(block) or not block.evaluated_get(graph).is_evaluated:
        return False
    is_of_armature = isinstance(block, bpy.types.Armature) or getattr(block, "type", "") == "ARMATURE"
    return not is_of_armature or not any(block in (rig.ob, rig.ob.data) for rig in idle())


def find_again() -> None:
    """Finds all armatures again after an undo step, which may have replaced them."""
    lost = {key: rig for key, rig in _rigs.items() if not is_alive(rig.ob)}
    by_key = {}
    if lost and values.KEYS_OUTLIVE_UNDO:  # names need not: the step may have renamed it
        by_key = {values.key_of(ob): ob for ob in bpy.data.objects}
    for key, rig in lost.items():
        rig.clear()
        del _rigs[key]
        rig.ob = by_key.get(key) or bpy.data.objects.get((rig.name, rig.library))
        if rig.ob is not None and rig.ob.type == "ARMATURE":
            rig.key = values.key_of(rig.ob)
            _rigs[rig.key] = rig
