"""What the user can set, saved in the .blend: on the mesh object how it is deformed, on the armature
object how the clip of an imported rig plays."""

import bpy
from bpy.props import (
    BoolProperty, CollectionProperty, EnumProperty, FloatProperty, PointerProperty, StringProperty)

from . import binding, session
from .outputs import OutputError

METHODS = (
    ("LINEAR", "Linear", "Linear blend skinning: what the Armature modifier does by default"),
    ("DUAL_QUATERNION", "Dual Quaternion",
     "Dual quaternion skinning: keeps the volume of twisted and bent limbs, as the Armature "
     "modifier does with Preserve Volume"),
)
SOURCES = (
    ("CLIP", "Rig's Poses", "The poses that were imported with the rig; the armature follows them"),
    ("ARMATURE", "Armature", "The armature as Blender poses it: keyframes, constraints, drivers, "
     "posing by hand"),
)
OUTPUT_ITEMS = (
    ("MODIFIER", "Modifier", "Show the shape through a modifier: the mesh keeps its rest shape"),
    ("MESH", "Mesh", "Write the shape into the mesh's own vertices, for scripts and exporters; "
     "the rest shape is kept aside and comes back on unbinding"),
)
CLIP_MODES = (
    ("REST", "Rest", "The rest pose"),
    ("POSED", "Posed", "The last pose"),
    ("FACTOR", "Factor", "Between the first and the last pose, by the factor"),
    ("SWING", "Swing", "To the last pose and back, as |sin(seconds)|"),
    ("PLAYBACK", "Playback", "One pose after the other with the frames of the scene"),
)

# An override of a linked character keeps its own settings.
OVERRIDE = {"LIBRARY_OVERRIDABLE"}
OVERRIDE_LIST = {"LIBRARY_OVERRIDABLE", "USE_INSERTION"}


def _apply(settings, _context):
    session.refresh(settings.id_data)


def _apply_output(settings, _context):
    if settings.is_bound:
        try:
            binding.switch_output(settings.id_data)
        except OutputError as error:
            session.report(settings.id_data, str(error))


def _apply_show_shape(settings, _context):
    if settings.is_bound and settings.installed_output == "MESH":
        if settings.show_shape:
            session.refresh(settings.id_data)
        else:
            binding.show_rest(settings.id_data)


def _apply_armature(settings, _context):
    if settings.id_data.sinew.is_bound:
        session.forget_object(settings.id_data)
        session.refresh(settings.id_data)


def _apply_clip(settings, _context):
    session.refresh_armature(settings.id_data)


class LayerSettings:
    """What an Armature modifier says."""

    armature: PointerProperty(
        type=bpy.types.Object, name="Armature", description="The armature that deforms this mesh",
        poll=lambda _self, ob: ob.type == "ARMATURE", update=_apply_armature, override=OVERRIDE)
    method: EnumProperty(
        items=METHODS, name="Method", description="How the joints' motions are blended",
        update=_apply, override=OVERRIDE)
    use_vertex_groups: BoolProperty(
        name="Vertex Groups", description="Weights come from vertex groups named after bones",
        default=True, update=_apply, override=OVERRIDE)
    use_envelopes: BoolProperty(
        name="Bone Envelopes", description="Vertices without weights follow the bones whose "
        "envelopes hold them", update=_apply, override=OVERRIDE)
    mask_group: StringProperty(
        name="Mask", description="Vertex group that says how much of the motion each vertex takes "
        "part in; empty: all of it", update=_apply, override=OVERRIDE)
    mask_invert: BoolProperty(
        name="Invert", description="Turn the mask round", update=_apply, override=OVERRIDE)


class SinewMixedLayer(LayerSettings, bpy.types.PropertyGroup):
    """Of a mesh on which Multi Modifier mixed Armature modifiers: what the second, third, ... say."""


class SinewReplacedModifier(bpy.types.PropertyGroup):
    """An Armature modifier that is switched off while its mesh is bound, and how it was."""

    name: StringProperty(override=OVERRIDE)
    object: PointerProperty(type=bpy.types.Object, override=OVERRIDE)
    show_viewport: BoolProperty(override=OVERRIDE)
    show_render: BoolProperty(override=OVERRIDE)


class SinewObjectSettings(LayerSettings, bpy.types.PropertyGroup):
    """On mesh objects: `object.sinew`."""

    source: EnumProperty(
        items=SOURCES, name="Pose", description="Where the pose comes from", default="ARMATURE",
        update=_apply, override=OVERRIDE)
    output: EnumProperty(
        items=OUTPUT_ITEMS, name="Output", description="Where the deformed positions go",
        update=_apply_output, override=OVERRIDE)
    show_shape: BoolProperty(
        name="Deform", default=True, update=_apply_show_shape, override=OVERRIDE,
        description="Write the deformed shape into the mesh; off: the rest shape (output Mesh)")
    mixed: CollectionProperty(type=SinewMixedLayer, override=OVERRIDE_LIST)

    # Kept by binding.py, not for people to set.
    is_bound: BoolProperty(options={"HIDDEN"}, override=OVERRIDE)
    installed_output: EnumProperty(items=OUTPUT_ITEMS, options={"HIDDEN"}, override=OVERRIDE)
    replaced: CollectionProperty(type=SinewReplacedModifier, options={"HIDDEN"}, override=OVERRIDE_LIST)

    def shows_shape(self):
        """Whether the shape is wanted at all. The output Modifier has its modifier's own switches."""
        return self.show_shape or self.installed_output != "MESH"

    def layers(self):
        """The settings of each layer, in the order in which they are mixed."""
        return (self, *self.mixed)


class SinewClipSettings(bpy.types.PropertyGroup):
    """On armature objects: `object.sinew_clip`, how the imported poses play."""

    mode: EnumProperty(
        items=CLIP_MODES, name="Mode", description="Which of the rig's poses is shown",
        update=_apply_clip, override=OVERRIDE)
    factor: FloatProperty(
        name="Factor", description="0 is the first pose, 1 the last", min=0.0, max=1.0,
        default=1.0, subtype="FACTOR", update=_apply_clip, override=OVERRIDE)
    frame_start: FloatProperty(
        name="Start Frame", description="The scene's frame that shows the first pose", default=1.0,
        update=_apply_clip, override=OVERRIDE)
    speed: FloatProperty(
        name="Speed", description="Poses a frame", default=1.0, soft_min=-4.0, soft_max=4.0,
        update=_apply_clip, override=OVERRIDE)
    loop: BoolProperty(
        name="Loop", description="Begin again after the last pose", default=True,
        update=_apply_clip, override=OVERRIDE)


CLASSES = (SinewMixedLayer, SinewReplacedModifier, SinewObjectSettings, SinewClipSettings)


def register():
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.sinew = PointerProperty(
        type=SinewObjectSettings, override=OVERRIDE)
    bpy.types.Object.sinew_clip = PointerProperty(
        type=SinewClipSettings, override=OVERRIDE)


def unregister():
    del bpy.types.Object.sinew_clip
    del bpy.types.Object.sinew
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
