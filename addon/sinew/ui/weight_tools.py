"""Operators that transfer, smooth and mirror weights, and reduce how many bones a vertex has."""

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, IntProperty

from ..blender import meshes, selection, units
from ..feedback import notice, progress
from ..weights import background, editing, judging_poses, reducing, transferring
from ..weights.weight_settings import MirrorSettings, ReduceSettings, SmoothSettings, TransferSettings
from . import available, option_properties
from .in_steps import InBackground

FRAMES, TEST = "FRAMES", "TEST"
DIALOG_WIDTH = 420
AT_ONCE = 0.1  # seconds: what takes no longer is told at once
BETWEEN_LOOKS = 0.1  # seconds, while the dialog shows the progress


@option_properties.added(TransferSettings)
class TransferWeights(available.Explains, InBackground, bpy.types.Operator):
    """Copy the weights of the active mesh to the other selected meshes, as from a body to clothes: from the closest
    points of its surface where these are near and face the same way, elsewhere the smoothest weights that fit. Locked
    vertex groups and groups of other bones stay"""

    bl_idname = "object.sinew_transfer_weights"
    bl_label = "Transfer Weights (Sinew)"
    computing = "copying weights"

    selected_to_active: BoolProperty(
        name="Selected to Active",
        description="Copy the other way: from all other selected meshes to the active one",
        default=False,
    )
    add_modifier: BoolProperty(
        name="Add Armature Modifier",
        description="Parent targets that belong to no armature to that of the source, with an Armature modifier",
        default=True,
    )
    preview: BoolProperty(
        name="Preview",
        description="Change no weights, but show in Edit Mode the vertices that are matched: they are selected",
        default=False,
        options={"SKIP_SAVE"},
    )

    @classmethod
    def why_not(cls, context):
        return available.other_mode(context, "OBJECT") or available.no_mesh(context.active_object)

    def assignment(self, context):
        active = context.active_object
        others = [ob for ob in context.selected_objects if ob.type == "MESH" and ob != active]
        context.view_layer.update()
        settings = option_properties.read(self, TransferSettings)
        both = (others, [active]) if self.selected_to_active else ([active], others)
        return transferring.Transfer(*both, settings, self.add_modifier and not self.preview)

    def finish(self, context, made):
        report = made.report() if self.preview else made.write()
        if self.preview:
            for ob, matched in zip(made.targets, made.matched):
                meshes.select_vertices(ob.data, matched)
            selection.show_vertices(context, made.targets)
        self.report({"WARNING"} if report.unweighted else {"INFO"}, report.sentence())
        notice.redraw()


class EditsWeights(available.Explains, InBackground):
    """What the operators for the active mesh have in common. Each defines `edit(ob, free)`, which returns an
    editing.Edit."""

    @classmethod
    def why_not(cls, context):
        return available.other_mode(context, "OBJECT", "PAINT_WEIGHT") or available.no_mesh(context.active_object)

    def assignment(self: Any, context):
        ob = context.active_object
        return self.edit(ob, selection.masked(ob.data) if context.mode == "PAINT_WEIGHT" else None)

    def edit(self, ob: bpy.types.Object, free: np.ndarray | None) -> editing.Edit:
        raise NotImplementedError

    def finish(self: Any, _context, made):
        self.report({"INFO"}, made.write().sentence())
        notice.redraw()


@option_properties.added(SmoothSettings)
class SmoothWeights(EditsWeights, bpy.types.Operator):
    """Smooth the weights of all bones at once, along the edges of faces. With a vertex or face mask, only the selected
    vertices change. Locked vertex groups and groups of other bones stay"""

    bl_idname = "object.sinew_smooth_weights"
    bl_label = "Smooth (Sinew)"
    computing = "smoothing weights"

    def edit(self, ob, free):
        return editing.Smoothing(ob, option_properties.read(self, SmoothSettings), free)


@option_properties.added(MirrorSettings)
class MirrorWeights(EditsWeights, bpy.types.Operator):
    """Copy the weights of one side to the other, by the closest points of the mirrored surface, so that both sides may
    have different vertices. Bones change places with those of the other side, which are found by their names, or by
    their rest positions. With a vertex or face mask, only the selected vertices change. Locked vertex groups and groups
    of other bones stay"""

    bl_idname = "object.sinew_mirror_weights"
    bl_label = "Mirror (Sinew)"
    computing = "mirroring weights"

    def edit(self, ob, free):
        return editing.Mirroring(ob, option_properties.read(self, MirrorSettings), free)


