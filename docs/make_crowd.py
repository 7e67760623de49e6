"""The hundred ogres of the README: a crowd that Add > Sinew Crowd makes, along a winding path.

blender --python docs/make_crowd.py -b -- data/ogre/skeleton.bf build/crowd.png
convert build/crowd.png -gravity South -crop 1280x560+0+0 +repage -quality 86 docs/crowd.jpg
"""

import sys
from math import radians

import bpy
from mathutils import Vector

rig, picture = sys.argv[sys.argv.index("--") + 1 :]
PATH = ((16, 30), (-2, 24), (-11, 14), (-4, 7), (8, 4), (10, -4), (0, -9), (-15, -12))

bpy.ops.wm.read_homefile(app_template="")
for ob in list(bpy.data.objects):
    bpy.data.objects.remove(ob)
scene = bpy.context.scene
curve = bpy.data.curves.new("Path", "CURVE")
curve.dimensions = "3D"
spline = curve.splines.new("BEZIER")
spline.bezier_points.add(len(PATH) - 1)
for point, (x, y) in zip(spline.bezier_points, PATH):
    point.co = (x, y, 0)
    point.handle_left_type = point.handle_right_type = "AUTO"
path = bpy.data.objects.new("Path", curve)
scene.collection.objects.link(path)
path.select_set(True)
bpy.ops.object.sinew_crowd_add(filepath=rig, pose="walk.dmat", agents=100, lanes=3, seed=5)
for material in bpy.data.materials:
    shader = next((node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED"), None)
    if shader:
        shader.inputs["Roughness"].default_value = 0.6

bpy.ops.mesh.primitive_plane_add(size=400)
ground = bpy.data.materials.new("Ground")
ground.use_nodes = True
shader = next(node for node in ground.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
shader.inputs["Base Color"].default_value = (0.42, 0.36, 0.27, 1)
shader.inputs["Roughness"].default_value = 1.0
bpy.context.object.data.materials.append(ground)
bpy.ops.object.light_add(type="SUN", rotation=(radians(52), 0, radians(-58)))
sun = bpy.context.object.data
sun.energy, sun.angle, sun.color = 4.0, radians(1.5), (1.0, 0.93, 0.82)
scene.world = bpy.data.worlds.new("Sky")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.55, 0.68, 0.85, 1)
scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.7

camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
scene.collection.objects.link(camera)
scene.camera = camera
camera.location = (-3, -21, 4.2)
camera.rotation_euler = (Vector((0.5, 2, 1.0)) - camera.location).to_track_quat("-Z", "Y").to_euler()
camera.data.lens = 34
scene.render.engine = "CYCLES"
scene.cycles.samples = 40
scene.render.resolution_x, scene.render.resolution_y = 1280, 640
scene.view_settings.view_transform = "Standard"
scene.render.filepath = picture
scene.frame_set(9)
bpy.ops.render.render(write_still=True)
