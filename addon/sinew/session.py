"""The runtime side of bound meshes: native objects made from the .blend, never saved in it.

The .blend holds everything (`properties.py`); what stands here is a cache that is dropped on load
and undo and rebuilt when somebody edits mesh, weights or bones. Blender calls the handlers of a
render from another thread than the interface's, so one lock guards it all. Data-blocks are known
by key and name, not by reference: a reference dies when Blender replaces the block.
"""

import logging
import threading
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter

import bpy
import numpy as np

from . import anchor, blender_io, layers, mesh_edits, notice, posing
from .native import sinew_native
from .outputs import OUTPUTS, find_sinew_modifier

log = logging.getLogger("sinew")


@dataclass
class Timings:
    """Milliseconds of the last frame, by stage, without what has to be made once after an edit. Meshes are
    skinned together: `skin` is this one's part by its number of vertices."""

    pose: float = 0.0
    skin: float = 0.0
    write: float = 0.0

    @property
    def total(self):
        return self.pose + self.skin + self.write


@dataclass
class Character:
    """One bound mesh."""

    name: tuple  # of its object, and the path of its library or None
    layers: list = field(default_factory=list)  # of layers.Layer, as long as its settings ask for
    output: object = None  # one of outputs.OUTPUTS, or None: look
    watched: frozenset | None = None  # keys of the data-blocks whose edits count; None: look
    parent: tuple | None = None  # the object's, when its anchor was looked at
    parts: list = field(default_factory=list)  # of the last frame, as layers.py has them
    timings: Timings = field(default_factory=Timings)
    error: str = ""

    @property
    def deformer(self):
        """Of the mesh's first layer; None until it is first needed and after an edit."""
        return self.layers[0].deformer if self.layers else None

    def forget_layers(self):
        self.layers.clear()
        self.parts = []

    def forget(self):
        """Everything is to be made anew."""
        self.forget_layers()
        self.output = self.watched = None


_lock = threading.RLock()
_characters = {}  # key of the mesh object -> Character
_asleep = 0  # how many wish it, see asleep()
_applied = set()  # keys of bound objects whose modifier somebody has applied
_object_count = -1  # of the file when _characters was last gathered; -1: gather again


def configure(thread_count, instruction_set):
    """How skinning runs from now on. thread_count 0: all; instruction_set "auto" or a name of
    sinew_native.instruction_sets()."""
    with _lock:
        sinew_native.set_thread_count(thread_count)
        sinew_native.set_instruction_set(instruction_set)


@contextmanager
def asleep():
    """Handlers do nothing meanwhile: what Blender evaluates is half done, or Sinew itself has asked for it."""
    global _asleep
    _asleep += 1
    try:
        yield
    finally:
        _asleep -= 1


def forget_after_undo():
    """Also after redo. In Edit Mode only the edited mesh went back: how its shape came about before it was
    entered stays known."""
    with _lock:
        edited = {blender_io.key_of(ob): character(ob).parts for ob in bound_objects() if ob.data.is_editmode}
        forget()
        if edited:
            bound_objects()
        for key in edited.keys() & _characters.keys():
            _characters[key].parts = edited[key]


def forget():
    """Drop everything that is cached, as after load."""
    global _object_count
    with _lock:
        _characters.clear()
        _applied.clear()
        posing.forget()
        _object_count = -1


def forget_object(ob):
    """Drop what is cached of one mesh or armature."""
    global _object_count
    with _lock:
        _characters.pop(blender_io.key_of(ob), None)
        posing.forget_armature(ob)
        _object_count = -1


def character(ob):
    """The Character of a bound object, or None."""
    return _characters.get(blender_io.key_of(ob))


def report(ob, message):
    """Show a sentence with the object in the panel, until its next frame succeeds."""
    with _lock:
        bound_objects()
        entry = character(ob)
        if entry:
            entry.error = message
    log.error("%s: %s", ob.name, message)
    notice.show(f"{ob.name}: {message}")


