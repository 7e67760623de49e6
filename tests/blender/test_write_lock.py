"""Blender's flag that forbids Python to write, which a render may leave behind."""

import threading

import bpy
import pytest

from helpers import addon_module


@pytest.fixture
def stuck():
    """Whether the flag is up, though nothing is drawn: a property's `get` began in another thread while Blender had put
    the flag up, here to call a poll function, and ended after that."""
    if bpy.app.version[:2] == (5, 0):
        pytest.skip("in 5.0 the flag would stay up")
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
    is_stuck = not addon_module("session.write_lock").may_write()
    yield is_stuck
    addon_module("session.write_lock").release()
    bpy.utils.unregister_class(Polled)
    del bpy.types.WindowManager.slow_for_a_test


def write():
    bpy.context.scene.frame_step = 2


def test_a_flag_that_stays_is_taken_down(stuck):
    lock = addon_module("session.write_lock")
    if not stuck:
        pytest.skip("this Blender takes its flag down by itself")
    with pytest.raises(AttributeError, match="not allowed"):
        write()
    lock.after_render()
    addon_module("session.handlers").look_into_the_mail()
    assert lock.may_write()
    write()


def test_a_flag_that_is_down_stays_down():
    lock = addon_module("session.write_lock")
    lock.release()
    assert lock.may_write()
    write()


def test_nothing_is_done_but_after_a_render(stuck, monkeypatch):
    lock = addon_module("session.write_lock")
    if not stuck:
        pytest.skip("this Blender takes its flag down by itself")
    monkeypatch.setattr(lock, "_looks", 0)
    lock.look()
    assert not lock.may_write()
    lock.release()
    assert lock.may_write()
