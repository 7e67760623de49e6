"""The user's settings, saved in the .blend: on the mesh object, how it is deformed; on the armature object, how the
clip of an imported rig plays."""

from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from ..chain import methods
from ..deform import choices
from ..install import bind, deformed_copy
from ..install.deformed_copy import OutputError
from ..install.old_files import SinewReplacedModifier
from ..plan import wiring
from ..run import characters, errors, in_pass

OVERRIDE = {"LIBRARY_OVERRIDABLE"}  # an override of a linked character keeps its own settings
LAPLACIANS = (
    ("COTANGENT", "Cotangent", "Edges count by the angles across them, so that the shape does not depend on the mesh"),
    ("UNIFORM", "Uniform", "All edges count alike: for meshes with bad triangles"),
)
VARIANTS = (
    ("0", "Full", "Ten numbers per vertex and bone: the full method"),
    ("1", "Inverse Transpose", "Ten numbers, turned by the inverse transpose of the deformation, which shears"),
    ("2", "Blended Quaternions", "Four numbers: translations of bones no longer turn the surface"),
    ("3", "Blended Matrices", "Four numbers, turned by blended matrices"),
    ("4", "Smoothed Center", "One number, turned about the smoothed rest position"),
    ("5", "Smoothed Weights", "One number: linear skinning by smoothed weights"),
)
CLIP_MODES = (
    ("REST", "Rest", "The rest pose"),
    ("POSED", "Posed", "The last pose"),
    ("FACTOR", "Factor", "Between the first and the last pose, by the factor"),
    ("SWING", "Swing", "To the last pose and back, as |sin(seconds)|"),
    ("PLAYBACK", "Playback", "One pose after the other with the frames of the scene"),
)


def _show(settings, _context):
    ob = settings.id_data
    if ob.sinew.is_bound:
        characters.of(ob).look_again()
        ob.update_tag()


def _show_share(settings, context):
    if settings.id_data.sinew.is_bound:
        bind.follow_share(settings.id_data)
    _show(settings, context)


def _setting(kind, name, description, update=_show, **more):
    """Returns the property of a setting of a method."""
    return _property(kind, name, description, update=update, options=set(), **more)


def _property(kind, name, description, **more):
    return kind(name=name, description=description, override=OVERRIDE, **more)


class SinewSkinningSettings(bpy.types.PropertyGroup):
    """Settings of Sinew's own skinning methods and of its smoothing: `object.sinew.skinning`. None of them can be
    animated, because the data of a method is computed once for all frames."""

    # For the method Blended.
    share: _setting(
        FloatProperty,
        "Share",
        "For all vertices, if there is no vertex group: 0 is linear, 1 is dual quaternion skinning",
        _show_share,
        min=0.0,
        max=1.0,
        default=0.5,
        subtype="FACTOR",
    )
    share_group: _setting(
        StringProperty,
        "Share",
        "Vertex group that holds the share of dual quaternion skinning; it can be painted",
        _show_share,
    )
    share_invert: _setting(BoolProperty, "Invert", "Weight 1 is linear, 0 is dual quaternion skinning")

    # For Centers of Rotation.
    sigma: _setting(
        FloatProperty,
        "Width",
        "How different the weights of two vertices may be for one to count for the center of the other",
        min=0.001,
        max=10.0,
        default=0.1,
    )

    # For Direct Delta Mush.
    smoothing: _setting(
        FloatProperty, "Smoothing", "How far the shape is smoothed on each iteration", min=0.0, max=1000.0, default=3.0
    )
    weight_smoothing: _setting(
        FloatProperty, "Weights", "How far weights are smoothed on each iteration", min=0.0, max=1000.0, default=1.0
    )
    blend: _setting(
        FloatProperty,
        "Blend",
        "How much of the translation comes from smoothed weights alone: less bulging at 1",
        min=0.0,
        max=1.0,
        default=0.8,
        subtype="FACTOR",
    )
    iterations: _setting(
        IntProperty, "Iterations", "How many times shape and weights are smoothed", min=0, max=200, default=20
    )
    laplacian: _setting(EnumProperty, "Laplacian", "How the edges of the mesh are weighted", items=LAPLACIANS)
    variant: _setting(
        EnumProperty, "Variant", "How much is kept for each vertex: less is faster and rougher", items=VARIANTS
    )

    # For smoothing after any method.
    smooth_iterations: _setting(
        IntProperty,
        "Iterations",
        "How many times the deformed shape is smoothed before the detail of the rest shape is put back (delta mush), "
        "as a Corrective Smooth modifier does; 0 switches this off",
        min=0,
        max=200,
        default=0,
    )
    smooth_factor: _setting(
        FloatProperty, "Factor", "How far each iteration smooths", min=0.0, max=1.0, default=0.5, subtype="FACTOR"
    )
    smooth_group: _setting(StringProperty, "Group", "Vertex group that says what is smoothed, and how much")
    smooth_invert: _setting(BoolProperty, "Invert", "Smooth what is not in the group")

    data: PointerProperty(
        type=bpy.types.Text,
        options={"HIDDEN"},
        override=OVERRIDE,
        description="What the method has computed, kept in the file",
    )


def _apply_output(settings, _context):
    if settings.is_bound:
        try:
            bind.switch_output(settings.id_data)
        except OutputError as error:
            errors.report(settings.id_data, str(error))


def _apply_show_shape(settings, _context):
    if settings.is_bound and settings.installed_output == "MESH":
        bind.show(settings.id_data)


def _apply_source(settings, _context):
    if settings.is_bound:
        characters.see(settings.id_data)
    if settings.is_bound and settings.source == "CLIP" and settings.armature is not None:
        bind.show_clip(settings.armature)


def _apply_clip(settings, _context):
    bind.show_clip(settings.id_data)


