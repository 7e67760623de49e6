"""Finds the stencils of the tails of bound meshes, in the main thread, while Blender evaluates their modifiers as ever.

In a window this is done bit by bit, while nothing is played, rendered or dragged. What it needs is in one hidden scene
from the first bit to the last: to add one for each would have Blender build all relations again, and hand back all
rigs. It is put away before the file is saved and before undo. What was found is compared with Blender on the shape that
is shown then. In the background it is done at once, as soon as so many frames were changed that it would have paid.
"""

import logging
from time import perf_counter
from typing import Any

import bpy
import numpy as np

from ..blender import materials, meshes, nodes, values
from ..feedback import notice
from ..host import evaluations
from ..plan import canvas_survey, tails, wiring
from ..plan.situation import Tail
from ..run import characters, mail, planning
from . import probing

log = logging.getLogger("sinew")
SECONDS_AT_ONCE = 0.1  # of one bit
SECONDS_BETWEEN_BITS = 0.05
SECONDS_OF_REST = 1.0  # without an edit, before a search goes on
FRAMES_AHEAD = 24  # in the background
MOST_EVALUATIONS = 256
MOST_SECONDS = 20.0  # of all evaluations; a search that would take longer waits until somebody asks for it
IS_READ = bpy.app.background  # nobody looks, so whoever changes frames reads what a last Subdivision makes
MODES = {"OBJECT", "POSE"}


class Search:
    """The search for the stencils of one mesh's tail."""

    def __init__(self, ob: bpy.types.Object, scene: bpy.types.Scene, is_render: bool = False) -> None:
        """ob: original, of a character whose plan lacks stencils; is_render: those of renders, not of viewports."""
        self.key, self.names, self.is_render = values.key_of(ob), characters.of(ob).plan.run.tail, is_render
        self._digest, self._simplification = tails.digest(ob, self.names), canvas_survey.simplification()
        tail = [ob.modifiers[name] for name in self.names]
        self._is_alike = tails.is_alike_in_renders(tail, scene.render)
        self._canvas = probing.Canvas(ob, tail, scene.render, ob.data.copy, is_render)
        what = f"{' and '.join(self.names)} of {ob.name}"
        limits = (MOST_EVALUATIONS, MOST_SECONDS) if self.key not in _asked_for else (len(ob.data.vertices), np.inf)
        self._steps = probing.steps(self._canvas, what, *limits)
        self.says = f"finding the weights of {what}"

    def is_current(self, ob: bpy.types.Object) -> bool:
        """Whether the object is still as it was when the search began."""
        return (
            characters.of(ob).plan.lacks_stencils[self.is_render]
            and self._digest == tails.digest(ob, self.names)
            and self._simplification == canvas_survey.simplification()
        )

    def go_on(self, ob: bpy.types.Object, seconds: float) -> Tail | None:
        """Goes on for some seconds. Returns what is known then; None if it is not done. Raises probing.NotFound."""
        end = perf_counter() + seconds
        try:
            while perf_counter() < end:
                _share, self.says = next(self._steps)
            return None
        except StopIteration as done:
            self._compare(ob, done.value)
            return Tail(self.names, self._digest, self._simplification, self._with(ob, done.value))

    def put_away(self) -> None:
        """Removes from the file what the search needs. It may go on."""
        self._canvas.close()

    def _with(self, ob: bpy.types.Object, found: Any) -> tuple[Any, Any]:
        """Returns the stencils for viewports and renders: what was found, and what else is known of the same tail."""
        if self._is_alike:
            return found, found
        known = characters.of(ob).planning.tail
        is_same = known is not None and (known.names, known.digest) == (self.names, self._digest)
        viewport, render = known.stencils if known is not None and is_same else (None, None)
        return (viewport, found) if self.is_render else (found, render)

    def _compare(self, ob: bpy.types.Object, stencils: Any) -> None:
        """Compares stencils with Blender on the shape that Sinew has last given to the object. Raises
        probing.NotFound."""
        hook = wiring.find_hook(ob.evaluated_get(bpy.context.evaluated_depsgraph_get()))
        mesh = hook and wiring.source_of(hook)
        attribute = mesh and meshes.point_attribute(mesh, nodes.POSITION_ATTRIBUTE)
        if attribute is not None and len(attribute.data) == stencils.vertex_count:
            shape = meshes.read_attribute(attribute)
            if np.isfinite(shape).all():
                probing.compare(stencils, shape, self._canvas.result(shape))


