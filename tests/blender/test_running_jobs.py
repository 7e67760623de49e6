"""While Blender renders or bakes in another thread, nobody takes keyframes away from the originals, as relations
without them need for a moment: that thread could see it. What asks for it does without, and rigs are native later."""

import bpy
import pytest

from helpers import addon_module, needs_memory, needs_rig_programs, select
from test_accelerated_rigs import accelerate, cast_of_small_rigs, wait
from test_played import layer, recorded, states
from test_played_who import both

pytestmark = [needs_rig_programs, needs_memory]


@pytest.fixture
def cast(monkeypatch):
    cast = cast_of_small_rigs(monkeypatch)
    select(cast.played[0])
    return cast


class Job:
    """Says that something is rendered, and fails if an original loses its keyframes meanwhile."""

    def __init__(self, monkeypatch):
        self.patch = monkeypatch.context()

    def __enter__(self):
        patch = self.patch.__enter__()
        patch.setattr(addon_module("host.evaluations"), "is_job_running", lambda: True)

        def without_animation(_rebuilding, block):
            raise AssertionError(f"a render would see {block.name} without its keyframes")

        patch.setattr(addon_module("host.relations").Rebuilding, "without_animation", without_animation)

    def __exit__(self, *error):
        self.patch.__exit__(*error)


def hand_back(cast):
    assert bpy.ops.object.sinew_leave_to_blender() == {"FINISHED"}


def hand_back_the_other(cast):
    states().hand_back([recorded().learn(cast.live[0])], cast.scene, layer())


def take_over_the_other(cast):
    select(cast.live[0])
    with pytest.raises(RuntimeError, match="Rig.001 waits until Blender has rendered or baked"):
        bpy.ops.object.sinew_record()


def record(cast):
    with pytest.raises(RuntimeError, match="waits until Blender has rendered or baked"):
        bpy.ops.object.sinew_record()


def measure(cast):
    assert bpy.ops.object.sinew_measure() == {"FINISHED"}


def switch_off_and_on(cast):
    cast.scene.sinew_accelerates_rigs = False
    cast.assert_same()
    cast.scene.sinew_accelerates_rigs = True


def compare(cast):
    cast.rig.source.compared.clear()
    addon_module("played.comparing").compare(cast.rig, cast.scene)
    states().keep_played(cast.scene, layer())
    assert not cast.rig.source.compared


@pytest.mark.parametrize(
    "ask", (hand_back, hand_back_the_other, take_over_the_other, record, measure, switch_off_and_on, compare)
)
def test_keyframes_stay_where_they_are(cast, monkeypatch, ask):
    accelerate(cast)
    cast.play([3])
    with Job(monkeypatch):
        ask(cast)
        cast.play([4, 5, 3])
    cast.rig.ob.sinew_accelerates_rig = True
    states().take_over_again(cast.scene, layer())
    accelerate_or_take_over(cast)
    cast.play([6, 2])
    assert all(each[0].animation_data.action is not None for each in both(cast))


def accelerate_or_take_over(cast):
    wait(cast)
    assert cast.rig.is_played, cast.rig.reason


def test_the_timer_tries_again_after_it(cast, monkeypatch):
    """Though nothing was evaluated since."""
    handlers = addon_module("played.frame_handlers")
    accelerate(cast)
    with Job(monkeypatch):
        states().keep_played(cast.scene, layer())
        assert not cast.rig.is_played
    handlers._tried = addon_module("played.playing").evaluation_count(), False
    with Job(monkeypatch):
        handlers.take_over_again()
    handlers.take_over_again()
    assert cast.rig.is_played
