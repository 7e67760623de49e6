"""Plays a rig in Blender and shows Sinew's results: a table of times, a .blend and a contact sheet.

    blender -b --python-exit-code 1 --python addon/demo.py -- RIG_FOLDER OUTPUT_FOLDER POSE_FILE

The poses come from POSE_FILE if the folder has it, otherwise from pose.dmat; without either, all bones sway. A folder
without weights.dmat gets weights made from its bones. Frames are timed alternately with
Sinew and with Blender's own Armature modifier on a copy of the same scene, whose armature has the same motion
as keyframes.
"""

import importlib
import math
import os
import re
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

FRAMES = 120
METHODS = ("LINEAR", "DUAL_QUATERNION")
TILE = (480, 540)  # size in pixels of one picture of the contact sheet
SAMPLES = 8
SWAY, SWAY_FRAMES = 0.2, 48  # of the bones of a rig without poses: radians, and how long it takes
SMALL = 6_000  # vertices; a mesh with fewer gains nothing


def addon_module(name):
    """Returns a module of the add-on, under whichever name this Blender installed it."""
    package = bpy.types.VIEW3D_PT_sinew.__module__.rpartition(".ui.")[0]
    return importlib.import_module(f"{package}.{name}")


def import_rig(folder, pose):
    """Imports the rig through the add-on's operator. Returns the mesh object."""
    skeletons = sorted(folder.glob("skeleton.bf")) + sorted(folder.glob("*.tgf"))
    if not skeletons:
        sys.exit(f"there is neither skeleton.bf nor a .tgf file in {folder}")
    try:
        bpy.ops.import_scene.sinew_rig(filepath=str(skeletons[0]), pose=pose if (folder / pose).exists() else "")
    except RuntimeError as error:
        sys.exit(str(error).strip())
    mesh_object = bpy.context.active_object
    if not addon_module("clips.clip_store").has_poses(mesh_object.sinew.armature.data):
        sway(mesh_object.sinew.armature)
    return mesh_object


