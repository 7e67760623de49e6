"""Modifiers: added, set, moved, switched, renamed, removed, applied."""

import bpy
import numpy as np
from mathutils import Euler, Matrix

from helpers import select

from . import scene
from .kinds import on_both
from .mesh_steps import keys_of

# What Sinew stands in for, what it steps over, what may be a front, what it does not know, and what wants to stand
# behind deforming modifiers alone.
TYPES = {
    "CORRECTIVE_SMOOTH": 6,
    "SMOOTH": 5,
    "HOOK": 3,
    "ARMATURE": 3,
    "LATTICE": 3,
    "SURFACE_DEFORM": 2,
    "MESH_DEFORM": 1,
    "UV_WARP": 0.5,
    "VERTEX_WEIGHT_EDIT": 0.7,
    "TRIANGULATE": 0.7,
    "SOLIDIFY": 0.5,
    "SUBSURF": 2.5,
    "MIRROR": 1,
    "ARRAY": 0.5,
    "CAST": 1,
    "WAVE": 1,
    "SIMPLE_DEFORM": 1,
    "MASK": 1,
    "EDGE_SPLIT": 0.7,
    "MULTIRES": 0.7,
    "COLLISION": 1,
}
DEFORMING = {"ARMATURE", "CORRECTIVE_SMOOTH", "SMOOTH", "HOOK", "LATTICE", "SURFACE_DEFORM", "MESH_DEFORM"}
TAIL = ("SUBSURF", "SUBSURF", "MASK", "EDGE_SPLIT", "TRIANGULATE", "MIRROR", "ARRAY")
# The operators that bind modifiers to a cage.
BINDING = {"SURFACE_DEFORM": "surfacedeform_bind", "MESH_DEFORM": "meshdeform_bind"}
# What makes more vertices.
GROWING = {"SUBSURF", "MIRROR", "ARRAY", "SOLIDIFY"}
MOST = 8  # modifiers of a mesh
MOST_VERTICES = 6000  # of an evaluated one, roughly


def own(ob):
    """Those that people have added."""
    return [modifier for modifier in ob.modifiers if modifier.type != "NODES"]


def one_of(random, ob, *types):
    found = [modifier for modifier in own(ob) if not types or modifier.type in types]
    return random.choice(found) if found else None


def group_of(random, ob):
    return random.choice(("", "gone", *(group.name for group in ob.vertex_groups)))


@on_both(8)
def add_modifier(random, ob):
    kind = random.choices(list(TYPES), list(TYPES.values()))[0]
    name, many = f"{kind.capitalize()} {random.randrange(100)}", kind in GROWING
    if len(own(ob)) >= MOST or many and any(modifier.type in GROWING for modifier in ob.modifiers):
        return
    if kind in {"HOOK", "MULTIRES"} and not is_evaluated(ob):
        return  # Blender puts it before Sinew's, which is mended when the mesh is evaluated
    modifier = ob.modifiers.new(name, kind)
    if modifier is None:
        return  # an object has only one such as Collision
    set_modifier(random, ob, modifier)
    if kind in BINDING and random.random() < 0.7:
        first = one_of(random, ob, "ARMATURE")
        select(ob)
        bpy.ops.object.modifier_move_to_index(
            modifier=modifier.name, index=ob.modifiers.find(first.name) + 1 if first else 0
        )
        bind(ob, modifier)


def bind(ob, modifier):
    """Binds a modifier to a cage, or unbinds it."""
    if ob.visible_get():
        select(ob)
        getattr(bpy.ops.object, BINDING[modifier.type])(modifier=modifier.name)


