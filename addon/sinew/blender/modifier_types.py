"""Lists types of modifiers, and returns their names in the interface. Does not use bpy."""

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
# Modifiers for which Sinew has native stages.
STAGES = {"CORRECTIVE_SMOOTH", "SMOOTH", "HOOK"}
# Modifiers that play a baked file.
CACHES = {"MESH_CACHE", "MESH_SEQUENCE_CACHE"}


def title(modifier: Any) -> str:
    """Returns the name of the modifier's type in Blender's menus."""
    return modifier.bl_rna.properties["type"].enum_items[modifier.type].name


def name_and_title(modifier: Any) -> str:
    """Returns the modifier's name as shown in the stack, followed by its type unless the name begins with it."""
    return modifier.name if modifier.name.startswith(title(modifier)) else f"{modifier.name} ({title(modifier)})"
