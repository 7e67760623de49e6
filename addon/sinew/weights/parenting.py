"""Parents meshes to an armature as Blender's Object > Parent > Armature Deform does."""

import bpy

from ..blender import armatures
from ..plan import bindable


def refuse(ob: bpy.types.Object, armature: bpy.types.Object) -> None:
    """Raises ValueError if the object cannot become the armature's child."""
    above = armature
    while (above := above.parent) is not None:
        if above == ob:
            raise ValueError(
                f"{ob.name} is above {armature.name} in the chain of parents, which would make a loop: clear that "
                "parent first"
            )


def deformed_twice(ob: bpy.types.Object, armature: bpy.types.Object) -> str:
    """Returns a warning, a sentence, if other armatures deform the object too; otherwise ""."""
    others = {each.name: None for each in armatures.of_modifiers(ob) if each != armature}
    if not others:
        return ""
    names = " and ".join(others)
    return (
        f"{ob.name} is deformed by {names}, too: remove that Armature modifier if only {armature.name} should move it"
    )


def parent(ob: bpy.types.Object, armature: bpy.types.Object) -> None:
    """Makes the armature the object's parent, unless it is, and adds an Armature modifier, unless there is one for this
    armature. The object stays where it is."""
    if ob.parent != armature or ob.parent_type != "OBJECT":
        place, had_parent = ob.matrix_world.copy(), ob.parent is not None
        ob.parent, ob.parent_type, ob.parent_bone = armature, "OBJECT", ""
        ob.matrix_parent_inverse = armature.matrix_world.inverted_safe()
        if had_parent:
            ob.matrix_world = place
    if bindable.armature_modifier(ob, armature) is None:
        ob.modifiers.new("Armature", "ARMATURE").object = armature