_search: Search | None = None
_told: set[int] = set()  # keys of the objects of which was said that renders do without stencils
_asked_for: set[int] = set()  # keys of the objects whose stencils somebody wants however long it takes
_may_be_followed = True
_edited = 0.0  # when something was
_evaluates_anew = False  # on each frame, while something is rendered
_is_at_it = False  # what is evaluated is a search's
# In the background: (key of an object, whether they were rendered) -> frames without the stencils that it lacks
_frames: dict[tuple[int, bool], int] = {}


def says(ob: bpy.types.Object) -> str:
    """Returns what is done for the tail of a bound mesh, or why it has no stencils, a clause; "" for nothing."""
    if _search is not None and _search.key == values.key_of(ob):
        return _search.says
    entry = characters.of(ob)
    return _in_vain(entry) if any(entry.plan.lacks_stencils) else ""


def _in_vain(entry: Any) -> str:
    what, reason, _is_too_long = entry.planning.sought
    return reason if what == _version(entry) else ""


def takes_long(ob: bpy.types.Object) -> bool:
    """Whether the stencils of a bound mesh were not found because it would take too long."""
    entry = characters.of(ob)
    return bool(_in_vain(entry)) and entry.planning.sought[-1]


def take_time(ob: bpy.types.Object) -> None:
    """Has the stencils of a bound mesh found, however long it takes."""
    _asked_for.add(values.key_of(ob))
    characters.of(ob).planning.sought = None, "", False


def _version(entry: Any) -> tuple[int, int, tuple[str, ...]]:
    """Returns what changes when the object, its plan or its mesh was edited."""
    return entry.planning.looks, entry.edition, entry.plan.run.tail


def _lacking(is_render: bool = False) -> list[bpy.types.Object]:
    """Returns the bound meshes that lack stencils for viewports or for renders, except where they were searched in
    vain."""
    known = ((ob, characters.of(ob)) for ob in _with_tails())
    return [
        ob for ob, entry in known if entry.plan.lacks_stencils[is_render] and entry.is_deforming and not _in_vain(entry)
    ]


def _with_tails() -> list[bpy.types.Object]:
    """Returns the bound meshes that may have a tail."""
    found = {key: characters.find(key) for key in tuple(planning.with_tails)}
    planning.with_tails.difference_update(key for key, ob in found.items() if ob is None)
    return [ob for ob in found.values() if ob is not None]


def note_edit() -> None:
    """Has a search wait until nothing was edited for a while, and then see which meshes others follow."""
    global _may_be_followed, _edited
    if not _is_at_it:
        _may_be_followed, _edited = True, perf_counter()


def _see_surroundings() -> bool:
    """Hands over to the plans, after an edit, whether others follow the meshes, and whether materials keep them from
    having a tail. Returns whether any plan depends on a change."""
    global _may_be_followed
    if not _may_be_followed:
        return False
    _may_be_followed, has_changed = False, False
    objects = _with_tails()
    followed = tails.followed(objects)
    for ob in objects:
        own = characters.of(ob).planning
        generated_in = materials.user_of_generated(ob) or "" if ob.data.shape_keys is not None else ""
        is_followed = ob in followed or IS_READ
        if (own.is_followed, own.generated_in) != (is_followed, generated_in):
            own.is_followed, own.generated_in = is_followed, generated_in
            mail.post(mail.REWIRE, values.key_of(ob))
            has_changed = True
    return has_changed


