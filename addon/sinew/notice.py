"""Tells the person at the screen, once, what a handler cannot report: a sentence in a small window."""

from functools import partial

import bpy

_said = set()  # sentences of this file


def show(sentence):
    """Safe to call while rendering, from any thread."""
    if bpy.app.background or sentence in _said:
        return
    _said.add(sentence)
    bpy.app.timers.register(partial(_show_now, sentence), first_interval=0.1)


def forget():
    """Another file: whatever happens there is to be said."""
    _said.clear()


def _show_now(sentence):
    manager = bpy.context.window_manager
    if manager is None or not manager.windows:
        return

    def draw(menu, _context):
        menu.layout.label(text=sentence)

    with bpy.context.temp_override(window=manager.windows[0]):
        manager.popup_menu(draw, title="Sinew", icon="ERROR")
