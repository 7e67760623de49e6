"""The panels: where they appear (in the 3D view's sidebar, and in the Properties editor with the modifiers or the
armature's data), and when."""

from typing import Any

import bpy

from ..run import characters
from . import display, method_settings, sections, weight_tools, weights


class InSidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Sinew"


class InModifiers:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "modifier"


def layout_of(panel: Any) -> bpy.types.UILayout:
    panel.layout.use_property_split = True
    panel.layout.use_property_decorate = False
    return panel.layout


def bound_mesh(context: bpy.types.Context) -> bpy.types.Object | None:
    ob = context.object
    return ob if ob is not None and ob.type == "MESH" and ob.sinew.is_bound else None


class Main:
    bl_label = "Sinew"

    def draw(self, context):
        sections.draw_main(layout_of(self), context)


class Poses:
    bl_label = "Poses"

    @classmethod
    def poll(cls, context):
        ob = bound_mesh(context)
        return ob is not None and ob.sinew.source == "CLIP" and ob.sinew.armature is not None

    def draw(self, context):
        sections.draw_clip(layout_of(self), bound_mesh(context).sinew.armature)


class Influence:
    bl_label = "Influence"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return bool(bound_mesh(context) and bound_mesh(context).sinew.modifiers)

    def draw(self, context):
        sections.draw_influence(layout_of(self), bound_mesh(context))


def deformed_character(context: bpy.types.Context) -> Any:
    """Returns the character of a bound mesh that Sinew has deformed, or None."""
    ob = bound_mesh(context)
    entry = ob and characters.character(ob)
    return entry if entry and entry.deformer else None


class Smooth:
    bl_label = "Smooth"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return bound_mesh(context) is not None

    def draw(self, context):
        method_settings.draw_smoothing(layout_of(self), context.object)


class Details:
    bl_label = "Details"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return bound_mesh(context) is not None

    def draw(self, context):
        entry = deformed_character(context)
        if entry is not None:
            sections.draw_details(layout_of(self), context, entry)
        sections.draw_program(layout_of(self), context)


class SidebarMain(Main, InSidebar, bpy.types.Panel):
    bl_idname = "VIEW3D_PT_sinew"


class SidebarWeights(InSidebar, bpy.types.Panel):
    bl_idname, bl_parent_id = "VIEW3D_PT_sinew_weights", "VIEW3D_PT_sinew"
    bl_label = "Weights"

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type in {"MESH", "ARMATURE"}

    def draw(self, context):
        weights.draw(self.layout, context)
        weight_tools.draw_tools(self.layout)
        display.draw_bone_lines(self.layout)


class SidebarBakeAndCrowd(InSidebar, bpy.types.Panel):
    bl_idname, bl_parent_id = "VIEW3D_PT_sinew_bake_and_crowd", "VIEW3D_PT_sinew"
    bl_label = "Bake and Crowd"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type in {"MESH", "ARMATURE"}

    def draw(self, context):
        sections.draw_bake_and_crowd(self.layout, context)


class ModifiersMain(Main, InModifiers, bpy.types.Panel):
    bl_idname = "DATA_PT_sinew"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "MESH"


def _below(main: Any, place: Any) -> list[Any]:
    """Returns a panel for each section of a bound mesh, below the main panel of a place."""
    return [
        type(
            main.__name__.replace("Main", section.__name__),
            (section, place, bpy.types.Panel),
            {"bl_idname": f"{main.bl_idname}_{section.__name__.lower()}", "bl_parent_id": main.bl_idname},
        )
        for section in (Poses, Influence, Smooth, Details)
    ]


class ArmatureMain(Main, bpy.types.Panel):
    """In the data properties of an armature"""

    bl_idname = "DATA_PT_sinew_armature"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "data"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return context.object is not None and context.object.type == "ARMATURE"


CLASSES = (
    SidebarMain,
    *_below(SidebarMain, InSidebar),
    SidebarWeights,
    SidebarBakeAndCrowd,
    ModifiersMain,
    *_below(ModifiersMain, InModifiers),
    ArmatureMain,
)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