# --- menus ----------------------------------------------------------------------------------------


def draw_object(menu: Any, _context: bpy.types.Context) -> None:
    menu.layout.separator()
    menu.layout.operator_context = "INVOKE_DEFAULT"
    menu.layout.operator(TransferWeights.bl_idname)


def draw_paint(menu: Any, _context: bpy.types.Context) -> None:
    menu.layout.separator()
    menu.layout.operator_context = "INVOKE_DEFAULT"
    for operator in (SmoothWeights, MirrorWeights, ReduceInfluences):
        menu.layout.operator(operator.bl_idname)


class Measuring:
    """What a dialog tells: it is computed while the dialog can be used, always for the newest settings."""

    def __init__(self, say: Any) -> None:
        """say(report): what it tells, in the main thread."""
        self._latest, self._say, self._is_open = background.Latest(), say, True
        self._source: Any = None
        self.made: Any = None  # the newest reduction
        self.region: Any = None  # of the dialog; of 4.2 and later

    def begin(self, settings: ReduceSettings, source: Any, read: Callable[[], reducing.Reduction]) -> None:
        """Computes a reduction, unless it is the newest already. read(): reads one, which is only called if the source
        differs from that of the newest. Raises its ValueError."""
        if source == self._source and settings == self.made.settings:
            return
        made = self.made.with_settings(settings) if source == self._source else read()
        self._source, self.made = source, made
        self._latest.begin(lambda progress: made if made.made is not None or made.compute(progress) else None)
        if not self._latest.wait(AT_ONCE) and not bpy.app.timers.is_registered(self.look):
            bpy.app.timers.register(self.look, first_interval=BETWEEN_LOOKS)

    def look(self) -> float | None:
        """Draws the dialog again, until the result is there. A timer calls this."""
        if self._is_open and self.region is not None:
            self.region.tag_refresh_ui()
        return BETWEEN_LOOKS if self._is_open and self.fraction is not None else None

    def stop(self) -> None:
        """Stops, and forgets what was read."""
        self._source = None
        self._latest.cancel()

    def close(self, stops: bool = True) -> None:
        """Forgets the dialog, and stops, unless told otherwise."""
        self._is_open, self.region = False, None
        if stops:
            self.stop()

    def steps(self, text: str) -> Any:
        """Returns steps, as Latest.steps does, which end with the newest reduction once it is computed."""
        return self._latest.steps(text)

    @property
    def fraction(self) -> float | None:
        return self._latest.fraction

    def sentence(self) -> str:
        result = self._latest.result
        return self._say(result.report()) if isinstance(result, reducing.Reduction) else str(result or "")


