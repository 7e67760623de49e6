"""Blender's flag that forbids Python to write, which a render may leave up."""

import threading

import bpy
import pytest

from helpers import addon_module, depsgraph


@pytest.fixture
def stuck():
    """Whether the flag is up, though nothing is drawn: a property's `get` began in another thread while Blender had put
    the flag up, here to call a poll function, and ended after that."""
    has_begun, may_end = threading.Event(), threading.Event()

    def get(_manager):
        has_begun.set()
        may_end.wait(5)
        return False

    manager = bpy.context.window_manager
    thread = threading.Thread(target=getattr, args=(manager, "slow_for_a_test"))

    class Polled(bpy.types.Operator):
        bl_idname = "wm.polled_for_a_test"
        bl_label = "Polled"

        @classmethod
        def poll(cls, _context):
            if not has_begun.is_set():
                thread.start()
                assert has_begun.wait(5)
            return False

    bpy.types.WindowManager.slow_for_a_test = bpy.props.BoolProperty(get=get)
    bpy.utils.register_class(Polled)
    assert not bpy.ops.wm.polled_for_a_test.poll()
    may_end.set()
    thread.join()
    is_stuck = not addon_module("main.write_lock").may_write()
    yield is_stuck
    addon_module("main.write_lock").look()
    bpy.utils.unregister_class(Polled)
    del bpy.types.WindowManager.slow_for_a_test


def write():
    bpy.context.scene.frame_step = 2


@pytest.fixture
def lock(stuck):
    if not stuck:
        pytest.skip("this Blender takes its flag down by itself")
    lock = addon_module("main.write_lock")
    with pytest.raises(AttributeError, match="not allowed"):
        write()
    assert not lock.may_write()
    return lock


def test_a_flag_that_stays_is_taken_down(lock):
    lock.look_again_and_again()
    assert lock.may_write()
    write()


@pytest.mark.parametrize("handler", ("on_depsgraph_update", "before_frame"))
def test_before_the_handlers_of_others(lock, handler):
    """Those that come after Sinew's."""
    getattr(addon_module("main.handlers"), handler)(bpy.context.scene, depsgraph())
    assert lock.may_write()
    write()


def test_another_thread_leaves_it(lock):
    handlers = addon_module("main.handlers")
    scene, graph = bpy.context.scene, depsgraph()
    thread = threading.Thread(target=lambda: handlers.on_depsgraph_update(scene, graph))
    thread.start()
    thread.join()
    assert not lock.may_write()


def test_a_flag_that_is_down_stays_down():
    lock = addon_module("main.write_lock")
    lock.look()
    assert lock.may_write()
    write()


def test_while_a_render_runs_it_is_looked_after_all_the_time(monkeypatch):
    lock = addon_module("main.write_lock")
    assert bpy.app.timers.is_registered(lock.look_again_and_again) == lock.MAY_STAY
    assert not lock.is_rendering() and lock.look_again_and_again() > 0
    monkeypatch.setattr(lock, "is_rendering", lambda: True)
    assert lock.look_again_and_again() == 0
