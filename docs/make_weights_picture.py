"""The ogre by Blender's automatic weights and by Sinew's, posed: the picture in weights.md.

In a Blender with the add-on:

blender --python docs/make_weights_picture.py -b -- data/ogre/skeleton.bf build all elbow
montage -label Blender build/Blender-all.png -label Sinew build/Sinew-all.png -label Blender build/Blender-elbow.png \\
  -label Sinew build/Sinew-elbow.png -tile 2x -geometry 480x+4+4 -background "#e4e5e7" \\
  -font DejaVu-Sans -pointsize 18 -quality 86 docs/automatic-weights.jpg

The words at the end are parts of the picture, names in PARTS. weights-joints.jpg has hips, lips, fingers and elbow,
four in a row, with a label before each file and -geometry 320x+4+4.
"""

import math
import sys
from pathlib import Path

import bpy
from mathutils import Euler, Vector

# Bone -> its rotation about the axes of the world, in degrees.
POSE = {
    "chest": (12, 0, 14),
    "head": (-10, 0, -22),
    "jaw": (16, 0, 0),
    "upper_arm.L": (0, -62, 0),
    "forearm.L": (-35, 0, -75),
    "upper_arm.R": (30, -20, 0),
    "forearm.R": (-95, 0, 20),
    "hand.R": (0, 30, 0),
    "thigh.L": (-72, 0, 0),
    "shin.L": (88, 0, 0),
    "thigh.R": (8, -12, 0),
    "shin.R": (14, 0, 0),
    **{f"{finger}{joint}.R": (-38, 0, 12) for finger in ("index", "middle", "ring", "pinky") for joint in (1, 2)},
}
# What is shown: the middle and the width as shares of the height, and the direction that the camera looks from.
PARTS = {
    "all": ((0.06, 0.0, 0.5), 1.24, (-0.35, -1, 0.12)),
    "elbow": ((-0.3, -0.12, 0.62), 0.5, (-1, -0.6, 0.2)),
    "hips": ((0.0, -0.05, 0.42), 0.6, (-0.2, -1, 0.1)),
    "back": ((0.0, 0.0, 0.52), 1.18, (0.5, 1, 0.15)),
    "armpit": ((0.2, 0.1, 0.62), 0.55, (0.5, 1, 0.1)),
    "head": ((0.0, -0.1, 0.85), 0.5, (-0.3, -1, 0.1)),
    "lips": ((0.0, -0.15, 0.8), 0.22, (-0.5, -1, 0.05)),
    "fingers": ((-0.41, -0.34, 0.5), 0.3, (0.2, -1, 0.3)),
}
SIZE, SAMPLES = (620, 660), 32


def import_ogre(path):
    """Returns the mesh and the armature, which have nothing to do with each other."""
    bpy.ops.import_scene.sinew_rig(filepath=path, source="ARMATURE", pose="")
    ob = bpy.context.active_object
    armature = ob.sinew.armature
    bpy.ops.object.sinew_unbind()
    return ob, armature


def take_apart(ob):
    place = ob.matrix_world.copy()
    ob.parent = None
    ob.matrix_world = place
    ob.modifiers.clear()
    ob.vertex_groups.clear()
    bpy.context.view_layer.update()


def select(*objects):
    for each in bpy.context.selected_objects:
        each.select_set(False)
    for each in objects:
        each.select_set(True)
    bpy.context.view_layer.objects.active = objects[0]


def weigh(ob, armature, operator, **settings):
    """Replaces the weights. Returns how many vertices have none."""
    take_apart(ob)
    select(armature, ob)
    operator(**settings)
    return sum(not len(vertex.groups) for vertex in ob.data.vertices)


def pose(armature):
    for name, angles in POSE.items():
        bone = armature.pose.bones[name]
        axes = armature.matrix_world.to_3x3().normalized() @ bone.bone.matrix_local.to_3x3()
        turn = Euler([math.radians(angle) for angle in angles]).to_matrix()
        bone.rotation_mode = "QUATERNION"
        bone.rotation_quaternion = (axes.inverted() @ turn @ axes).to_quaternion()
    bpy.context.view_layer.update()


def look_at(height, part):
    camera = bpy.context.scene.camera
    middle, width, direction = PARTS[part]
    direction = Vector(direction).normalized()
    camera.data.ortho_scale = width * height
    camera.location = Vector(middle) * height + 10 * height * direction
    camera.rotation_euler = direction.to_track_quat("Z", "Y").to_euler()


def studio(height):
    scene = bpy.context.scene
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.clip_end = "ORTHO", 100 * height
    scene.collection.objects.link(camera)
    scene.camera = camera
    for x, y, energy in ((-0.75, -0.7, 2.6), (0.3, 1.1, 1.0)):
        light = bpy.data.objects.new("light", bpy.data.lights.new("light", "SUN"))
        light.data.energy, light.data.angle = energy, 0.3
        light.parent, light.rotation_euler = camera, (x, y, 0)
        scene.collection.objects.link(light)
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.5
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", SAMPLES, False
    scene.render.film_transparent, scene.view_settings.view_transform = True, "Standard"
    scene.render.resolution_x, scene.render.resolution_y = SIZE


def main(rig, folder, parts):
    bpy.ops.wm.read_homefile(use_empty=True)
    ob, armature = import_ogre(rig)
    height = ob.dimensions.y  # its own Y axis points up
    armature.hide_render = True
    studio(height)
    ways = {
        "Blender": (bpy.ops.object.parent_set, {"type": "ARMATURE_AUTO"}),
        "Sinew": (bpy.ops.object.sinew_parent_with_weights, {}),
    }
    for name, (operator, settings) in ways.items():
        for bone in armature.pose.bones:
            bone.matrix_basis.identity()
        missed = weigh(ob, armature, operator, **settings)
        print(f"{name}: {missed:,} vertices without weights")
        pose(armature)
        for part in parts:
            look_at(height, part)
            bpy.context.scene.render.filepath = str(folder / f"{name}-{part}.png")
            bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :]
    main(words[0], Path(words[1]).resolve(), words[2:])