def bound_objects():
    """All bound mesh objects of the file, whether a scene shows them or not."""
    objects = bpy.data.objects
    if len(objects) != _object_count:
        _gather()
    found = []
    for key, entry in _characters.items():
        ob = objects.get(entry.name)
        if ob is None or blender_io.key_of(ob) != key:
            _gather()  # renamed or replaced
            return [objects[entry.name] for entry in _characters.values()]
        found.append(ob)
    return found


def _receive_strangers(depsgraph):
    """A bound mesh that came while as many objects went is noticed here. A mesh that was given a copy of another
    one's modifier is not bound, and has that taken away, for it would move all vertices to the origin (3.4) or do
    nothing."""
    global _object_count
    for update in depsgraph.updates:
        if (isinstance(update.id, bpy.types.Object) and update.id.type == "MESH"
                and blender_io.key_of(update.id) not in _characters):
            ob = update.id.original
            if ob.sinew.is_bound:
                _object_count = -1
            elif ob.library is None and find_sinew_modifier(ob):
                OUTPUTS["MODIFIER"].remove(ob)
                if ob.override_library is None:  # else the library's comes back whenever the file is opened
                    notice.show(
                        f"{ob.name} has no Sinew modifier: each mesh needs one of its own, so bind it instead")


def _name(ob):
    return ob.name, ob.library.filepath if ob.library else None


def _gather():
    global _object_count
    old = dict(_characters)
    _characters.clear()
    for ob in bpy.data.objects:
        if ob.type == "MESH" and ob.sinew.is_bound:
            key = blender_io.key_of(ob)
            _characters[key] = old.get(key) or Character(_name(ob))
            _characters[key].name = _name(ob)
    _object_count = len(bpy.data.objects)


# --- what the handlers call -----------------------------------------------------------------------

def on_frame(scene, depsgraph):
    """A new frame: clips pose their armatures, then every bound mesh takes its shape."""
    with _lock:
        objects = _called_for(depsgraph)
        if objects:
            _note_edits(objects, depsgraph)
            _deform(objects, depsgraph, _pose_armatures(objects, scene, depsgraph))


def on_update(depsgraph):
    """Somebody changed something: meshes follow the bones as they stand. A clip does not step in,
    so a bone posed by hand keeps its pose until the next frame, as with keyframes."""
    with _lock:
        objects = _called_for(depsgraph)
        if not objects:
            return
        _note_edits(objects, depsgraph)
        changed = _changed(depsgraph)
        affected = [ob for ob in objects if changed and not changed.isdisjoint(
            map(blender_io.key_of, (ob, ob.data, *_armatures(ob),
                                    *(armature.data for armature in _armatures(ob)))))]
        if affected:
            _deform(affected, depsgraph, {})


def _called_for(depsgraph):
    """The bound objects, of which a handler has to see to something."""
    if _asleep:
        return []
    _receive_strangers(depsgraph)
    return bound_objects()


def refresh(ob):
    """A setting of this object or of its armature was changed: show it now."""
    context = bpy.context
    with _lock:
        if not ob.sinew.is_bound:
            return
        armature = ob.sinew.armature
        if armature is not None:
            armature.update_tag()  # else its evaluated copy keeps the setting's old value
        depsgraph = context.evaluated_depsgraph_get()
        objects = [other for other in bound_objects() if armature in _armatures(other)]
        _deform(objects, depsgraph, _pose_armatures(objects, context.scene, depsgraph))
        _evaluate(depsgraph)  # now, for later it would look like somebody's edit


def refresh_armature(armature):
    """A setting of the armature's clip was changed: show it now."""
    with _lock:
        for ob in bound_objects():
            if armature in _armatures(ob):
                return refresh(ob)


def refresh_all():
    """Bring every bound mesh to its armature as it stands, as after load."""
    with _lock:
        objects = bound_objects()
        if objects:
            _deform(objects, bpy.context.evaluated_depsgraph_get(), {})


# --- edits ----------------------------------------------------------------------------------------

def _armatures(ob):
    return [settings.armature for settings in ob.sinew.layers() if settings.armature is not None]


