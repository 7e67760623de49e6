"""Blender's callbacks. Deforming needs none of them: they see to edits and to the deformed copies of the output Mesh,
and pose the armatures of clips before a frame is evaluated."""

import logging
import threading
from dataclasses import dataclass, field

import bpy
from bpy.app.handlers import persistent

from ..blender import meshes, nodes, values
from ..clips import posing
from ..clips.clip_store import has_poses
from ..feedback import notice
from ..host import places
from ..install import bind, deformed_copies, deformed_copy, mending, old_files, precomputing, shared_group
from ..plan import ways, wiring
from ..run import characters, mail
from . import callbacks, exporters, whole_frames, write_lock

log = logging.getLogger("sinew")
SECONDS_BETWEEN_LOOKS = 0.3  # into the mail, in a window
SECONDS_WHILE_ASKED = 0.005  # likewise, while a render asks for poses
SECONDS_TO_WAIT = 5.0  # at most, for the main thread
HAS_EVENT_LOOP = not bpy.app.background
_seen_gathering = None  # of bound meshes
_said = set()  # errors of the timer
_bone_names = {}  # key of an armature's data -> those of its bones
_is_file_unknown = True  # the add-on was switched on in an open file, of which registering may see nothing


@persistent
def before_frame(scene, *_):
    write_lock.look()
    take_over_open_file()
    if characters.may_follow_clips():
        _in_main_thread(_pose, scene)


@persistent
def after_frame(scene, depsgraph):
    if characters.may_follow_clips():
        _in_main_thread(_pose_anew, scene, depsgraph)
    exporters.tidy(depsgraph)
    if not _is_main_thread():
        return
    copied = characters.with_copy()
    if copied:
        deformed_copies.follow(copied, depsgraph, {values.key_of(update.id) for update in depsgraph.updates})
    mail.deliver()


def _pose(scene):
    posing.pose_armatures(_clip_armatures(), scene)


def _pose_anew(scene, depsgraph):
    posing.pose_anew(_clip_armatures(), scene, depsgraph)


def _is_main_thread():
    return threading.current_thread() is threading.main_thread()


def _in_main_thread(function, *arguments):
    """A render evaluates in a thread of its own, while somebody may edit what poses are written to."""
    if _is_main_thread() or not HAS_EVENT_LOOP or not mail.ask(SECONDS_TO_WAIT, function, *arguments):
        # If the main thread does not come to it, it waits for this thread: as when the file is closed.
        function(*arguments)


@persistent
def on_depsgraph_update(_scene, depsgraph):
    write_lock.look()
    _put_handlers_back()
    take_over_open_file()
    edits = Edits.of(depsgraph)
    receive_strangers(edits)
    if edits.of_collections:
        characters.count_again()
    affected = characters.made_of(edits.keys)
    has_gathered, has_other_bones = _has_gathered(), _has_other_bones(edits.armatures)
    if has_gathered:
        shared_group.follow()
    may_lack = has_gathered or has_other_bones
    objects = characters.known() if may_lack or edits.of_collections else affected.values()
    _note_edits(objects, affected, edits, may_lack)
    for armature in edits.armatures:
        posing.forget_if_edited(armature)
    copied = characters.with_copy()
    if copied:
        deformed_copies.follow(copied, depsgraph, edits.keys)
    if has_gathered or edits.of_collections:
        deformed_copies.tidy(copied, depsgraph, has_gathered)
    exporters.tidy(depsgraph)
    mail.deliver()


@persistent
def on_load(*_):
    global _is_file_unknown
    _is_file_unknown = True
    for forget_more in (notice.forget, posing.forget_what_was_said, whole_frames.forget, precomputing.forget):
        forget_more()
    callbacks.another_file()
    forget()
    take_over_open_file()


@persistent
def before_save(*_):
    shared_group.see_to()


@persistent
def on_undo_redo(*_):
    forget(is_undo=True)


def forget(is_undo=False):
    _bone_names.clear()
    characters.forget(is_undo)
    deformed_copies.forget()
    posing.forget()


@dataclass
class Edits:
    """What somebody has edited, or animation moved, since the last evaluation."""

    of_collections: bool  # objects may have come or gone, or are shown or hidden
    keys: set = field(default_factory=set)  # of all data-blocks
    meshes: list = field(default_factory=list)  # original mesh objects, and whether their geometry is another one
    armatures: list = field(default_factory=list)  # original data

    @classmethod
    def of(cls, depsgraph):
        edits = cls(depsgraph.id_type_updated("COLLECTION"))
        for update in depsgraph.updates:
            block = update.id
            edits.keys.add(values.key_of(block))
            if isinstance(block, bpy.types.Armature):  # a pose says so too
                edits.armatures.append(block.original)
            elif isinstance(block, bpy.types.Object) and block.type == "MESH":
                edits.meshes.append((block.original, update.is_updated_geometry))
        return edits


