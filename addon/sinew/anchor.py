"""Keeps Blender evaluating the armature of a bound mesh where nobody would show it: hidden, left out of a
render, in no scene at all.

The Armature modifier says by itself that the mesh needs the pose; on a bound mesh it is off. A driver on
the mesh object says it instead, of each bone that no other bone hangs on, and costs next to nothing. It
drives a number that nobody reads: a custom property, since a driver of one of Sinew's own would be
complained about where a file is opened without the add-on.
"""

PROPERTY = "sinew_anchor"
PATH = f'["{PROPERTY}"]'


def adapt(ob):
    """Gives the bound object the driver that it needs, or takes it away. Returns whether something had
    to be changed."""
    wanted = _targets(ob)
    driver = _driver(ob)
    present = [(target.id, target.bone_target) for variable in driver.driver.variables
               for target in variable.targets] if driver else []
    if (present == wanted and bool(wanted) == (PROPERTY in ob)) or ob.library is not None:
        return False
    remove(ob)
    if wanted:
        ob[PROPERTY] = 0.0
        ob.id_properties_ui(PROPERTY).update(
            description="Keeps the armature evaluated while Sinew deforms this object")
        driver = ob.driver_add(PATH).driver
        driver.type = "SUM"
        for armature, bone in wanted:
            variable = driver.variables.new()
            variable.type = "TRANSFORMS"
            variable.targets[0].id, variable.targets[0].bone_target = armature, bone
    return True


def remove(ob):
    if _driver(ob) is not None:
        ob.driver_remove(PATH)
    if PROPERTY in ob:
        del ob[PROPERTY]
    data = ob.animation_data
    if data and not (data.action or data.drivers or data.nla_tracks):
        ob.animation_data_clear()


def _driver(ob):
    return ob.animation_data and ob.animation_data.drivers.find(PATH)


def _targets(ob):
    """(armature, bone's name) of every bone that others depend on in no way; all others are evaluated for
    their sake. A parent is evaluated anyway."""
    armatures = {settings.armature: None for settings in ob.sinew.layers()
                 if settings.armature is not None and not _is_parent(settings.armature, ob)}
    return [(armature, bone.name) for armature in armatures for bone in armature.data.bones
            if not bone.children or bone.bbone_segments > 1]


def _is_parent(armature, ob):
    return ob.parent == armature and ob.parent_type in {"OBJECT", "ARMATURE"}
