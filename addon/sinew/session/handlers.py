"""Blender's callbacks. Deforming needs none of them: they see to edits and to the deformed copies of the output Mesh,
and pose the armatures of clips before a frame is evaluated."""

import threading

import bpy
from bpy.app.handlers import persistent

from ..binding import bind, deformed_copy, old_files, shared_group, ways, wiring
from ..blender import memory, meshes, nodes, values
from ..feedback import notice
from ..rigs import posing
from ..rigs.clip_store import has_poses
from . import characters, deformed_copies, mail, precomputing, whole_frames, write_lock

SECONDS_BETWEEN_LOOKS = 0.3  # into the mail, in a window
forgotten_with_file = [notice.forget, whole_frames.forget, precomputing.forget]  # called as another file is opened
_seen_gathering = None  # of bound meshes
_bone_names = {}  # key of an armature's data -> those of its bones
_is_file_unknown = True  # the add-on was switched on in an open file, of which registering may see nothing


@persistent
def before_frame(scene, *_):
    take_over_open_file()
    posing.pose_armatures(_clip_armatures(characters.bound_objects()), scene)


@persistent
def after_frame(scene, depsgraph):
    objects = characters.bound_objects()
    posing.pose_anew(_clip_armatures(objects), scene, depsgraph)
    copied = deformed_copies.those_of(objects)
    if copied:
        deformed_copies.follow(copied, depsgraph, _changed(depsgraph))
    mail.deliver()


@persistent
def on_depsgraph_update(_scene, depsgraph):
    take_over_open_file()
    receive_strangers(depsgraph)
    objects = characters.bound_objects()
    has_gathered = _has_gathered()
    if has_gathered:
        shared_group.follow()
    if objects:
        changed = _changed(depsgraph)
        has_other_bones = _has_other_bones(depsgraph)
        _note_edits(objects, changed, has_gathered or has_other_bones)
        copied = deformed_copies.those_of([ob for ob in objects if ob.sinew.is_bound])
        deformed_copies.follow(copied, depsgraph, changed)
    else:
        copied = []
    deformed_copies.tidy(copied, depsgraph)
    mail.deliver()


@persistent
def on_load(*_):
    global _is_file_unknown
    _is_file_unknown = True
    for forget_more in forgotten_with_file:
        forget_more()
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


def _changed(depsgraph):
    """The keys of what somebody has edited, or animation moved, since the last evaluation."""
    return {values.key_of(update.id) for update in depsgraph.updates}


def _clip_armatures(objects):
    """Those of bound objects whose bones imported poses move."""
    found = dict.fromkeys(ob.sinew.armature for ob in objects if ob.sinew.source == "CLIP")
    return [armature for armature in found if armature is not None and has_poses(armature.data)]


def _what_it_depends_on(ob):
    armatures = [modifier.object for modifier in ob.sinew.modifiers if modifier.object is not None]
    return map(values.key_of, (ob, ob.data, *armatures, *(armature.data for armature in armatures)))


def _has_gathered():
    """Whether there are more objects than at the last update, or fewer, or others."""
    global _seen_gathering
    last, _seen_gathering = _seen_gathering, characters.gathering()
    return last != _seen_gathering


def _has_other_bones(depsgraph):
    """Whether an armature has others than when it was last updated."""
    has_others = False
    for update in depsgraph.updates:
        if isinstance(update.id, bpy.types.Armature):  # a pose says so too
            key, names = values.key_of(update.id), update.id.original.bones.keys()
            has_others |= _bone_names.get(key) != names
            _bone_names[key] = names
    return has_others


def _note_edits(objects, changed, may_lack):
    """A modifier may have been applied or removed; the bones of imported poses may have been moved. may_lack: what a
    driver waits for may have gone, or not be all."""
    for ob in objects:
        key = values.key_of(ob)
        if key in changed and bind.release_if_undone(ob):
            continue
        entry = characters.of(ob)
        if entry.way.kind == ways.BLENDER and not changed.isdisjoint(_what_it_depends_on(ob)):
            entry.look_again()
            entry.look(ob)
        elif entry.is_wired and (entry.is_given_up(ob) or may_lack and not entry.waits_for_targets(ob)):
            mail.post(bind.rewire, key)
        armature = ob.sinew.last_armature
        if armature is not None and values.key_of(armature.data) in changed:
            posing.forget_if_edited(armature)


def receive_strangers(depsgraph):
    """A bound mesh that came while as many objects went is noticed here, and one that another object was given as well.
    A mesh that was given a copy of another one's modifier is not bound, and has that taken away."""
    for update in depsgraph.updates:
        if not isinstance(update.id, bpy.types.Object) or update.id.type != "MESH":
            continue
        ob = update.id.original
        if update.is_updated_geometry and ob.data.users > 1:  # it may have been given the mesh of a bound one
            characters.gather_again()
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
            bind.remove_attribute(ob)


def _has_stray_attribute(mesh):
    """Of a bound mesh that was joined to this one."""
    return (
        mesh.library is None
        and not mesh.is_editmode
        and meshes.point_attribute(mesh, nodes.POSITION_ATTRIBUTE) is not None
    )


def look_into_the_mail():
    write_lock.look()
    take_over_open_file()
    mail.deliver()
    return SECONDS_BETWEEN_LOOKS


def take_over_open_file():
    global _is_file_unknown
    if not _is_file_unknown or threading.current_thread() is not threading.main_thread():
        return
    _is_file_unknown = False
    memory.place_layout()
    for ob in characters.bound_objects():
        if old_files.is_old(ob):
            bind.bind_anew(ob)
        else:
            wiring.revive(ob)
            bind.adapt(ob)
    shared_group.see_to()
    for ob in deformed_copies.those_of(characters.bound_objects()):
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
    for name, handler in FRAME_HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister_frame_handlers():
    for name, handler in FRAME_HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)


def register():
    global _is_file_unknown
    _is_file_unknown = True
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)
    bpy.app.timers.register(look_into_the_mail, persistent=True)


def unregister():
    bpy.app.timers.unregister(look_into_the_mail)
    for name, handler in HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
    for ob in characters.bound_objects():
        ob.update_tag()  # from now on Blender's own modifiers deform
    precomputing.forget()
    forget()