def _changed(depsgraph, edits_alone=False):
    """The keys of what somebody has edited, or animation moved, since the last evaluation. What Sinew's
    own handlers write is never among it. edits_alone: leave out objects of which but a driver or a setting
    was evaluated."""
    blocks = (bpy.types.Mesh, bpy.types.Armature, bpy.types.Key)
    keys = set()
    for update in depsgraph.updates:
        block = update.id
        if isinstance(block, blocks) or (
                isinstance(block, bpy.types.Object)
                and (not edits_alone or update.is_updated_geometry or update.is_updated_transform)):
            keys.add(blender_io.key_of(block))
    return keys


def _note_edits(objects, depsgraph):
    """Drops what is cached of meshes and bones that were edited."""
    changed = _changed(depsgraph, edits_alone=True)
    for ob in objects:
        entry = _characters[blender_io.key_of(ob)]
        if entry.watched is not None and changed.isdisjoint(entry.watched):
            continue
        mesh_key, keys = blender_io.key_of(ob.data), ob.data.shape_keys
        armatures = {blender_io.key_of(armature.data): armature for armature in _armatures(ob)}
        entry.watched = frozenset((blender_io.key_of(ob), mesh_key, *armatures))
        entry.output = None
        # An animated shape key tags its mesh too, but for its geometry alone: the moved shape arrives
        # through the modifier, and weights stay as they are.
        moved_by_keys = keys is not None and blender_io.key_of(keys) in changed
        if mesh_key in changed and (not moved_by_keys or any(
                update.is_updated_shading for update in depsgraph.updates
                if blender_io.key_of(update.id) == mesh_key)):
            _note_edited_mesh(ob, entry)
        for key in changed.intersection(armatures):
            posing.forget_if_edited(armatures[key])
            for layer, settings in zip(entry.layers, ob.sinew.layers()):
                if settings.armature == armatures[key]:
                    _follow_renamed_bones(ob, layer.bones_edited(settings.armature))


def _note_edited_mesh(ob, entry):
    """In Edit Mode nothing has happened yet: what is done there arrives in the mesh when it is left."""
    if entry.parts and ob.sinew.installed_output == "MESH":
        if ob.data.is_editmode:
            return
        mesh_edits.carry_back(ob, entry.parts)
    entry.forget_layers()


def _follow_renamed_bones(ob, names):
    """Blender renames vertex groups with their bones only where an Armature modifier on that armature
    is at work, which is not so on a bound mesh."""
    for old, new in names.items():
        group = ob.vertex_groups.get(old)
        if group is not None and new not in ob.vertex_groups:
            group.name = new


# --- shapes ---------------------------------------------------------------------------------------

@dataclass
class _Frame:
    """One mesh on its way through a frame."""

    ob: bpy.types.Object
    entry: Character
    parts: list  # as layers.py has them
    positions: np.ndarray | None = None  # (V, 3), where the shape goes
    in_place: bool = False  # they are the mesh's own memory
    jobs: list = field(default_factory=list)


def _pose_armatures(objects, scene, depsgraph):
    armatures = [ob.sinew.armature for ob in objects
                 if ob.sinew.source == "CLIP" and ob.sinew.armature is not None]
    return posing.pose_armatures(armatures, scene, depsgraph) if armatures else {}


def _deform(objects, depsgraph, posed):
    """An error in one mesh is kept with it and logged once; the others go on."""
    if _adapt(objects) and depsgraph.mode == "VIEWPORT":
        _evaluate(depsgraph)
    frames = _each(_prepare, [(ob, depsgraph, posed) for ob in objects])
    frames = _each(_take_target, [(frame,) for frame in frames])
    frames = _skin(frames)
    _each(_finish, [(frame,) for frame in frames])


def _each(stage, calls):
    """Calls stage for each mesh (or frame of one, the first argument). Returns what it returned where
    that was something."""
    results = []
    for arguments in calls:
        try:
            result = stage(*arguments)
            if result is not None:
                results.append(result)
        except Exception as error:  # noqa: BLE001 - whatever it is, playback goes on
            _keep_error(getattr(arguments[0], "ob", arguments[0]), error)
    return results


def _keep_error(ob, error):
    entry = _characters[blender_io.key_of(ob)]
    if str(error) != entry.error:
        log.error("%s is not deformed", ob.name, exc_info=error)
        notice.show(f"{ob.name} is not deformed: {error}")
    entry.error = str(error)
    entry.forget()


