"""What kinds of modifiers there are, and what they are called. Pure."""

# These change nothing but where vertices are. A cache can stand in for them.
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
# And these not even that. Blender puts new modifiers that want the vertices of the mesh itself, as Hooks do, behind all
# of both kinds, and before the first modifier of another one.
ONLY_DEFORMING = MOVING_VERTICES | {"COLLISION", "PARTICLE_SYSTEM", "SURFACE"}
# For which Sinew has native stages.
STAGES = {"CORRECTIVE_SMOOTH", "SMOOTH", "HOOK"}
# These play what was baked.
CACHES = {"MESH_CACHE", "MESH_SEQUENCE_CACHE"}


def title(modifier):
    """What Blender's menus call its type."""
    return modifier.bl_rna.properties["type"].enum_items[modifier.type].name


def name_and_title(modifier):
    """Its own name, as people see it in the stack, and its type's if the name does not say it."""
    return modifier.name if modifier.name.startswith(title(modifier)) else f"{modifier.name} ({title(modifier)})"
