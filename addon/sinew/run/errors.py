"""Reports what goes wrong with a bound mesh: in the panel, in the log and once as a notice."""

import logging

import bpy

from ..feedback import notice
from . import characters, graph_copies, mail
from .character import Character
from .graph_copies import GraphCopy

log = logging.getLogger("sinew")


def keep(entry: Character, copy: GraphCopy, error: Exception) -> None:
    """Stores an error with its mesh and reports it once, until a frame succeeds or the error changes. What is known of
    the evaluated copy in which it occurred is discarded; other graphs keep theirs."""
    sentence = str(error)
    if sentence != entry.status.error:
        entry.status.error = sentence
        mail.post(_say, entry.name[0], error)
    entry.status.note_failure()
    graph_copies.discard(copy)


def _say(name: str, error: Exception) -> None:
    log.error("Sinew cannot deform %s", name, exc_info=error)
    notice.show(f"Sinew cannot deform {name}, so Blender's own modifier does: {error}")


def report(ob: bpy.types.Object, message: str) -> None:
    """Shows a sentence for the object in the panel until the object is edited."""
    characters.of(ob).status.error = message
    log.error("%s: %s", ob.name, message)
    notice.show(f"{ob.name}: {message}")