def _adapt(objects):
    """Whether some output had to be changed and has to be evaluated before it is of use."""
    changed = []
    for ob in objects:
        entry = _characters[blender_io.key_of(ob)]
        if entry.output is None:
            changed += _each(_look_at_output, [(ob, entry)])
    return any(changed)


def take_applied():
    """The bound objects whose modifier was found to be applied, once."""
    if not _applied:
        return []
    taken = [ob for ob in bound_objects() if blender_io.key_of(ob) in _applied]
    _applied.clear()
    return taken


def _look_at_output(ob, entry):
    output = OUTPUTS[ob.sinew.installed_output]
    if output.was_applied(ob):
        _applied.add(blender_io.key_of(ob))
        return False
    changed = output.adapt(ob)
    parent = ob.parent and ob.parent.name, ob.parent_type
    if not entry.layers or parent != entry.parent:
        changed |= anchor.adapt(ob)
        entry.parent = parent
    entry.output = output(ob)
    return changed


def _evaluate(depsgraph):
    """Evaluates what Sinew has changed, without being called for it."""
    with asleep():
        depsgraph.update()


def _prepare(ob, depsgraph, posed):
    """The mesh's layers as of this frame; nothing if it is not on show here."""
    evaluated = ob.evaluated_get(depsgraph)
    if not evaluated.is_evaluated or ob.data.is_editmode or not ob.sinew.shows_shape():
        return None
    start = perf_counter()
    entry = _characters[blender_io.key_of(ob)]
    output = entry.output
    if output is None:  # what is wrong with it has been said
        return None
    frame = _Frame(ob, entry, [])
    clips_milliseconds = making_milliseconds = 0.0
    for number, settings in enumerate(ob.sinew.layers()):
        armature = settings.armature
        if armature is None:
            raise RuntimeError("Its armature is gone: choose another one, or unbind")
        if number == len(entry.layers):
            entry.layers.append(layers.Layer())
        layer, clip_pose = entry.layers[number], None
        if posed:
            clip_pose, milliseconds = posed.get(blender_io.key_of(armature), (None, 0.0))
            clips_milliseconds += milliseconds
        change = layer.prepare(
            ob, settings, evaluated, armature.evaluated_get(depsgraph), clip_pose, number > 0,
            lambda: output.rest_positions(ob, evaluated), output.captures)
        making_milliseconds += layer.making_milliseconds
        frame.parts.append((layer, settings.method, change))
    entry.timings.pose = 1e3 * (perf_counter() - start) + clips_milliseconds - making_milliseconds
    return frame


def _take_target(frame):
    """Where the shape goes: into the mesh's own memory if Blender lets us, which saves a copy."""
    start = perf_counter()
    frame.positions = frame.entry.output.target(frame.ob)
    frame.in_place = frame.positions is not None
    if not frame.in_place:
        frame.positions = frame.entry.layers[0].positions
    frame.jobs = layers.jobs_of(frame.parts, frame.positions)
    frame.entry.timings.write = 1e3 * (perf_counter() - start)
    return frame


def _skin(frames):
    """All meshes in one parallel region; one by one if something is wrong with one. Returns the frames
    that were skinned."""
    start = perf_counter()
    try:
        sinew_native.skin_all([job for frame in frames for job in frame.jobs])
    except (ValueError, TypeError):
        def skin_alone(frame):
            for job in frame.jobs:
                sinew_native.skin_all([job])
            return frame

        frames = _each(skin_alone, [(frame,) for frame in frames])
    milliseconds = 1e3 * (perf_counter() - start)
    vertices = sum(len(frame.positions) for frame in frames)
    for frame in frames:
        frame.entry.timings.skin = milliseconds * len(frame.positions) / max(vertices, 1)
    return frames


def _finish(frame):
    start = perf_counter()
    shape = frame.positions
    layers.finish(frame.parts, shape)
    frame.entry.parts = frame.parts
    if frame.in_place:
        frame.entry.output.written(frame.ob, shape)
    else:
        frame.entry.output.write(frame.ob, shape)
    frame.entry.timings.write += 1e3 * (perf_counter() - start)
    frame.entry.error = ""
