"""The skinning methods side by side, an elbow that is bent and a tube that is twisted: the picture in methods.md.

./dev build
PYTHONPATH=docs:build/python blender -b --factory-startup --python-use-system-env --python docs/make_methods_picture.py
"""

import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import bpy
import numpy as np
from make_methods_table import BEND, ROOT, limbs

TWIST, METHODS = 150, 6
CLAY, STRIPE, PAPER = (0.62, 0.33, 0.2), (0.85, 0.62, 0.45), "#e4e5e7"
LIGHTS = ((-0.75, -0.7, 2.6), (0.3, 1.1, 1.0))  # turned so far from the camera's direction, about X and Y; power


def studio():
    scene = bpy.context.scene
    for ob in list(bpy.data.objects):
        bpy.data.objects.remove(ob)
    camera = add(bpy.data.cameras.new("camera"))
    camera.data.type, scene.camera = "ORTHO", camera
    for x, y, energy in LIGHTS:
        light = add(bpy.data.lights.new("light", "SUN"))
        light.data.energy, light.data.angle = energy, 0.3
        light.parent, light.rotation_euler = camera, (x, y, 0)
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 3
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 64, False
    scene.render.film_transparent, scene.view_settings.view_transform = True, "Standard"
    scene.render.resolution_x, scene.render.resolution_y = 320, 300


def add(data):
    ob = bpy.data.objects.new(data.name, data)
    bpy.context.scene.collection.objects.link(ob)
    return ob


def surface(limb, is_shown, is_striped):
    """is_shown, is_striped: functions of a polygon's middle at rest."""
    polygons = np.split(limb.rig.face_vertices, limb.rig.face_offsets[1:-1])
    polygons = [polygon for polygon in polygons if is_shown(limb.rest[polygon].mean(axis=0))]
    mesh = bpy.data.meshes.new("limb")
    mesh.from_pydata(limb.rest.tolist(), [], [polygon.tolist() for polygon in polygons])
    for color in (CLAY, STRIPE):
        material = bpy.data.materials.new("clay")
        material.use_nodes = True
        material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (*color, 1)
        mesh.materials.append(material)
    for polygon in mesh.polygons:
        polygon.use_smooth = True
        polygon.material_index = int(is_striped(limb.rest[polygons[polygon.index]].mean(axis=0)))
    return add(mesh)


def look_at(middle, across, up, width):
    """across, up: directions of the picture; width: of what it shows."""
    camera = bpy.context.scene.camera
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([across, up, np.cross(across, up)])
    matrix[:3, 3] = middle + 5 * matrix[:3, 2]
    camera.matrix_world, camera.data.ortho_scale = matrix.T.tolist(), width


def pictures(limb, matrices, ob, name):
    """montage's arguments for one row."""
    for number, (method, shape) in enumerate(list(limb.shapes(matrices).items())[:METHODS]):
        ob.data.vertices.foreach_set("co", shape.reshape(-1))
        ob.data.update()
        path = bpy.context.scene.render.filepath = f"{name}{number}.png"
        bpy.ops.render.render(write_still=True)
        yield from ("-label", f"{method}\n{limb.volume(shape):.0f} %% of its volume", path)
    bpy.data.objects.remove(ob)


def main(folder):
    studio()
    tube, ogre = limbs()
    upper, lower = ogre.directions
    across = np.cross(np.cross(upper, lower), upper)
    across /= np.linalg.norm(across)
    bent = surface(ogre, lambda middle: middle[0] > 0.6, lambda middle: 0)
    look_at(ogre.points[1] + 0.08 * across - 0.05 * upper, across, -upper, 0.56)
    rows = [*pictures(ogre, ogre.bent(BEND), bent, folder / "bend")]
    turn = np.pi / 6  # of a stripe of each colour
    twisted = surface(tube, lambda middle: True, lambda middle: np.arctan2(middle[0], middle[2]) % turn > turn / 2)
    look_at(tube.points[1], (1, 0, 0), (0, 1, 0), 1.0)
    rows += pictures(tube, tube.twisted(TWIST), twisted, folder / "twist")
    how = f"-tile {METHODS}x -geometry +0+6 -background {PAPER} -font DejaVu-Sans -pointsize 25".split()
    subprocess.run(["montage", *how, *rows, "-quality", "88", ROOT / "docs/methods.jpg"], check=True)


with TemporaryDirectory() as folder:
    main(Path(folder))