@option_properties.added(ReduceSettings)
class ReduceInfluences(EditsWeights, bpy.types.Operator):
    """Leave each vertex only so many bones. Which go is decided by how far the vertex moves without them, and the rest
    is fitted anew. A dialog tells how far vertices move before anything changes. With a vertex or face mask, only the
    selected vertices change. Locked vertex groups and groups of other bones stay"""

    bl_idname = "object.sinew_reduce_influences"
    bl_label = "Reduce Influences (Sinew)"
    computing = "reducing influences"

    poses: EnumProperty(
        name="Poses",
        description="In which poses the vertices' moves are measured",
        items=(
            (
                FRAMES,
                "Frames",
                f"Those of the scene, at most {judging_poses.MOST_FRAMES} of them, evenly spread. If nothing moves on "
                "them, test poses are the default",
            ),
            (TEST, "Test Poses", f"Each bone turned to and fro by {judging_poses.TEST_ANGLE:g} degrees about two axes"),
        ),
    )
    frame_start: IntProperty(
        name="First Frame", description="The first frame to play; by default the scene's", options={"SKIP_SAVE"}
    )
    frame_end: IntProperty(
        name="Last Frame", description="The last frame to play; by default the scene's", options={"SKIP_SAVE"}
    )
    measure: BoolProperty(
        name="Only Measure",
        description="Change no weights, but tell how far the vertices would move, and select those over the tolerance",
        default=False,
        options={"SKIP_SAVE"},
    )

    _said = ""  # shown in the dialog and in the panel of settings
    _known: Any = None  # what was played last, and the matrices
    _measuring: Any = None  # in a dialog

    def invoke(self, context, event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        for name in ("frame_start", "frame_end"):
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(context.scene, name))
        scene = context.scene
        self._measuring = Measuring(lambda report: report.sentence(lambda distance: units.length(scene, distance)))
        self.check(context)
        return context.window_manager.invoke_props_dialog(self, width=DIALOG_WIDTH)

    def check(self, context):
        """Measures anew after a setting has changed in the dialog."""
        if self._measuring is not None:
            try:
                self._said = ""
                self.measured(context)
            except ValueError as error:
                self._measuring.stop()
                self._said = str(error)
        return True

    def measured(self, context):
        """Begins to compute what the dialog tells and *OK* writes. Raises ValueError."""

        def begin():
            source = self.poses, self.frame_start, self.frame_end
            self._measuring.begin(
                option_properties.read(self, ReduceSettings), source, lambda: EditsWeights.assignment(self, context)
            )

        self.or_in_test_poses(begin)

    def assignment(self, context):
        return self.or_in_test_poses(lambda: super(ReduceInfluences, self).assignment(context))

    def or_in_test_poses(self, read: Callable[[], Any]) -> Any:
        """Returns what read() returns: in test poses, if nobody chose frames and nothing moves on them."""
        try:
            return read()
        except judging_poses.AtRest:
            if self.properties.is_property_set("poses"):
                raise
            self.poses = TEST
            return read()

    def cancel(self, context):
        """Blender calls this when the dialog is closed without *OK*; and what comes after *OK* ends with it."""
        if self._measuring is None:
            super().cancel(context)
        else:
            self._measuring.close()
            self._measuring = None

    def run(self, context):
        """Writes what the dialog tells, in steps if it is still computed."""
        if self._measuring is None:
            return super().run(context)
        self.measured(context)  # of the settings as they are
        measuring, self._measuring = self._measuring, None
        measuring.close(stops=False)
        if measuring.made.made is None:
            return self.begin(context, measuring.steps(self.computing))
        return self.finish(context, measuring.made)

    def edit(self, ob, free):
        return reducing.Reduction(ob, self.pose, option_properties.read(self, ReduceSettings), free)

    def pose(self, armature: bpy.types.Object, names: tuple[str, ...]) -> np.ndarray:
        """Returns the matrices of the bones in the poses."""
        if self.poses == TEST:
            return judging_poses.in_test_poses(armature, names)
        context, is_set = bpy.context, self.properties.is_property_set
        frames = judging_poses.spread(
            self.frame_start if is_set("frame_start") else context.scene.frame_start,
            self.frame_end if is_set("frame_end") else context.scene.frame_end,
        )
        key = armature.name, names, frames
        if self._known is None or self._known[0] != key:
            with progress.shown(context) as shown:
                self._known = key, judging_poses.on_frames(context, armature, names, frames, shown)
        return self._known[1]

    def finish(self, context, made):
        report = made.report() if self.measure else made.write()
        over = made.over()
        if self.tolerance > 0:
            meshes.select_vertices(made.ob.data, over)
            if context.mode == "PAINT_WEIGHT":
                made.ob.data.use_paint_mask_vertex = True
            elif self.measure and over.any():
                selection.show_vertices(context, [made.ob])
        self._said = report.sentence(lambda distance: units.length(context.scene, distance))
        self.report({"WARNING"} if report.over else {"INFO"}, self._said)
        notice.redraw()

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        names = ["max_influences", "poses", "frame_start", "frame_end", "rings", "tolerance", "measure"]
        for name in names:
            if self.poses == FRAMES or not name.startswith("frame"):
                layout.prop(self, name)
        measuring = self._measuring
        if measuring is not None and not self._said:
            measuring.region = getattr(context, "region_popup", None)
            if measuring.fraction is None:
                notice.draw_sentence(layout.box(), context, measuring.sentence(), False, DIALOG_WIDTH)
            elif hasattr(layout, "progress"):  # 4.0
                layout.progress(text="measuring", factor=measuring.fraction)
            else:
                layout.label(text=f"measuring: {measuring.fraction:.0%}")
        if self._said:
            notice.draw_sentence(layout.box(), context, self._said, False, DIALOG_WIDTH)


def draw_tools(layout: bpy.types.UILayout) -> None:
    """Draws the buttons of the tools that change weights."""
    column = layout.column(align=True)
    for pair in ((TransferWeights, SmoothWeights), (MirrorWeights, ReduceInfluences)):
        row = column.row(align=True)
        row.operator_context = "INVOKE_DEFAULT"
        for operator in pair:
            row.operator(operator.bl_idname, text=operator.bl_label.split()[0])


CLASSES = (TransferWeights, SmoothWeights, MirrorWeights, ReduceInfluences)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
