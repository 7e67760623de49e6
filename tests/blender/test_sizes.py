"""What is done while nobody works looks at each part of a file once, however large that is and however its parts follow
each other. The tests count how often things are asked, and stop what asks too often: no test measures time."""

import functools
import itertools
from contextlib import ExitStack, contextmanager
from types import SimpleNamespace

import bpy
import pytest

from characters import accelerate as bind
from characters import constrain, make_armature, make_mesh, pose
from helpers import addon_module, depsgraph, needs_memory, needs_rig_programs
from test_accelerated_rigs import accelerate, accelerating, evaluations, keep_live
from test_played import Cast, layer, recorded, states

pytestmark = needs_rig_programs
LINKS, RIGS = 60, 200  # which must not be walked along each path, of which there are 2 ** LINKS


@contextmanager
def at_most(most, where, name):
    """Counts the calls of a function, and fails at the first one that is too many."""
    function, numbers = getattr(where, name), itertools.count(1)

    def counted(*arguments, **named):
        is_too_often = next(numbers) > most
        assert not is_too_often, f"{name} was called more than {most} times"
        return function(*arguments, **named)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(where, name, counted)
        yield


def chain_of_links():
    """Returns the last of objects that follow the one before by two constraints each."""
    last = None
    for number in range(LINKS):
        ob = bpy.data.objects.new(f"link {number}", None)
        bpy.context.collection.objects.link(ob)
        for kind in ("COPY_LOCATION", "COPY_ROTATION") if last is not None else ():
            ob.constraints.new(kind).target = last
        last = ob
    return last


