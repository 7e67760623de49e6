"""Messages for the user: in a panel, or, for what a handler cannot report, once in a small pop-up."""

import textwrap
from functools import partial

import bpy

LETTER = 6.0  # pixels of a panel's width for each letter, at 100 % interface scale
MARGIN = 80  # pixels not available for text: icon, frames
_said = set()  # the sentences that were already shown for the open file


def draw_sentence(layout, context, sentence, is_error):
    """Draws a sentence in as many lines as the region's width requires."""
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
    """Shows a sentence in a pop-up, once per file. Safe to call while rendering, from any thread."""
    if bpy.app.background or sentence in _said:
        return
    _said.add(sentence)
    bpy.app.timers.register(partial(_show_now, sentence), first_interval=0.1)


def redraw():
    """Redraws all panels, whose content has changed."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager else ():
        for area in window.screen.areas:
            area.tag_redraw()


def forget():
    """Forgets which sentences were shown, since a different file was opened."""
    _said.clear()


def _show_now(sentence):
    manager = bpy.context.window_manager
    if manager is None or not manager.windows:
        return

    def draw(menu, _context):
        menu.layout.label(text=sentence)

    with bpy.context.temp_override(window=manager.windows[0]):
        manager.popup_menu(draw, title="Sinew", icon="ERROR")