@on_both(4)
def add_armature_behind(random, ob):
    """One that Sinew can take over, right behind another one or at the end."""
    first = one_of(random, ob, "ARMATURE")
    if first is None or len(own(ob)) >= MOST:
        return
    modifier = ob.modifiers.new(f"Behind {random.randrange(100)}", "ARMATURE")
    modifier.object = random.choice((first.object, *scene.armatures()))
    modifier.use_deform_preserve_volume = random.random() < 0.5
    modifier.use_multi_modifier = random.random() < 0.2
    modifier.show_viewport, modifier.show_render = first.show_viewport, first.show_render
    if random.random() < 0.4:
        modifier.vertex_group, modifier.invert_vertex_group = group_of(random, ob), random.random() < 0.3
    if random.random() < 0.6:
        select(ob)
        bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=ob.modifiers.find(first.name) + 1)


@on_both(5)
def end_in_a_tail(random, ob):
    """In place of what is behind the modifiers that deform: some whose vertices are weighted sums, and one that has
    Blender make them."""
    for modifier in own(ob):
        if modifier.type not in DEFORMING:
            ob.modifiers.remove(modifier)
    for kind in random.choices(TAIL, k=random.randint(1, 2)):
        if len(own(ob)) < MOST and not (kind in GROWING and any(each.type in GROWING for each in ob.modifiers)):
            modifier = ob.modifiers.new(f"{kind.capitalize()} {random.randrange(100)}", kind)
            set_modifier(random, ob, modifier)
            if kind == "EDGE_SPLIT":
                modifier.use_edge_angle = False
    ob.modifiers.new(f"Last {random.randrange(100)}", random.choice(("UV_WARP", "SOLIDIFY", "CAST", "SUBSURF")))


def is_evaluated(ob):
    """Before 3.5 Blender gives up the driver of a mesh that has no vertex."""
    return ob.visible_get() and (bpy.app.version >= (3, 5, 0) or len(ob.data.vertices) > 0)


@on_both(6)
def change_modifier(random, ob):
    modifier = one_of(random, ob)
    if modifier:
        set_modifier(random, ob, modifier)