def sway(armature):
    """Keys a motion for an armature without poses: each bone turns to and fro, later than its parent."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, SWAY_FRAMES
    for bone in armature.pose.bones:
        bone.rotation_mode = "XYZ"
        delay = 0.6 * len(bone.parent_recursive)
        for frame in range(1, SWAY_FRAMES + 2, SWAY_FRAMES // 8):
            phase = 2 * math.pi * (frame - 1) / SWAY_FRAMES - delay
            bone.rotation_euler = (SWAY * math.sin(phase), 0, SWAY * math.cos(phase))
            bone.keyframe_insert("rotation_euler", frame=frame)


def shape(ob, scene):
    """Returns (V, 3): the evaluated positions in that scene, in object space."""
    mesh = ob.evaluated_get(scene.view_layers[0].depsgraph).data
    positions = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", positions)
    return positions.reshape(-1, 3)


ROWS = {
    "pose + forward kinematics": "pose",
    "skinning": "skin",
    "scene.frame_set, Sinew": "sinew",
    "scene.frame_set, Armature modifier": "modifier",
}


def print_table(mesh_object):
    bench = addon_module("cli.bench_command")
    contest = bench.set_up(mesh_object.sinew.output, FRAMES)
    times, distances = {}, {}
    for method in METHODS:
        bench.set_method(contest, method)
        distances[method] = bench.compare(contest)[0]
        times[method] = bench.measure(contest)
    bench.set_method(contest, "LINEAR")
    bpy.context.window.scene = contest.scenes[0]
    copies = list(contest.scenes[1].objects)
    bpy.data.batch_remove([contest.scenes[1], *copies, *(ob.data for ob in copies if ob.data)])

    mesh, bones = mesh_object.data, len(mesh_object.sinew.armature.pose.bones)
    diagonal = float(np.linalg.norm(np.ptp(shape(mesh_object, bpy.context.scene), axis=0)))
    print(
        f"\n{mesh_object.name}: {len(mesh.vertices):,} vertices, {bones} bones; "
        f"Blender {bpy.app.version_string}, {os.cpu_count()} cores; medians of {FRAMES} frames\n"
    )
    print(f"{'milliseconds per frame':36}{'linear':>12}{'dual quaternion':>18}")
    for name, key in ROWS.items():
        print(f"{name:36}{times['LINEAR'][key]:12.3f}{times['DUAL_QUATERNION'][key]:18.3f}")
    print(
        f"{'largest distance of the two results':36}"
        + "".join(f"{distances[method]:{width}.2g}" for method, width in zip(METHODS, (12, 18)))
        + f"   (the mesh measures {diagonal:.3g})\n"
    )
    if len(mesh.vertices) < SMALL:
        print("Small meshes gain nothing: most of the frame is Blender's own work.\n")


def gains():
    """Returns how many times faster whole frames of the ogre are in the newest Blender of docs/speed.md, for each of
    METHODS."""
    text = (Path(__file__).resolve().parents[1] / "docs" / "speed.md").read_text(encoding="utf-8")
    rows = {}
    for who in ("Sinew", "Armature modifier"):
        cells = re.search(rf"^\| whole `scene\.frame_set`, {who} \| ([\d.]+) \| ([\d.]+) \|", text, re.MULTILINE)
        rows[who] = [float(cell) for cell in cells.groups()]
    return [theirs / ours for theirs, ours in zip(rows["Armature modifier"], rows["Sinew"])]


def last_words(folder):
    """Returns why the table shows a small gain, and what shows a large one; nothing if the gain need not be small."""
    if bpy.app.version >= (4, 2):
        return ""
    linear, dual_quaternion = gains()
    return (
        f"\nMost of these frames is Blender's own work: {bpy.app.version_string} computes all normals of a mesh when "
        "its shape changes, whoever deforms it.\n"
        f"`BLENDER=$(./dev blender 5.2) ./dev demo {folder}` shows a Blender that does not: the ogre's whole frames "
        f"are {linear:.1f} times faster there, and {dual_quaternion:.1f} times with dual quaternions (docs/speed.md).\n"
    )


def world_points(mesh_object, frames):
    """Returns (N, 3): the character's vertices on all of these frames, in world space."""
    points = []
    for frame in frames:
        bpy.context.scene.frame_set(frame)
        matrix = np.array(mesh_object.matrix_world)
        points.append(shape(mesh_object, bpy.context.scene) @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(points)


def sheet_pictures(mesh_object):
    """Returns (frame, method) for each of the six pictures: one cycle of the clip, or of the swaying; or rest, half
    swing and full swing, with one method in the upper row and the other in the lower."""
    armature = mesh_object.sinew.armature
    count = addon_module("clips.clip_store").pose_count(armature.data)
    if count == 0:
        count = SWAY_FRAMES
    if armature.sinew_clip.mode == "PLAYBACK" or mesh_object.sinew.source == "ARMATURE":
        return [(1 + round(i * count / 6), METHODS[0]) for i in range(6)]
    half_swing = math.pi / 2 * bpy.context.scene.render.fps
    return [(1 + round(share * half_swing), method) for method in METHODS for share in (0, 1 / 3, 1)]


# From the character towards the camera, which is at the front left.
CAMERA_DIRECTION = Vector((-0.62, -1.0, 0.22)).normalized()


def backdrop(center, size):
    """Makes a floor that curves upwards behind the character, so that no horizon cuts the picture."""
    radius = 2 * size
    profile = [(-8 * size, 0.0)]
    profile += [
        (2 * size + radius * math.sin(a), radius - radius * math.cos(a)) for a in np.linspace(0, math.pi / 2, 24)
    ]
    profile.append((profile[-1][0], 12 * size))
    away = -Vector((CAMERA_DIRECTION.x, CAMERA_DIRECTION.y, 0)).normalized()
    side = Vector((-away.y, away.x, 0)) * 14 * size
    points = [
        center + away * distance + sign * side + Vector((0, 0, height))
        for distance, height in profile
        for sign in (-1, 1)
    ]
    faces = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(profile) - 1)]
    mesh = bpy.data.meshes.new("backdrop")
    mesh.from_pydata(points, [], faces)
    mesh.polygons.foreach_set("use_smooth", [True] * len(faces))
    mesh.materials.append(plain_material("backdrop", (0.10, 0.11, 0.13)))
    return bpy.data.objects.new("backdrop", mesh)


