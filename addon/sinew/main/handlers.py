"""Blender's callbacks. Deforming needs none of them: they handle edits, update the deformed copies of the output Mesh,
and pose the armatures of clips before a frame is evaluated."""

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import bpy
from bpy.app.handlers import persistent

from ..blender import meshes, nodes, values
from ..chain import bone_editions
from ..clips import posing
from ..clips.clip_store import has_poses
from ..feedback import notice
from ..host import bone_memory, evaluations, modifier_memory, places
from ..install import bind, canvases, deformed_copies, deformed_copy, mending, old_files, precomputing, shared_group
from ..plan import canvas_survey, survey, ways, wiring
from ..run import afterwards, characters, graph_copies, mail
from ..stencils import probing, searching
from ..weights import reports
from . import callbacks, memory_use, whole_frames, write_lock

log = logging.getLogger("sinew")
SECONDS_BETWEEN_LOOKS = 0.3  # between checks of the mail, in a window
SECONDS_WHILE_ASKED = 0.005  # the same, while a render asks for poses
SECONDS_TO_WAIT = 5.0  # for the main thread, at most
HAS_EVENT_LOOP = not bpy.app.background
_seen_gathering = None  # characters.gathering() at the last update
_seen_members: frozenset[int] | None = None  # characters.members() at the last update
_said: set[str] = set()  # errors of the timer that were logged
_tails: dict[int, Any] = {}  # while a file is saved: key of a bound mesh -> situation.Tail
# Key of an armature's data -> (number of the edition of its bones, if that is known, their names)
_bones: dict[Any, tuple[int | None, list[str]]] = {}
_constraints: dict[Any, Any] = {}  # by the key of an armature object, see _has_other_constraints
_changing = threading.RLock()  # held while the main thread changes originals, see _when_none_evaluates
# Whether the open file must still be taken over. The add-on may be enabled in an open file, and register() has no
# access to the file's data.
_is_file_unknown = True


def _is_calm(scene: bpy.types.Scene) -> bool:
    """Whether data-blocks may be removed before an evaluation: not after a scene was chosen, for which Blender has
    already built relations."""
    graphs = [layer.depsgraph for layer in scene.view_layers]
    return not any(graph is not None and evaluations.are_new(bpy.data.actions, graph) for graph in graphs)


@persistent
def before_frame(scene: bpy.types.Scene, *_: Any) -> None:
    has_mail = mail.removals or not HAS_EVENT_LOOP and mail.letters
    is_calm = has_mail and _is_calm(scene)
    if is_calm:
        _remove_what_waits()
    write_lock.look()
    take_over_open_file()
    characters.see_surroundings()
    if mail.is_main_thread():
        evaluations.note_playing(any(each.screen.is_animation_playing for each in bpy.context.window_manager.windows))
    if characters.may_follow_clips():
        _in_main_thread(_pose, scene)
    if not HAS_EVENT_LOOP and mail.letters and is_calm:
        # Whatever is tagged after the frame change is copied from the file once more, with the values that keyframes
        # had on the viewport's frame.
        _deliver()