def set_modifier(random, ob, modifier):
    if modifier.type == "CORRECTIVE_SMOOTH":
        modifier.factor, modifier.iterations = random.uniform(-0.2, 1), random.randrange(10)
        modifier.scale = random.choice((1, 1, 0.4))
        modifier.smooth_type = random.choice(("SIMPLE", "LENGTH_WEIGHTED"))
        modifier.use_only_smooth, modifier.use_pin_boundary = random.random() < 0.2, random.random() < 0.3
    elif modifier.type == "SMOOTH":
        modifier.factor, modifier.iterations = random.uniform(-0.2, 1), random.randrange(6)
        modifier.use_x = random.random() < 0.8
    elif modifier.type == "HOOK":
        rigs = [each for each in scene.armatures() if len(each.data.bones)]
        modifier.object = random.choice((None, *targets(), *rigs))
        is_bone = modifier.object in rigs
        modifier.subtarget = random.choice(modifier.object.data.bones.keys()) if is_bone else ""
        modifier.matrix_inverse = Euler(scene.some(random, 0.3)).to_matrix().to_4x4() @ Matrix.Translation((-0.5, 0, 0))
        modifier.vertex_indices_set(range(random.randrange(20), 1200, random.randint(2, 9)))
        modifier.strength, modifier.falloff_radius = random.uniform(0, 1), random.uniform(0, 3)
        modifier.falloff_type = random.choice(("NONE", "SMOOTH", "ROOT", "CURVE"))
        modifier.use_falloff_uniform = random.random() < 0.3
    elif modifier.type == "ARMATURE":
        modifier.object = random.choice((*scene.armatures(), *scene.armatures(), None))
        modifier.use_deform_preserve_volume = random.random() < 0.5
        modifier.use_multi_modifier = random.random() < 0.4
        modifier.use_bone_envelopes = random.random() < 0.15
        modifier.use_vertex_groups = random.random() < 0.9
    elif modifier.type == "LATTICE":
        modifier.object = random.choice((bpy.data.objects.get("Cage"), bpy.data.objects.get("Cage"), None))
        modifier.strength = random.uniform(-0.2, 1.2)
    elif modifier.type == "SURFACE_DEFORM":
        if not modifier.is_bound:
            modifier.target = bpy.data.objects.get("Body")
        modifier.strength = random.uniform(0, 1.2)
    elif modifier.type == "MESH_DEFORM":
        if not modifier.is_bound:
            modifier.object, modifier.precision = bpy.data.objects.get("Box"), 3
    elif modifier.type == "VERTEX_WEIGHT_EDIT":
        modifier.vertex_group = random.choice(ob.vertex_groups.keys() or [""])
        modifier.use_add, modifier.add_threshold = True, random.uniform(0, 0.5)
        modifier.default_weight = random.uniform(0, 0.5)
    elif modifier.type == "SUBSURF":
        modifier.levels = modifier.render_levels = 1 if len(ob.data.vertices) < MOST_VERTICES / 4 else 0
        modifier.subdivision_type = random.choice(("CATMULL_CLARK", "CATMULL_CLARK", "SIMPLE"))
        modifier.use_limit_surface = random.random() < 0.6
    elif modifier.type == "EDGE_SPLIT":
        modifier.use_edge_angle = random.random() < 0.2
    elif modifier.type == "TRIANGULATE":
        modifier.quad_method = random.choice(("FIXED", "FIXED_ALTERNATE"))  # others decide by the last bits
    elif modifier.type == "MIRROR":
        modifier.use_mirror_merge = modifier.use_mirror_vertex_groups = False
    elif modifier.type == "ARRAY":
        modifier.use_constant_offset, modifier.use_relative_offset = True, random.random() < 0.2
        modifier.constant_offset_displace = scene.some(random, 3)
    elif modifier.type == "WAVE":
        modifier.height, modifier.time_offset = random.uniform(0.1, 0.5), -random.randrange(50)
    elif modifier.type == "MASK":
        modifier.vertex_group = random.choice(ob.vertex_groups.keys() or [""])
        modifier.invert_vertex_group = random.random() < 0.3
    if hasattr(modifier, "invert_vertex_group") and modifier.type not in {"MASK", "SOLIDIFY"} and random.random() < 0.4:
        modifier.vertex_group = group_of(random, ob)
        modifier.invert_vertex_group = random.random() < 0.3


def targets():
    return [ob for ob in bpy.context.view_layer.objects if ob.name.startswith("Target")]


@on_both(3)
def switch_modifier(random, ob):
    modifier = one_of(random, ob)
    if modifier:
        if random.random() < 0.7:
            modifier.show_viewport = not modifier.show_viewport
        if random.random() < 0.5:
            modifier.show_render = modifier.show_viewport


@on_both(1)
def show_all_modifiers(random, ob):
    for modifier in own(ob):
        modifier.show_viewport = modifier.show_render = True


@on_both(3)
def move_modifier(random, ob):
    """Before or behind another one."""
    modifier, other = one_of(random, ob), one_of(random, ob)
    if modifier:
        select(ob)
        bpy.ops.object.modifier_move_to_index(modifier=modifier.name, index=ob.modifiers.find(other.name))


@on_both(1)
def rename_modifier(random, ob):
    modifier = one_of(random, ob)
    if modifier:
        modifier.name = random.choice(('The "one"', "Modifier", "Ärmel", "Armature"))


@on_both(3)
def remove_modifier(random, ob):
    modifier = one_of(random, ob)
    if modifier:
        ob.modifiers.remove(modifier)


@on_both(2)
def apply_modifier(random, ob):
    """But a Corrective Smooth among others, for which the manual says to unbind first: it takes the shape of the moment
    for its rest shape, which bound meshes have elsewhere."""
    modifier = own(ob)[0] if own(ob) and random.random() < 0.7 else one_of(random, ob)
    if not are_poses_written_back(ob):
        return
    if modifier and (modifier.type != "CORRECTIVE_SMOOTH" or len(own(ob)) == 1):
        select(ob)
        bpy.ops.object.modifier_apply(modifier=modifier.name)