def bare_armatures(number):
    """Returns armatures of one bone each, which are not linked to any scene's collection."""
    first = bpy.data.armatures.new("One Bone")
    ob = bpy.data.objects.new("rig 0", first)
    bpy.context.collection.objects.link(ob)
    bpy.context.view_layer.objects.active = ob
    bpy.ops.object.mode_set(mode="EDIT")
    first.edit_bones.new("bone").tail = (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    found = [ob]
    for i in range(1, number):
        found.append(bpy.data.objects.new(f"rig {i}", first))
        bpy.context.collection.objects.link(found[-1])
    depsgraph().update()
    return found


def test_a_chain_of_objects_is_walked_once(fresh_scene):
    dependencies, followers = addon_module("blender.dependencies"), addon_module("played.followers")
    armature, last = make_armature(), chain_of_links()
    constrain(armature, "bone2", "COPY_LOCATION", target=last)
    with at_most(LINKS, dependencies, "followed_by"):
        assert followers.moving(armature, dependencies.outside_of(armature)) == []
    bpy.data.objects["link 0"].keyframe_insert("location")
    with at_most(LINKS, dependencies, "followed_by"):
        assert followers.moving(armature, dependencies.outside_of(armature)) == [last]


def test_a_circle_of_objects_stays_unless_one_of_them_moves(fresh_scene):
    followers, last = addon_module("played.followers"), chain_of_links()
    first = bpy.data.objects["link 0"]
    first.constraints.new("COPY_SCALE").target = last
    assert followers.not_still([first, last], None) == []
    bpy.data.objects["link 7"].keyframe_insert("location")
    assert followers.not_still([first, last], None) == [first, last]


@pytest.mark.parametrize("steps", ((1, 2), (-1, 1)), ids=("in a circle", "mutually"))
def test_rigs_that_follow_each_other_are_walked_once(fresh_scene, steps):
    names = "blender.dependencies", "played.rigs", "played.leading"
    dependencies, rigs, leading = map(addon_module, names)
    own = bare_armatures(RIGS)
    for i, ob in enumerate(own):
        for step in steps:
            constrain(ob, "bone", "COPY_ROTATION", target=own[(i + step) % RIGS], subtarget="bone")
    with at_most(RIGS, dependencies, "outside_of"):
        assert set(dependencies.chain(own[0])) == set(own)
    known = list(map(rigs.learn, own))
    with at_most(RIGS, dependencies, "outside_of"):
        assert len(leading.in_order(known)) == RIGS
    with at_most(2 * RIGS, dependencies, "outside_of"):  # for rigs, then for what else each of them follows
        assert rigs.moving(own) == []
    own[-1].keyframe_insert("location")
    assert rigs.moving(own) == own


def test_a_rig_comes_after_those_that_it_follows(fresh_scene):
    dependencies, own = addon_module("blender.dependencies"), bare_armatures(9)
    for i, ob in enumerate(own[:-1]):
        for leader in own[i + 1 :]:
            constrain(ob, "bone", "COPY_ROTATION", target=leader, subtarget="bone")
    assert dependencies.chain(own[0]) == own[::-1]
    assert dependencies.in_order([own[5], own[0]]) == own[::-1]


def test_each_of_many_leaders_is_asked_for_keyframes_once(fresh_scene):
    """Of rigs without keyframes, each of which follows all those before it."""
    rigs, own = addon_module("played.rigs"), bare_armatures(LINKS)
    for i, ob in enumerate(own):
        for leader in own[:i]:
            constrain(ob, "bone", "COPY_ROTATION", target=leader, subtarget="bone")
    graph, known = depsgraph(), [rigs.learn(ob) for ob in own]
    for i, rig in enumerate(known):
        rig.source.player = SimpleNamespace(program=object())
        rig.source.leaders = tuple(addon_module("played.leading").Leader(each, None, {}, {}) for each in known[:i])
    with at_most(LINKS, rigs, "evaluated_copy"), at_most(0, addon_module("blender.dependencies"), "outside_of"):
        assert rigs.is_without_keys(known[-1], graph)


class Asked(set):
    """A set that is not asked for each frame whether it is in it."""

    left = 10_000

    def __contains__(self, each):
        self.left -= 1
        assert self.left > 0, "each frame is looked at"
        return super().__contains__(each)


@pytest.fixture
def cast(fresh_scene, monkeypatch):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    cast = Cast(fresh_scene)
    keep_live(cast)
    return cast


@needs_memory
def test_frames_of_a_long_range_are_compared_without_looking_at_all(cast):
    cast.scene.frame_start, cast.scene.frame_end = 1, 1_048_574
    states().take_over_again(cast.scene, layer())
    while not cast.rig.source.is_proven:
        assert accelerating().step(cast.scene, layer(), evaluations())
    cast.rig.source.compared = Asked()
    addon_module("played.comparing").compare(cast.rig, cast.scene)
    states().keep_played(cast.scene, layer())
    assert len(cast.rig.source.compared) > 1
    cast.rig.source.compared = Asked()
    accelerate(cast)
    assert accelerating().compare_more(cast.scene, layer())
    assert len(cast.rig.source.compared) > 2 and not cast.rig.source.is_compared
    cast.play()


@pytest.mark.parametrize("compared", (set(), {3, 7, 200}, set(range(-4, 20)), set(range(-10, 100))))
def test_each_frame_that_was_not_compared_comes_once(compared):
    frames = range(-5, 25)
    found = list(addon_module("played.comparing").lacking(frames, compared))
    assert sorted(found) == [frame for frame in frames if frame not in compared]
    assert len(found) < 3 or any(
        list(addon_module("played.comparing").lacking(frames, compared)) != found for _ in range(20)
    )


def other_objects(count):
    for number in range(count):
        bpy.context.collection.objects.link(bpy.data.objects.new(f"other {number}", None))
    layer().update()


class Characters:
    """Several bound meshes with a rig each, which share one action."""

    def __init__(self, scene, count):
        self.scene, armature = scene, make_armature()
        for frame in (1, 10):
            pose(armature, frame, False)
        mesh = make_mesh(armature, False)
        self.armatures = [armature]
        for _ in range(count - 1):
            self.armatures.append(armature.copy())
            other = mesh.copy()
            other.data, other.modifiers[0].object = mesh.data.copy(), self.armatures[-1]
            for ob in (self.armatures[-1], other):
                bpy.context.collection.objects.link(ob)
            bind(other)
        bind(mesh)
        scene.frame_set(1)

    def tick(self):
        handlers = addon_module("played.frame_handlers")
        handlers._paused_until = 0.0
        handlers.take_over_again()

    def settle(self):
        """What the timer does until nothing is left to do."""
        handlers = addon_module("played.frame_handlers")
        self.tick()
        for _ in range(10 * len(self.armatures)):
            self.tick()
            if handlers._has_accelerated:
                break
        own = [recorded().learn(ob) for ob in self.armatures]
        assert all(rig.is_played for rig in own), [rig.reason for rig in own]
        for rig in own:
            rig.source.is_compared = True


@pytest.fixture
def characters(fresh_scene, monkeypatch):
    monkeypatch.setattr(accelerating(), "LEAST_WORK", 0)
    fresh_scene.frame_start, fresh_scene.frame_end = 1, 10
    found = Characters(fresh_scene, 30)
    found.settle()
    return found


@needs_memory
def test_a_timer_asks_nothing_of_a_file_at_rest(characters):
    other_objects(1000)
    characters.settle()
    names = ("played.accelerating", "_armatures"), ("run.characters", "_gather"), ("blender.dependencies", "outside_of")
    with ExitStack() as counting:
        for where, name in (*names, ("played.rigs", "get"), ("blender.armatures", "of_modifiers")):
            counting.enter_context(at_most(0, addon_module(where), name))
        for _ in range(2 * addon_module("played.frame_handlers").LOOKS_BEFORE_COMPARING):
            characters.tick()
            addon_module("main.handlers").look_into_the_mail()
            addon_module("ui.onion_skins").fill()


@needs_memory
@pytest.mark.parametrize("is_done", (False, True), ids=("accelerating", "comparing"))
def test_a_timer_pauses_for_longer_than_a_step_has_taken(characters, monkeypatch, is_done):
    """However long Blender takes to build relations, there is time for whoever works."""
    handlers, clock, steps = addon_module("played.frame_handlers"), [100.0], []

    def step(*_):
        steps.append(clock[0])
        clock[0] += 2.0
        return True

    monkeypatch.setattr(handlers, "perf_counter", lambda: clock[0])
    monkeypatch.setattr(handlers, "_accelerate", step)
    monkeypatch.setattr(handlers, "_paused_until", 0.0)
    monkeypatch.setattr(handlers, "_tried", handlers._tried)
    for _ in range(200):
        handlers._has_accelerated = is_done
        handlers.take_over_again()
        clock[0] += 1.0
    pause = 2.0 * (handlers.PAUSE_AFTER_COMPARING if is_done else handlers.PAUSE_AFTER_STEP)
    assert len(steps) > 2
    assert all(after - before >= 2.0 + pause for before, after in zip(steps, steps[1:]))


@needs_memory
def test_a_timer_looks_at_idle_rigs_no_further_after_an_edit(characters):
    other_objects(1000)
    characters.settle()
    bpy.data.objects["other 7"].location.x = 1
    layer().update()
    counted = ("blender.dependencies", "outside_of"), ("played.accelerating", "_work"), ("run.characters", "_gather")
    with ExitStack() as counting:
        counting.enter_context(at_most(1, accelerating(), "_armatures"))
        for where, name in counted:
            counting.enter_context(at_most(0, addon_module(where), name))
        for _ in range(5):
            characters.tick()


@needs_memory
def test_what_a_file_uses_is_found_once_for_all_rigs(characters, monkeypatch):
    """As Blender builds relations, which hands back all of them."""
    dependencies, number = addon_module("blender.dependencies"), itertools.count()
    found = dependencies.Users.uses.func

    def uses(users):
        next(number)
        return found(users)

    patched = functools.cached_property(uses)
    patched.__set_name__(dependencies.Users, "uses")
    monkeypatch.setattr(dependencies.Users, "uses", patched)
    marker = bpy.data.objects.new("Marker", None)
    bpy.context.collection.objects.link(marker)
    layer().update()
    assert not any(recorded().learn(ob).is_played for ob in characters.armatures)
    characters.tick()
    assert all(recorded().learn(ob).is_played for ob in characters.armatures)
    assert next(number) <= 4


def test_a_full_store_drops_as_much_as_it_gets(monkeypatch):
    """However much it holds."""
    records = addon_module("played.records")

    class Moment:
        nbytes = 1

    store = records.Store(10_000)
    record = records.Record(store)
    for frame in range(10_000):
        record.put(frame, Moment())
    with at_most(200, records.Record, "drop_frame"):  # once for its own frame, once for the oldest
        for frame in range(10_000, 10_100):
            record.put(frame, Moment())
    assert store.used == 10_000 and record.runs() == [(100, 10_099)]
