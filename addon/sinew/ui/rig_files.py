"""Operators that import and export rig folders."""

import os
from typing import Any

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, StringProperty
from bpy_extras.io_utils import ExportHelper, ImportHelper

from ..feedback import progress
from ..main import properties
from ..plan import bindable
from ..rig_files import rig_export, rig_import
from . import available

MESH, WEIGHTS, POSE, ANIMATION = "mesh.obj", "weights.dmat", "pose.dmat", "anim.dmat"  # the usual names


def files_beside(suffix: str, *others: str) -> dict[str, Any]:
    """Returns the search options of a StringProperty of ImportRig: it suggests files of the chosen folder, except those
    with the usual names of something else (others), or that another property names."""

    def search(operator, context, edit_text):
        folder = operator.directory or os.path.dirname(operator.filepath)
        params = getattr(context.space_data, "params", None)  # of the file browser
        if params is not None:
            folder = os.fsdecode(params.directory)
        named = {operator.mesh, operator.weights, operator.pose} - {edit_text}
        names = os.listdir(folder) if os.path.isdir(folder) else []
        return sorted(
            name
            for name in names
            if name.endswith(suffix) and edit_text.lower() in name.lower() and name not in {*others, *named}
        )

    return {"search": search, "search_options": {"SUGGESTION"}}


WHEN_EMPTY = {"placeholder": "automatic"} if bpy.app.version >= (4, 1, 0) else {}  # what an empty field says


