"""Sentences for the person at the screen: in a panel, or, for what a handler cannot report, once in a small
window."""

import textwrap
from functools import partial

import bpy

LETTER = 6.0  # pixels of a panel's width for each letter, at 100 % interface scale
MARGIN = 80  # pixels that are not for letters: icon, frames
_said = set()  # sentences of this file


def draw_sentence(layout, context, sentence, is_error):
    """In as many lines as the region's width asks for."""
    column = layout.column(align=True)
    column.alert = is_error
    width = 1000  # there is no region without a window
    if context.region:
        width = context.region.width / context.preferences.system.ui_scale
    icon = "ERROR" if is_error else "INFO"
    for line in textwrap.wrap(sentence, max(int((width - MARGIN) / LETTER), 15)):
        column.label(text=line, icon=icon)
        icon = "BLANK1"


def show(sentence):
    """Safe to call while rendering, from any thread."""
    if bpy.app.background or sentence in _said:
        return
    _said.add(sentence)
    bpy.app.timers.register(partial(_show_now, sentence), first_interval=0.1)


def redraw():
    """All panels, which show something else now."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager else ():
        for area in window.screen.areas:
            area.tag_redraw()


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
