"""The operator that reduces how many bones a vertex has."""

from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ..blender import meshes, units
from ..feedback import notice, progress
from ..weights import poses, reducing
from .weight_tools import EditsWeights, show_in_edit_mode

FRAMES, TEST = "FRAMES", "TEST"
DIALOG_WIDTH = 420


class ReduceInfluences(EditsWeights, bpy.types.Operator):
    """Leave each vertex only so many bones. Which go is decided by how far the vertex moves without them, and the rest
    is fitted anew. A dialog tells how far vertices move before anything changes. With a vertex or face mask, only the
    selected vertices change. Locked vertex groups and groups of other bones stay"""

    bl_idname = "object.sinew_reduce_influences"
    bl_label = "Reduce Influences (Sinew)"
    computing = "reducing influences"

    max_influences: IntProperty(
        name="Most Bones",
        description="The largest number of bones per vertex. Many game engines allow 4",
        default=4,
        min=1,
        soft_max=12,
        max=64,
    )
    poses: EnumProperty(
        name="Poses",
        description="In which poses the vertices' moves are measured",
        items=(
            (FRAMES, "Frames", f"Those of the scene, at most {poses.MOST_FRAMES} of them, evenly spread"),
            (TEST, "Test Poses", f"Each bone turned to and fro by {poses.TEST_ANGLE:g} degrees about two axes"),
        ),
    )
    frame_start: IntProperty(
        name="First Frame", description="The first frame to play; by default the scene's", options={"SKIP_SAVE"}
    )
    frame_end: IntProperty(
        name="Last Frame", description="The last frame to play; by default the scene's", options={"SKIP_SAVE"}
    )
    rings: IntProperty(
        name="Fade",
        description="Over how many edges a bone fades out towards vertices that have lost it, so that no seam shows",
        default=2,
        min=0,
        soft_max=10,
        max=64,
    )
    tolerance: FloatProperty(
        name="Tolerance",
        description="Select the vertices that move farther than this; 0: none",
        default=0.0,
        min=0.0,
        subtype="DISTANCE",
        unit="LENGTH",
        precision=4,
    )
    measure: BoolProperty(
        name="Only Measure",
        description="Change no weights, but tell how far the vertices would move, and select those over the tolerance",
        default=False,
        options={"SKIP_SAVE"},
    )

    _said = ""  # shown in the dialog and in the panel of settings
    _known: Any = None  # what was played last, and the matrices

    def invoke(self, context, event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        for name in ("frame_start", "frame_end"):
            if not self.properties.is_property_set(name):
                setattr(self, name, getattr(context.scene, name))
        self.measured(context)
        return context.window_manager.invoke_props_dialog(self, width=DIALOG_WIDTH)

    def check(self, context):
        """Measures anew after a setting has changed in the dialog."""
        self.measured(context)
        return True

    def measured(self, context):
        """Finds what the dialog says."""
        try:
            made = self.assignment(context)
            made.compute()
            self._said = made.report().sentence(lambda distance: units.length(context.scene, distance))
        except ValueError as error:
            self._said = str(error)

    def edit(self, ob, free):
        settings = reducing.Settings(self.max_influences, self.rings, self.tolerance)
        return reducing.Reduction(ob, self.pose, settings, free)

    def pose(self, armature: bpy.types.Object, names: tuple[str, ...]) -> np.ndarray:
        """Returns the matrices of the bones in the poses."""
        if self.poses == TEST:
            return poses.in_test_poses(armature, names)
        context, is_set = bpy.context, self.properties.is_property_set
        frames = poses.spread(
            self.frame_start if is_set("frame_start") else context.scene.frame_start,
            self.frame_end if is_set("frame_end") else context.scene.frame_end,
        )
        key = armature.name, names, frames
        if self._known is None or self._known[0] != key:
            with progress.shown(context) as shown:
                self._known = key, poses.on_frames(context, armature, names, frames, shown)
        return self._known[1]

    def finish(self, context, made):
        report = made.report() if self.measure else made.write()
        over = made.over()
        if self.tolerance > 0:
            meshes.select_vertices(made.ob.data, over)
            if context.mode == "PAINT_WEIGHT":
                made.ob.data.use_paint_mask_vertex = True
            elif self.measure and over.any():
                show_in_edit_mode(context, [made.ob])
        self._said = report.sentence(lambda distance: units.length(context.scene, distance))
        self.report({"WARNING"} if report.over else {"INFO"}, self._said)
        notice.redraw()
        return {"FINISHED"}

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        names = ["max_influences", "poses", "frame_start", "frame_end", "rings", "tolerance", "measure"]
        for name in names:
            if self.poses == FRAMES or not name.startswith("frame"):
                layout.prop(self, name)
        if self._said:
            notice.draw_sentence(layout.box(), context, self._said, False, DIALOG_WIDTH)


def draw_paint(menu: Any, _context: bpy.types.Context) -> None:
    menu.layout.operator(ReduceInfluences.bl_idname)


CLASSES = (ReduceInfluences,)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