def _read_method(settings):
    if settings.own_method in methods.OWN:
        return [name for name, *_texts in choices.METHODS].index(settings.own_method)
    modifier = settings.modifier
    return int(modifier is not None and modifier.use_deform_preserve_volume)


def _write_method(settings, number):
    if settings.modifier is not None:
        bind.switch_method(settings.id_data, choices.METHODS[number][0])


def _deform_now(settings):
    in_pass.deform_now(settings.id_data)
    return 0.0


class SinewObjectSettings(bpy.types.PropertyGroup):
    """Settings of a mesh object, `object.sinew`. What an Armature modifier can define is set in the modifier itself."""

    method: EnumProperty(
        items=choices.METHODS,
        name="Method",
        description="How the joints' motions are blended. The first two are the Armature modifier's",
        get=_read_method,
        set=_write_method,
    )
    source: _property(
        EnumProperty,
        "Pose",
        "Where the pose comes from",
        items=choices.SOURCES,
        default="ARMATURE",
        update=_apply_source,
    )
    output: _property(
        EnumProperty, "Output", "Where the deformed positions go", items=choices.OUTPUTS, update=_apply_output
    )
    show_shape: _property(
        BoolProperty,
        "Deform",
        "With the output Mesh: write the deformed shape into the copy. If off, the copy has the rest shape",
        default=True,
        update=_apply_show_shape,
    )

    skinning: PointerProperty(type=SinewSkinningSettings, name="Skinning", override=OVERRIDE)

    # Set by bind.py, not by the user.
    own_method: StringProperty(options={"HIDDEN"}, override=OVERRIDE)  # of methods.OWN; "": the modifier's
    is_bound: BoolProperty(options={"HIDDEN"}, override=OVERRIDE)
    installed_output: EnumProperty(items=choices.OUTPUTS, options={"HIDDEN"}, override=OVERRIDE)
    has_added_modifier: BoolProperty(options={"HIDDEN"}, override=OVERRIDE)
    needs_attribute: BoolProperty(options={"HIDDEN"}, override=OVERRIDE)  # or a canvas, and Sinew's own modifier
    canvas: PointerProperty(type=bpy.types.Object, options={"HIDDEN"}, override=OVERRIDE)  # see canvases.py
    last_armature: PointerProperty(type=bpy.types.Object, options={"HIDDEN"}, override=OVERRIDE)

    # Of a deformed copy (deformed_copy.py): the name of its object, the number of vertices that it was given, and the
    # edition of the object's mesh that it was made from.
    copied_from: StringProperty(options={"HIDDEN"}, override=OVERRIDE)
    copied_vertices: IntProperty(options={"HIDDEN"}, override=OVERRIDE)
    copied_edition: IntProperty(options={"HIDDEN"}, override=OVERRIDE)

    # While the mesh plays a cache (bake/mesh_cache.py): the state to restore, as JSON.
    cache_kept: StringProperty(options={"HIDDEN"}, override=OVERRIDE)

    # From older files, see old_files.py.
    held: StringProperty(options={"HIDDEN"}, override=OVERRIDE)
    replaced: CollectionProperty(
        type=SinewReplacedModifier, options={"HIDDEN"}, override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"}
    )

    # Read by the hook of wiring.py.
    deform_now: FloatProperty(options={"HIDDEN"}, get=_deform_now)

    @property
    def deformed(self) -> bpy.types.Object | None:
        """The deformed copy of a mesh with the output Mesh, or None."""
        return deformed_copy.find(self.id_data) if deformed_copy.is_wanted_by(self.id_data) else None

    @property
    def copy_of(self) -> bpy.types.Object | None:
        """The object whose deformed copy this is, or None."""
        return self.id_data.parent if self.copied_from else None

    @property
    def modifiers(self) -> list[bpy.types.Modifier]:
        """The Armature modifiers that Sinew replaces, in the order in which they are mixed."""
        return wiring.taken_modifiers(self.id_data)

    @property
    def modifier(self) -> Any:
        """The first Armature modifier that Sinew replaces, or None."""
        return next(iter(self.modifiers), None)

    @property
    def armature(self) -> bpy.types.Object | None:
        """The armature of the first Armature modifier that Sinew replaces, or None."""
        return self.modifier and self.modifier.object

    @armature.setter
    def armature(self, armature: bpy.types.Object) -> None:
        self.modifier.object = armature


class SinewClipSettings(bpy.types.PropertyGroup):
    """Settings of an armature object, `object.sinew_clip`: how the imported poses play."""

    mode: _property(EnumProperty, "Mode", "Which of the rig's poses is shown", items=CLIP_MODES, update=_apply_clip)
    factor: _property(
        FloatProperty,
        "Factor",
        "0 is the first pose, 1 the last",
        min=0.0,
        max=1.0,
        default=1.0,
        subtype="FACTOR",
        update=_apply_clip,
    )
    frame_start: _property(
        FloatProperty, "Start Frame", "The scene's frame that shows the first pose", default=1.0, update=_apply_clip
    )
    speed: _property(
        FloatProperty, "Speed", "Poses per frame", default=1.0, soft_min=-4.0, soft_max=4.0, update=_apply_clip
    )
    loop: _property(BoolProperty, "Loop", "Begin again after the last pose", default=True, update=_apply_clip)


CLASSES = (SinewReplacedModifier, SinewSkinningSettings, SinewObjectSettings, SinewClipSettings)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.sinew = PointerProperty(type=SinewObjectSettings, override=OVERRIDE)
    bpy.types.Object.sinew_clip = PointerProperty(type=SinewClipSettings, override=OVERRIDE)


def unregister() -> None:
    del bpy.types.Object.sinew_clip
    del bpy.types.Object.sinew
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