def is_running() -> bool:
    return _search is not None


def put_away() -> None:
    """Removes from the file what a search needs, until that goes on."""
    if _search is not None:
        mail.once_handlers_are_done(_search.put_away)


def _end() -> None:
    global _search
    put_away()
    _search = None


def look() -> None:
    """Goes on with a search, or begins one. For a timer, in a window."""
    global _search
    context = bpy.context
    if not planning.with_tails:
        _end()
    if not planning.with_tails or _search is None and not _may_be_followed and not _lacking() or _is_busy(context):
        return
    if _see_surroundings():
        return
    ob = characters.find(_search.key) if _search is not None else None
    if _search is None or ob is None or not _search.is_current(ob):
        _end()
        ob = next(iter(_lacking()), None)
        _search = Search(ob, context.scene) if ob is not None else None
    if _search is not None:
        if _bit(_search, ob, SECONDS_AT_ONCE):
            _end()
        notice.redraw()


def _is_busy(context: bpy.types.Context) -> bool:
    windows = context.window_manager.windows
    return (
        context.mode not in MODES
        or perf_counter() - _edited < SECONDS_OF_REST
        or any(window.screen.is_animation_playing for window in windows)
        or evaluations.is_job_running()
    )


def note_render(scene: bpy.types.Scene, begins: bool) -> None:
    """Notes that a render begins or has ended. Without Persistent Data, Blender has a new graph for each of its frames,
    and evaluates all of the canvases anew, which takes as long as without them."""
    global _evaluates_anew
    _evaluates_anew = begins and not scene.render.use_persistent_data
    if _evaluates_anew and bpy.app.background:
        for ob in _lacking(True):
            if values.key_of(ob) not in _told:
                _told.add(values.key_of(ob))
                _say(ob, "evaluated by Blender in each frame; in animations, Persistent Data lets Sinew compute it")


def note_frame(is_render: bool) -> None:
    """Has the stencils that are lacking found, in the background, once enough frames were changed without them.
    is_render: the frame is evaluated as renders are."""
    if not planning.with_tails or _evaluates_anew and is_render or _see_surroundings():
        return
    for ob in _lacking(is_render):
        key = values.key_of(ob), is_render
        _frames[key] = _frames.get(key, 0) + 1
        if _frames[key] >= FRAMES_AHEAD:
            search = Search(ob, bpy.context.scene, is_render)
            _bit(search, ob, float("inf"))
            search.put_away()
            reason = _in_vain(characters.of(ob))
            _say(ob, f"evaluated by Blender, since {reason}" if reason else "computed natively from the next frame on")


def _say(ob: bpy.types.Object, what: str) -> None:
    print(f"Sinew: {' and '.join(characters.of(ob).plan.run.tail)} of {ob.name}: {what}", flush=True)


def _bit(search: Search, ob: bpy.types.Object, seconds: float) -> bool:
    """Goes on with a search. Returns whether it has ended."""
    global _is_at_it
    entry = characters.of(ob)
    _is_at_it = True
    try:
        found = search.go_on(ob, seconds)
        if found is None:
            return False
        entry.planning.tail = found
        mail.post(mail.REWIRE, search.key)
    except Exception as error:
        if not isinstance(error, probing.NotFound):
            log.exception("the weights of %s could not be found", " and ".join(search.names))
        reason = str(error) or type(error).__name__
        entry.planning.sought = _version(entry), reason, isinstance(error, probing.TooLong)
    finally:
        _is_at_it = False
    _asked_for.discard(search.key)
    return True


def forget() -> None:
    """Ends the search, as another file is opened."""
    global _may_be_followed
    _end()
    _may_be_followed = True
    _frames.clear()
    if not values.KEYS_OUTLIVE_UNDO:
        _asked_for.clear()