def add_light(name, place, target, power, size):
    light = bpy.data.lights.new(name, "AREA")
    light.energy, light.size = power, size
    ob = bpy.data.objects.new(name, light)
    ob.location = place
    ob.rotation_euler = (target - place).to_track_quat("-Z", "Y").to_euler()
    bpy.context.collection.objects.link(ob)


def build_stage(mesh_object, points):
    """Adds a floor, three lights, and a camera at the front left that sees all of the points."""
    scene = bpy.context.scene
    low, high = Vector(points.min(axis=0)), Vector(points.max(axis=0))
    middle, size = (low + high) / 2, (high - low).length
    bpy.context.collection.objects.link(backdrop(Vector((middle.x, middle.y, low.z)), size))
    if not mesh_object.data.materials:
        mesh_object.data.materials.append(plain_material("clay", (0.62, 0.36, 0.24)))

    for name, direction, power, width in (
        ("key", (-1.2, -1.5, 1.8), 130, 0.5),
        ("fill", (1.8, -1.2, 0.6), 25, 1.5),
        ("rim", (0.8, 1.8, 1.6), 150, 0.6),
    ):
        add_light(name, middle + Vector(direction) * size, middle, power * size**2, width * size)
    world = bpy.data.worlds.new("studio")
    scene.world = world
    if world.node_tree is None:
        world.use_nodes = True
    world.node_tree.nodes["Background"].inputs[0].default_value = (0.10, 0.115, 0.14, 1)

    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    bpy.context.collection.objects.link(camera)
    scene.camera = camera
    camera.data.lens, camera.data.clip_end = 70, 100 * size
    camera.rotation_euler = CAMERA_DIRECTION.to_track_quat("Z", "Y").to_euler()
    scene.render.resolution_x, scene.render.resolution_y = TILE
    bpy.context.view_layer.update()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    place, _ = camera.camera_fit_coords(depsgraph, points.reshape(-1).tolist())
    camera.location = place + CAMERA_DIRECTION * 0.12 * size


def plain_material(name, color):
    material = bpy.data.materials.new(name)
    material.diffuse_color = (*color, 1)
    if material.node_tree is None:  # before 5.0
        material.use_nodes = True
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*color, 1)
    shader.inputs["Roughness"].default_value = 0.7
    return material


def render_sheet(mesh_object, pictures, path):
    """Renders the pictures into one image, three columns by two rows."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = SAMPLES
    scene.cycles.use_denoising = False
    width, height = TILE
    sheet = np.zeros((2 * height, 3 * width, 4), np.float32)
    tile_path = path.with_name("tile.png")
    for i, (frame, mesh_object.sinew.method) in enumerate(pictures):
        scene.frame_set(frame)
        scene.render.filepath = str(tile_path)
        bpy.ops.render.render(write_still=True)
        tile = bpy.data.images.load(str(tile_path))
        pixels = np.empty(width * height * 4, np.float32)
        tile.pixels.foreach_get(pixels)
        row, column = 1 - i // 3, i % 3  # Blender's images start at the bottom
        sheet[row * height : (row + 1) * height, column * width : (column + 1) * width] = pixels.reshape(
            height, width, 4
        )
        bpy.data.images.remove(tile)
    tile_path.unlink()
    image = bpy.data.images.new("sheet", 3 * width, 2 * height)
    image.pixels.foreach_set(sheet.reshape(-1))
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


def main():
    folder, output, pose = sys.argv[sys.argv.index("--") + 1 :]
    folder, output = Path(folder), Path(output)
    output.mkdir(parents=True, exist_ok=True)
    for ob in list(bpy.data.objects):
        bpy.data.objects.remove(ob)
    mesh_object = import_rig(folder, pose)
    print_table(mesh_object)

    pictures = sheet_pictures(mesh_object)
    build_stage(mesh_object, world_points(mesh_object, [frame for frame, _ in pictures]))
    bpy.context.scene.frame_set(1)
    blend, picture = output / f"{folder.name}.blend", output / f"{folder.name}.png"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    render_sheet(mesh_object, pictures, picture)
    print(f"{blend}\n{picture}")
    if len(mesh_object.data.vertices) >= SMALL:
        print(last_words(folder.name if folder.parent.name == "data" else folder))


if __name__ == "__main__":
    main()
