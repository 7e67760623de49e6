"""The settings of Sinew's own skinning methods and of its smoothing: `object.sinew.skinning`. None of them can be
animated, because the data of a method is computed once for all frames."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from ..install import bind
from ..run import characters

OVERRIDE = {"LIBRARY_OVERRIDABLE"}
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


def _show(settings, _context):
    ob = settings.id_data
    if ob.sinew.is_bound:
        characters.of(ob).look_again()
        ob.update_tag()


def _show_share(settings, context):
    if settings.id_data.sinew.is_bound:
        bind.follow_share(settings.id_data)
    _show(settings, context)


def _setting(kind, name, description, update=_show, **options):
    return kind(name=name, description=description, options=set(), override=OVERRIDE, update=update, **options)


class SinewSkinningSettings(bpy.types.PropertyGroup):
    """Settings of a mesh object: `object.sinew.skinning`."""

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