def _clip_armatures():
    """Those of bound objects whose bones imported poses move."""
    found = dict.fromkeys(ob.sinew.armature for ob in characters.by_clip() if ob.sinew.source == "CLIP")
    return [armature for armature in found if armature is not None and has_poses(armature.data)]


def _has_gathered():
    """Whether bound meshes have come or gone since the last update."""
    global _seen_gathering
    last, _seen_gathering = _seen_gathering, characters.gathering()
    return last != _seen_gathering


def _has_other_bones(armatures):
    """Whether an armature has others than when it was last updated."""
    has_others = False
    for data in armatures:
        key, names = values.key_of(data), data.bones.keys()
        has_others |= _bone_names.get(key) != names
        _bone_names[key] = names
    return has_others


def _note_edits(objects, affected, edits, may_lack):
    """A modifier may have been applied or removed. affected: {key: object} of those with a part that was edited;
    may_lack: what a driver waits for may have gone, or not be all."""
    for ob in objects:
        key = values.key_of(ob)
        is_edited = key in edits.keys
        if is_edited:
            if bind.release_if_undone(ob):
                continue
            characters.see(ob)
        entry = characters.of(ob)
        if entry.way.kind == ways.BLENDER and key in affected:
            sharer_count = entry.planning.sharer_count  # others see to that: counting is a walk through the file
            entry.look_again()
            entry.planning.sharer_count = sharer_count
            entry.look(ob)
        elif entry.is_wired and (
            entry.planning.should_revive(ob)
            or (may_lack or is_edited and edits.of_collections)
            and not entry.plan.waits_for_targets(ob)
        ):
            mail.post(bind.rewire, key)


def receive_strangers(edits):
    """A bound mesh that came while as many objects went is noticed here, and one that another object was given as well.
    A mesh that was given a copy of another one's modifier is not bound, and has that taken away."""
    for ob, is_reshaped in edits.meshes:
        if is_reshaped:  # it may have been given the mesh of a bound one
            characters.see_mesh(ob.data, edits.of_collections)
        if ob.sinew.copy_of is not None:
            deformed_copy.let_go_of_duplicate(ob)
        if ob.sinew.is_bound:
            if characters.character(ob) is None:
                characters.gather_again()
        elif ob.library is None and ob.override_library is None and nodes.find_modifier(ob):
            nodes.remove_modifiers(ob)
            notice.show(
                f"{ob.name} was given the modifiers of a mesh that is bound to Sinew: Blender's own modifiers "
                "deform it until you bind it too"
            )
        elif _has_stray_attribute(ob.data):
            mending.remove_attribute(ob)


def _has_stray_attribute(mesh):
    """Of a bound mesh that was joined to this one."""
    return (
        mesh.library is None
        and not mesh.is_editmode
        and meshes.point_attribute(mesh, nodes.POSITION_ATTRIBUTE) is not None
    )


def look_into_the_mail():
    """A timer, which Blender would drop if it raised."""
    for look in (_put_handlers_back, take_over_open_file, mail.deliver):
        try:
            look()
        except Exception as error:
            if str(error) not in _said:
                _said.add(str(error))
                log.exception("something could not be seen to")
    return SECONDS_WHILE_ASKED if mail.is_asked() else SECONDS_BETWEEN_LOOKS


def _put_handlers_back():
    """While one was missing, another file may have been opened, or steps undone."""
    global _is_file_unknown
    if callbacks.put_back():
        forget(is_undo=True)
        _is_file_unknown = True


def take_over_open_file():
    global _is_file_unknown
    if not _is_file_unknown or not _is_main_thread():
        return
    _is_file_unknown = False
    places.place_layout()
    for ob in characters.bound_objects():
        if old_files.is_old(ob):
            bind.bind_anew(ob)
        else:
            wiring.revive(ob)
            mending.adapt(ob)
    shared_group.see_to()
    for ob in characters.with_copy():
        mail.post(bind.follow_when_evaluated, values.key_of(ob))  # no handler is told of a file's first evaluation


FRAME_HANDLERS = (("frame_change_pre", before_frame), ("frame_change_post", after_frame))
HANDLERS = (
    *FRAME_HANDLERS,
    ("depsgraph_update_post", on_depsgraph_update),
    ("load_post", on_load),
    ("save_pre", before_save),
    ("undo_post", on_undo_redo),
    ("redo_post", on_undo_redo),
)


def register_frame_handlers():
    callbacks.add(FRAME_HANDLERS)


def unregister_frame_handlers():
    callbacks.remove(FRAME_HANDLERS)


def register():
    global _is_file_unknown
    _is_file_unknown = True
    mail.answer(mail.REWIRE, bind.rewire)
    callbacks.add(HANDLERS)
    callbacks.start(look_into_the_mail)


def unregister():
    callbacks.stop(look_into_the_mail)
    callbacks.remove(HANDLERS)
    for ob in characters.bound_objects():
        ob.update_tag()  # from now on Blender's own modifiers deform
    precomputing.forget()
    forget()