def are_poses_written_back(ob):
    """Whether the original armatures have the pose that was evaluated. After a scene was removed, they may have that of
    the other scene; 3.4 applies from there what Sinew has switched off."""
    graph = bpy.context.evaluated_depsgraph_get()
    rigs = [modifier.object for modifier in own(ob) if modifier.type == "ARMATURE" and modifier.object]
    return all(
        np.allclose(bone.matrix_channel, seen.matrix_channel, atol=1e-4, equal_nan=True)
        for rig in rigs
        for bone, seen in zip(rig.pose.bones, rig.evaluated_get(graph).pose.bones)
    )


@on_both(0.7)
def apply_as_shape_key(random, ob):
    """But for one among others on a mesh that has keys already: Blender starts from the evaluated keys, in which a
    bound mesh has its whole shape. The manual says to unbind first."""
    modifier = one_of(random, ob, "ARMATURE", "CAST", "HOOK")
    if not are_poses_written_back(ob):
        return
    if modifier and (not keys_of(ob) or len(own(ob)) == 1 and modifier.type != "HOOK"):
        select(ob)
        bpy.ops.object.modifier_apply_as_shapekey(keep_modifier=random.random() < 0.5, modifier=modifier.name)


@on_both(0.7)
def copy_modifier(random, ob):
    modifier = one_of(random, ob)
    if modifier and len(own(ob)) < MOST:
        select(ob)
        bpy.ops.object.modifier_copy(modifier=modifier.name)


@on_both(1)
def bind_corrective(random, ob):
    modifier = one_of(random, ob, "CORRECTIVE_SMOOTH")
    if modifier:
        modifier.rest_source = random.choice(("BIND", "ORCO"))
        if modifier.rest_source == "BIND" and random.random() < 0.7:
            select(ob)
            bpy.ops.object.correctivesmooth_bind(modifier=modifier.name)


@on_both(3)
def bind_to_a_cage(random, ob):
    """Or unbind."""
    modifier = one_of(random, ob, *BINDING)
    if modifier:
        bind(ob, modifier)


@on_both(1.5)
def key_modifier(random, ob):
    modifier = one_of(random, ob, "CORRECTIVE_SMOOTH", "SMOOTH", "HOOK", "ARMATURE", "LATTICE", "SURFACE_DEFORM")
    if modifier:
        names = {
            "HOOK": ("strength",),
            "LATTICE": ("strength", "show_viewport"),
            "SURFACE_DEFORM": ("strength",),
            "ARMATURE": ("use_deform_preserve_volume", "show_viewport"),
        }
        name = random.choice(names.get(modifier.type, ("factor", "iterations", "show_viewport")))
        for frame in (1, 15):
            if isinstance(getattr(modifier, name), bool):
                setattr(modifier, name, random.random() < 0.5)
            else:
                setattr(modifier, name, random.randrange(3) if name == "iterations" else random.random())
            modifier.keyframe_insert(name, frame=frame)
        scene.take_keyframes()


@on_both(0.7)
def drive_modifier(random, ob):
    modifier = one_of(random, ob, "CORRECTIVE_SMOOTH", "SMOOTH", "HOOK", "LATTICE")
    if modifier and scene.armatures():
        setting = "factor" if hasattr(modifier, "factor") else "strength"
        driver = modifier.driver_add(random.choice((setting, setting, "show_viewport"))).driver
        driver.type = "SUM"
        variable = driver.variables[0] if driver.variables else driver.variables.new()
        variable.type, target = "TRANSFORMS", variable.targets[0]
        target.id = random.choice(scene.armatures())
        target.bone_target, target.transform_type = random.choice(target.id.data.bones.keys() or [""]), "LOC_X"


@on_both(0.7)
def clear_animation(random, ob):
    if ob.animation_data and ob.animation_data.action:
        ob.animation_data.action = None
