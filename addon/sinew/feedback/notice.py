"""Shows messages to the user: in a panel, or once in a pop-up if they come from a handler, which cannot report."""

import textwrap
from functools import partial

import bpy

LETTER = 6.0  # assumed width of a letter in pixels, at 100 % interface scale
MARGIN = 80  # pixels of a panel's width that are not available for text: icon, borders
# The words of ours with which clauses begin; others are names.
OPENINGS = {"an", "bones", "curves", "frame", "it", "keyframes", "on", "something", "the", "what"}
_said: set[str] = set()  # the sentences already shown for the open file


def draw_sentence(
    layout: bpy.types.UILayout, context: bpy.types.Context, sentence: str, is_error: bool, width: float = 0
) -> None:
    """Draws a clause as a sentence, wrapped to a width in pixels at 100 % interface scale; 0: to the width of the
    region."""
    column = layout.column(align=True)
    column.alert = is_error
    if not width and context.region:
        width = context.region.width / context.preferences.system.ui_scale
    icon = "ERROR" if is_error else "INFO"
    width = width or 1000  # without a window there is no region
    for line in textwrap.wrap(as_sentence(sentence), max(int((width - MARGIN) / LETTER), 15)):
        column.label(text=line, icon=icon)
        icon = "BLANK1"


def as_sentence(clause: str) -> str:
    """Returns a clause as a sentence for people. A name of the user's with which it begins stays as it is."""
    return clause[0].upper() + clause[1:] if clause.partition(" ")[0] in OPENINGS else clause


def show(sentence: str) -> None:
    """Shows a sentence in a pop-up, once per file. Safe to call while rendering, from any thread."""
    if bpy.app.background or sentence in _said:
        return
    _said.add(sentence)
    bpy.app.timers.register(partial(_show_now, sentence), first_interval=0.1)


def redraw() -> None:
    """Redraws all panels, because their content has changed."""
    manager = bpy.context.window_manager
    for window in manager.windows if manager else ():
        for area in window.screen.areas:
            area.tag_redraw()


def forget() -> None:
    """Forgets which sentences were shown, because another file was opened."""
    _said.clear()


def _show_now(sentence):
    manager = bpy.context.window_manager
    if manager is None or not manager.windows:
        return

    def draw(menu, _context):
        menu.layout.label(text=sentence)

    with bpy.context.temp_override(window=manager.windows[0]):
        manager.popup_menu(draw, title="Sinew", icon="ERROR")