class ImportRig(bpy.types.Operator, ImportHelper):
    """Import rig folders: mesh, skeleton, weights and poses"""

    bl_idname = "import_scene.sinew_rig"
    bl_label = "Import Sinew Rig"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    filename_ext = ".bf"
    filter_glob: StringProperty(default="*.bf;*.tgf", options={"HIDDEN"})
    directory: StringProperty(subtype="DIR_PATH", options={"HIDDEN", "SKIP_SAVE"})
    files: CollectionProperty(type=bpy.types.OperatorFileListElement, options={"HIDDEN", "SKIP_SAVE"})
    mesh: StringProperty(
        name="Mesh", description=f"File of the mesh, beside the skeleton; empty: {MESH}", **files_beside(".obj")
    )
    weights: StringProperty(
        name="Weights",
        description="File of the weights; empty: weights.dmat, and if there is none, weights made from the bones; "
        "auto: made from the bones in any case",
        **files_beside(".dmat", POSE, ANIMATION),
    )
    pose: StringProperty(
        name="Poses",
        description="File of the poses; empty: pose.dmat, if there is one",
        **files_beside(".dmat", WEIGHTS, ANIMATION),
    )
    convention: EnumProperty(
        name="Convention",
        description="What a row of a .bf file describes",
        items=(
            ("AUTO", "Automatic", "Bone if a root has the weight index -1, otherwise Joint"),
            ("BONE", "Bone", "The edge from the parent to the joint, which rotates about the parent"),
            ("JOINT", "Joint", "The joint itself, which rotates about its own position"),
        ),
    )
    quaternion_order: EnumProperty(
        name="Quaternions",
        description="The order of the four numbers in the file of the poses",
        items=(
            ("WXYZ", "w x y z", "The real part first"),
            ("XYZW", "x y z w", "The real part last, as libigl writes them"),
        ),
    )
    up_axis: EnumProperty(
        name="Up",
        description="The axis of the files that points up",
        items=(("Y", "Y", "Y is up, as in most .obj files"), ("Z", "Z", "Z is up, as in Blender")),
    )
    scale: FloatProperty(name="Scale", description="Size of the imported rig", default=1.0, min=1e-6, soft_max=1000)
    source: EnumProperty(name="Pose", items=properties.SOURCES, description="Where the pose comes from")
    method: EnumProperty(name="Method", items=properties.METHODS, description="How the joints' motions are blended")
    output: EnumProperty(name="Output", items=properties.OUTPUT_ITEMS, description="Where the deformed positions go")
    frame_rate: FloatProperty(
        name="Frame Rate",
        min=0.0,
        soft_max=240.0,
        description="Poses per second in the file, played at the scene's frame rate; 0: one pose per frame",
    )
    set_frame_range: BoolProperty(
        name="Set Frame Range", default=True, description="End the scene at the last pose if there are more than two"
    )

    def invoke(self, context, event):
        if self.files and self.directory:  # dropped: the files are known, so ask only for the options
            if bpy.app.background:
                return self.execute(context)
            return context.window_manager.invoke_props_dialog(self, width=360)
        return ImportHelper.invoke(self, context, event)

    def draw(self, _context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        for label, names in (
            ("Files", ("mesh", "weights", "pose")),
            ("Conversion", ("convention", "quaternion_order", "up_axis", "scale")),
            ("Animation", ("source", "frame_rate", "set_frame_range")),
            ("Deformation", ("method", "output")),
        ):
            box = self.layout.box().column()
            box.label(text=label)
            for name in names:
                box.prop(self, name, **(WHEN_EMPTY if label == "Files" else {}))

    def import_options(self) -> rig_import.ImportOptions:
        convention = None if self.convention == "AUTO" else self.convention.lower()
        return rig_import.ImportOptions(
            mesh=self.mesh,
            weights=self.weights,
            pose=self.pose,
            convention=convention,
            quaternion_order=self.quaternion_order.lower(),
            up_axis=self.up_axis,
            scale=self.scale,
            method=self.method,
            source=self.source,
            output=self.output,
            frame_rate=self.frame_rate,
            set_frame_range=self.set_frame_range,
        )

    def paths(self) -> list[str]:
        """Returns the chosen paths: one or more that were selected in the file browser or dropped, or one from a
        script."""
        chosen = [os.path.join(self.directory, file.name) for file in self.files if file.name]
        return chosen if chosen and self.directory else [self.filepath]

    def execute(self, context):
        paths = self.paths()
        if not all(map(os.path.basename, paths)):
            self.report({"ERROR"}, "Choose a skeleton file (.bf or .tgf)")
            return {"CANCELLED"}
        if context.mode != "OBJECT":
            bpy.ops.object.mode_set(mode="OBJECT")
        imported, problems = [], []
        with progress.shown(context) as shown:
            for number, path in enumerate(paths):
                part = progress.Part(shown, number, len(paths))
                try:
                    *objects, remark = rig_import.import_rig(context, path, self.import_options(), part)
                    imported.append(objects)
                    problems += [remark] if remark else []
                except (ValueError, OSError, MemoryError, bindable.BindingError) as error:
                    problems.append(str(error) or "There is not enough memory")
        for problem in problems:
            self.report({"WARNING" if imported else "ERROR"}, problem)
        if not imported:
            return {"CANCELLED"}
        for ob in [ob for rig in imported for ob in rig]:
            ob.select_set(True)
        meshes = [ob for ob, _armature in imported]
        vertices = sum(len(ob.data.vertices) for ob in meshes)
        self.report({"INFO"}, f"Imported {', '.join(ob.name for ob in meshes)}: {vertices:,} vertices")
        return {"FINISHED"}


class ExportRig(available.Explains, bpy.types.Operator, ExportHelper):
    """Write the active mesh, its skeleton, weights and poses as a rig folder"""

    bl_idname = "export_scene.sinew_rig"
    bl_label = "Export Sinew Rig"
    bl_options = {"PRESET"}

    filename_ext = ".bf"
    check_extension = None  # .tgf is accepted too
    filter_glob: StringProperty(default="*.bf;*.tgf", options={"HIDDEN"})
    animation: EnumProperty(
        name="Animation",
        description="What to write besides the rest pose",
        items=(
            (
                "AUTO",
                "Automatic",
                "The imported poses if they are shown, otherwise the scene's frames if the armature is animated",
            ),
            ("FRAMES", "Scene Frames", "The frames of the scene, as anim.dmat"),
            ("NONE", "None", "Only the rest pose"),
        ),
    )
    up_axis: EnumProperty(
        name="Up",
        description="The axis of the files that the mesh's Z axis becomes. An imported rig is written in the axes of "
        "its own files",
        items=(("Y", "Y", "Y is up, as in most .obj files"), ("Z", "Z", "Z is up, as in Blender")),
    )

    @classmethod
    def why_not(cls, context):
        return available.no_mesh(context.active_object)

    def execute(self, context):
        path = self.filepath
        if os.path.isdir(path):
            path = os.path.join(path, "skeleton.bf")
        try:
            with progress.shown(context) as shown:
                rig_export.export_rig(context, context.active_object, path, self.animation, self.up_axis, shown)
        except (ValueError, OSError, MemoryError) as error:
            self.report({"ERROR"}, str(error) or "There is not enough memory")
            return {"CANCELLED"}
        self.report({"INFO"}, f"Exported {context.active_object.name} to {os.path.dirname(path)}")
        return {"FINISHED"}


CLASSES = (ImportRig, ExportRig)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