@persistent
def after_frame(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    with mail.among_handlers:
        _follow_frame(scene, depsgraph)


@persistent
def on_depsgraph_update(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    with mail.among_handlers:
        _follow_update(depsgraph)


def _follow_frame(scene, depsgraph):
    if characters.may_follow_clips():
        _in_main_thread(_pose_anew, scene, depsgraph)
    if not mail.is_main_thread():
        return
    _learn_graphs(depsgraph)
    copied = characters.with_copy()
    if copied:
        deformed_copies.follow(copied, depsgraph, {values.key_of(update.id) for update in depsgraph.updates})
    if graph_copies.has_strays():
        characters.sweep()
    if not HAS_EVENT_LOOP:
        searching.note_frame(depsgraph.mode == "RENDER")
    if depsgraph.mode != "RENDER":
        _deliver()


def _pose(scene):
    posing.pose_armatures(_clip_armatures(), scene)


def _pose_anew(scene, depsgraph):
    posing.pose_anew(_clip_armatures(), scene, depsgraph)


def _learn_graphs(depsgraph):
    """Finds how to tell renders from viewports. Runs of meshes whose modifiers are on in only one of them may then be
    longer."""
    if evaluations.learn_mode(depsgraph):
        for ob in characters.known():
            characters.of(ob).look_again()
            characters.of(ob).look(ob)


def _in_main_thread(function, *arguments):
    """Calls a function in the main thread. A render evaluates in its own thread, while the user may be editing the data
    that poses are written to."""
    if mail.is_main_thread() or not HAS_EVENT_LOOP or not mail.ask(SECONDS_TO_WAIT, function, *arguments):
        # If the main thread does not respond, it is waiting for this thread, as when the file is closed.
        function(*arguments)


@persistent
def before_depsgraph_update(scene: bpy.types.Scene, *_: Any) -> None:
    if mail.removals and _is_calm(scene):
        _remove_what_waits()
    characters.see_surroundings()


def _deliver() -> None:
    if mail.letters:
        _when_none_evaluates(mail.deliver)


def _remove_what_waits() -> None:
    _when_none_evaluates(mail.remove_what_waits)


def _when_none_evaluates(function: Callable[[], None]) -> None:
    """Calls a function that changes or removes originals, unless another thread evaluates, which reads them: then it is
    called later. One that begins meanwhile waits."""
    if mail.is_main_thread():
        with _changing:
            if not evaluations.others_run(mail.waiting):
                function()


@persistent
def before_evaluation(*_: Any) -> None:
    callbacks.put_last("frame_change_pre", "depsgraph_update_pre")
    evaluations.announce()
    if not mail.is_main_thread():
        with _changing:
            pass


@persistent
def after_evaluation(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    callbacks.put_last("frame_change_post")
    evaluations.conclude()
    afterwards.restore(depsgraph)


def _follow_update(depsgraph):
    write_lock.look()
    _put_handlers_back()
    take_over_open_file()
    edits = Edits.of(depsgraph)
    receive_strangers(edits)
    if edits.of_collections:
        characters.count_again()
        graph_copies.expect_strays()
    searching.note_edit()
    affected = characters.made_of(edits.keys)
    has_gathered, has_other_bones = _has_gathered(), _has_other_bones(edits.armatures)
    has_other_constraints = _has_other_constraints(edits.rigs)
    if has_gathered:
        shared_group.follow()
        mail.post(canvases.remove_unused)
    may_lack = _has_other_members() or has_other_bones
    objects = characters.known() if may_lack or edits.of_collections else affected.values()
    _note_edits(objects, affected, edits, may_lack, has_other_constraints)
    _note_animation(characters.known() if edits.of_actions else affected.values())
    for armature in edits.armatures:
        posing.forget_if_edited(armature.original)
    copied = characters.with_copy()
    if copied:
        deformed_copies.follow(copied, depsgraph, edits.keys)
    if has_gathered or edits.of_collections:
        deformed_copies.tidy(copied, depsgraph, has_gathered)
    _learn_graphs(depsgraph)
    if graph_copies.has_strays():
        characters.sweep()
    _deliver()


@persistent
def on_load(*_: Any) -> None:
    global _is_file_unknown
    _is_file_unknown = True
    for forget_more in (notice.forget, posing.forget_what_was_said, whole_frames.forget, precomputing.forget):
        forget_more()
    callbacks.another_file()
    mail.removals.clear()
    probing.remove_leftovers()
    forget()
    take_over_open_file()


@persistent
def before_save(*_: Any) -> None:
    searching.put_away()
    mail.remove_what_waits()
    for ob in characters.known():
        planning = characters.of(ob).planning
        if planning.tail is not None:  # whoever opens or links the file has no stencils
            _tails[values.key_of(ob)], planning.tail = planning.tail, None
            mending.adapt(ob)
    canvases.remove_unused()
    shared_group.see_to()


@persistent
def after_save(*_: Any) -> None:
    for key, tail in _tails.items():
        ob = characters.find(key)
        if ob is not None:
            characters.of(ob).planning.tail = tail
            mail.post(mail.REWIRE, key)
    _tails.clear()


@persistent
def before_render(scene: bpy.types.Scene, *_: Any) -> None:
    searching.note_render(scene, True)


@persistent
def after_render(scene: bpy.types.Scene, *_: Any) -> None:
    searching.note_render(scene, False)


@persistent
def before_undo_redo(*_: Any) -> None:
    searching.put_away()
    canvases.remove_all()


@persistent
def on_undo_redo(*_: Any) -> None:
    probing.remove_leftovers()
    characters.gather_again()
    characters.follow_undo()
    forget_what_was_seen()
    for ob in characters.bound_objects():
        own = nodes.find_modifier(ob)
        if own is not None and nodes.reads_canvas(own):
            mail.post(bind.rewire, values.key_of(ob))


def forget() -> None:
    characters.forget()
    _bones.clear()
    _constraints.clear()
    forget_what_was_seen()


def forget_what_was_seen() -> None:
    if not values.KEYS_OUTLIVE_UNDO:
        _bones.clear()
        _constraints.clear()
    evaluations.forget()
    deformed_copies.forget()
    posing.forget()
    reports.forget()
    searching.forget()


@dataclass
class Edits:
    """What was edited, or moved by animation, since the last evaluation."""

    of_collections: bool  # objects may have been added, removed, shown or hidden
    of_actions: bool
    keys: set = field(default_factory=set)  # of all updated data-blocks
    # Keys of the data-blocks that may have been edited themselves. An object that only follows others has another shape
    # or place, but Blender need not shade it anew.
    own_keys: set = field(default_factory=set)
    meshes: list = field(default_factory=list)  # (original mesh object, whether its geometry has changed)
    armatures: list = field(default_factory=list)  # evaluated armature data
    rigs: list = field(default_factory=list)  # original armature objects
    vertex_parents: set = field(default_factory=set)  # keys of the objects whose vertices updated objects follow

    @classmethod
    def of(cls, depsgraph: bpy.types.Depsgraph) -> "Edits":
        edits = cls(depsgraph.id_type_updated("COLLECTION"), depsgraph.id_type_updated("ACTION"))
        for update in depsgraph.updates:
            block = update.id
            edits.keys.add(values.key_of(block))
            if update.is_updated_shading or not update.is_updated_geometry:
                edits.own_keys.add(values.key_of(block))
            if isinstance(block, bpy.types.Armature):  # also if only the pose has changed
                edits.armatures.append(block)
            elif isinstance(block, bpy.types.Object) and block.type == "MESH":
                edits.meshes.append((block.original, update.is_updated_geometry))
            elif isinstance(block, bpy.types.Object) and block.type == "ARMATURE":
                edits.rigs.append(block.original)
            if isinstance(block, bpy.types.Object) and canvas_survey.is_parented_to_vertices(block):
                edits.vertex_parents.add(values.key_of(block.parent))
        return edits


def _clip_armatures():
    """Returns the armatures of bound objects whose bones are moved by imported poses."""
    found = dict.fromkeys(ob.sinew.armature for ob in characters.by_clip() if ob.sinew.source == "CLIP")
    return [armature for armature in found if armature is not None and has_poses(armature.data)]


def _has_gathered():
    """Whether bound meshes were added or removed since the last update."""
    global _seen_gathering
    last, _seen_gathering = _seen_gathering, characters.gathering()
    return last != _seen_gathering


def _has_other_members():
    """Whether there are other bound meshes than at the last update."""
    global _seen_members
    last, _seen_members = _seen_members, characters.members()
    return last != _seen_members


def _has_other_bones(armatures):
    """Whether the bones of an armature have changed since its last update. armatures: their evaluated data."""
    has_others = False
    for data in armatures:
        key, edition = values.key_of(data), bone_editions.known(data)
        last_edition, last_names = _bones.get(key, (None, None))
        if edition is None or edition != last_edition:
            names = data.original.bones.keys()
            has_others |= last_names != names
            _bones[key] = edition, names
    return has_others


def _has_other_constraints(armatures):
    """Whether the bones of an armature object have constraints of other types than at its last update. A solver changes
    the order in which Blender evaluates bones."""
    has_others = False
    for ob in armatures:
        key, now = values.key_of(ob), bone_memory.kinds_of_constraints(ob)
        has_others |= _constraints.get(key) != now
        _constraints[key] = now
    return has_others


def _note_edits(objects, affected, edits, may_lack, has_other_constraints):
    """Updates characters after edits, which may have applied or removed a modifier. affected: {key: object} of the
    objects of which some part was edited; may_lack: whether a driver may wait for something that no longer exists, or
    may not wait for all that it should; has_other_constraints: see _has_other_constraints."""
    for key, ob in characters.made_of(edits.vertex_parents).items():
        if characters.of(ob).way.takes_all:
            mail.post(bind.rewire, key)
    for ob in objects:
        key = values.key_of(ob)
        is_updated, is_edited = key in edits.keys, not edits.own_keys.isdisjoint((key, values.key_of(ob.data)))
        if is_edited and bind.release_if_undone(ob):
            continue
        if is_updated:
            characters.see(ob, is_edited)
        entry = characters.of(ob)
        if key in affected and entry.status.failures:
            entry.status.motion.to_skip = 0  # what was edited may have been the reason
        if entry.way.kind == ways.BLENDER and (is_edited or entry.way.is_of_bones and key in affected):
            entry.planning.see_surroundings(ob)
            entry.look_again()
            entry.look(ob)
        elif entry.is_wired and (
            entry.planning.should_revive(ob)
            or may_lack
            and not survey.waits_for_targets(ob, entry.plan)
            or has_other_constraints
            and key in affected
            and not survey.waits_for_bones(ob, entry.plan.hook_of(ob), entry.plan.replaced)
            or is_updated
            and edits.of_collections
            and not entry.planning.waits_for_targets(ob)
            or key in affected
            and survey.may_go_on(ob, entry.plan)
        ):
            mail.post(bind.rewire, key)


def _note_animation(objects):
    """Has Sinew look again at those objects of which something was left to Blender because of animation that is
    gone."""
    for ob in objects:
        troubles = characters.of(ob).plan.animation_troubles
        if troubles and survey.animation_troubles(ob) != troubles:
            mail.post(bind.rewire, values.key_of(ob))


def receive_strangers(edits: Edits) -> None:
    """Notices bound meshes that appeared while as many objects disappeared, and bound meshes that were also assigned to
    a second object. Removes Sinew's modifiers from a mesh that was only given copies of them, and so is not bound."""
    for ob, is_reshaped in edits.meshes:
        if nodes.is_canvas(ob):
            continue
        if is_reshaped:  # it may have been assigned the mesh of a bound object
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
    """Whether a mesh has Sinew's attribute from a bound mesh that was joined to it."""
    return (
        mesh.library is None
        and not mesh.is_editmode
        and meshes.point_attribute(mesh, nodes.POSITION_ATTRIBUTE) is not None
    )


def look_into_the_mail() -> float:
    """Restores what is missing and delivers the mail. A timer, which Blender would drop if it raised. Returns the
    seconds until the next call."""
    for look in (_remove_what_waits, _put_handlers_back, take_over_open_file, _deliver, searching.look):
        try:
            look()
        except Exception as error:
            if str(error) not in _said:
                _said.add(str(error))
                log.exception("something could not be seen to")
    if mail.is_asked():
        return SECONDS_WHILE_ASKED
    return searching.SECONDS_BETWEEN_BITS if searching.is_running() else SECONDS_BETWEEN_LOOKS


def _put_handlers_back():
    """Puts missing handlers back. While one was missing, a different file may have been opened, or steps undone."""
    global _is_file_unknown
    if callbacks.put_back():
        forget()
        _is_file_unknown = True


def take_over_open_file() -> None:
    global _is_file_unknown
    if not _is_file_unknown or not mail.is_main_thread():
        return
    _is_file_unknown = False
    memory_use.say_at_start()
    places.place_layout()
    modifier_memory.prove()
    for ob in characters.bound_objects():
        if old_files.is_old(ob):
            bind.bind_anew(ob)
        else:
            wiring.revive(ob)
            mending.adapt(ob)
    lacking = [ob.name for ob in characters.bound_objects() if survey.lacks_own_shape(ob)]
    if lacking:  # a render, too, would not show it
        log.warning("without their methods or smoothing, which Blender does not have: %s", ", ".join(lacking))
    shared_group.see_to()
    for ob in characters.with_copy():
        mail.post(bind.follow_when_evaluated, values.key_of(ob))  # a file's first evaluation calls no handler


def look_anew() -> None:
    """Takes over the open file once more, since Sinew may now use Blender's memory, or no longer."""
    global _is_file_unknown
    forget()
    _is_file_unknown = True
    for ob in characters.bound_objects():  # Blender copies what Sinew has written to
        ob.update_tag()
        ob.data.update_tag()
        if ob.data.shape_keys is not None:
            ob.data.shape_keys.update_tag()
    take_over_open_file()


FIRST_HANDLERS = (
    ("frame_change_pre", before_evaluation),
    ("depsgraph_update_pre", before_evaluation),
    ("frame_change_post", after_evaluation),
    ("depsgraph_update_post", after_evaluation),
)
FRAME_HANDLERS = (("frame_change_pre", before_frame), ("frame_change_post", after_frame))
HANDLERS = (
    *FRAME_HANDLERS,
    ("depsgraph_update_pre", before_depsgraph_update),
    ("depsgraph_update_post", on_depsgraph_update),
    ("load_post", on_load),
    ("render_init", before_render),
    ("render_complete", after_render),
    ("render_cancel", after_render),
    ("save_pre", before_save),
    ("save_post", after_save),
    *((("save_post_fail", after_save),) if hasattr(bpy.app.handlers, "save_post_fail") else ()),
    ("undo_pre", before_undo_redo),
    ("redo_pre", before_undo_redo),
    ("undo_post", on_undo_redo),
    ("redo_post", on_undo_redo),
)


def register_frame_handlers() -> None:
    callbacks.add(FRAME_HANDLERS)


def unregister_frame_handlers() -> None:
    callbacks.remove(FRAME_HANDLERS)


def register() -> None:
    global _is_file_unknown
    _is_file_unknown = True
    mail.answer(mail.REWIRE, bind.rewire)
    callbacks.add(FIRST_HANDLERS, is_first=True)
    callbacks.add(HANDLERS)
    callbacks.start(look_into_the_mail)


def unregister() -> None:
    callbacks.stop(look_into_the_mail)
    callbacks.remove((*FIRST_HANDLERS, *HANDLERS))
    for ob in characters.bound_objects():
        ob.update_tag()  # from now on Blender's own modifiers deform
    precomputing.forget()
    forget()
