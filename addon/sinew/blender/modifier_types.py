"""Lists types of modifiers, and returns their names in Blender's menus. Does not use bpy."""

from typing import Any

# Modifiers that change only the positions of vertices. A cache can replace them.
MOVING_VERTICES = {
    "ARMATURE",
    "CAST",
    "CLOTH",
    "CORRECTIVE_SMOOTH",
    "CURVE",
    "DISPLACE",
    "HOOK",
    "LAPLACIANDEFORM",
    "LAPLACIANSMOOTH",
    "LATTICE",
    "MESH_CACHE",
    "MESH_DEFORM",
    "SHRINKWRAP",
    "SIMPLE_DEFORM",
    "SMOOTH",
    "SOFT_BODY",
    "SURFACE_DEFORM",
    "VOLUME_DISPLACE",
    "WARP",
    "WAVE",
}
# With those that do not change even that. Blender inserts a new modifier that needs the original vertices, such as a
# Hook, before the first modifier that is not of these types.
ONLY_DEFORMING = MOVING_VERTICES | {"COLLISION", "PARTICLE_SYSTEM", "SURFACE"}
# Blender allows only deforming modifiers before these.
ONLY_BEHIND_DEFORMING = {"MULTIRES", "SOFT_BODY"}
# Modifiers that change neither the vertices nor their positions, and that do not depend on positions either, unless a
# texture is laid over them.
BESIDE_SHAPE = {"UV_WARP", "VERTEX_WEIGHT_EDIT", "VERTEX_WEIGHT_MIX"}
# Modifiers that change neither the vertices nor their positions, but depend on them.
READING_SHAPE = {
    "COLLISION",
    "DATA_TRANSFER",
    "NORMAL_EDIT",
    "UV_PROJECT",
    "VERTEX_WEIGHT_PROXIMITY",
    "WEIGHTED_NORMAL",
}
# Of those, the ones that change a vertex group: the property that names it.
CHANGED_GROUPS = {
    "VERTEX_WEIGHT_EDIT": "vertex_group",
    "VERTEX_WEIGHT_MIX": "vertex_group_a",
    "VERTEX_WEIGHT_PROXIMITY": "vertex_group",
}
# Modifiers that move a mesh with the shape of another object, and for which Sinew has native stages.
CAGES = {"LATTICE", "MESH_DEFORM", "SURFACE_DEFORM"}
# Of those, the ones whose input Blender keeps for the Armature modifiers right behind them that have Multi Modifier.
MIXED_IN = {"LATTICE", "MESH_DEFORM"}
# Modifiers that make other vertices, and with whose result Sinew may begin: all their settings are plain values, and
# without other objects and animation it changes only after an edit.
FRONTS = {"ARRAY", "BEVEL", "DECIMATE", "EDGE_SPLIT", "MASK", "MIRROR", "SOLIDIFY", "SUBSURF", "TRIANGULATE", "WELD"}
# Modifiers behind the run whose result Sinew may compute with stencils.
TAILS = {"ARRAY", "EDGE_SPLIT", "MASK", "MIRROR", "SUBSURF", "TRIANGULATE"}
# Of those, the ones that place copies: mirrored or shifted.
PLACING = {"ARRAY", "MIRROR"}
# Modifiers whose result at the end of a stack Blender makes when somebody reads it, or leaves to the graphics card.
DEFERRED = {"SUBSURF", "MULTIRES"}
# Modifiers for which Sinew has native stages.
STAGES = {"ARMATURE", "CORRECTIVE_SMOOTH", "SMOOTH", "HOOK"} | CAGES
# Modifiers that play a baked file.
CACHES = {"MESH_CACHE", "MESH_SEQUENCE_CACHE"}


def title(modifier: Any) -> str:
    """Returns the name of the modifier's type in Blender's menus."""
    return modifier.bl_rna.properties["type"].enum_items[modifier.type].name
