"""The ogre in a coat with weights by Blender's nearest points and by Sinew, posed: the picture in weight-tools.md.

In a Blender with the add-on:

blender --python docs/make_transfer_picture.py -b -- data/ogre/skeleton.bf build head armpit
montage build/coat-Blender-head.png build/coat-Sinew-head.png build/coat-Blender-armpit.png \\
  build/coat-Sinew-armpit.png -tile 2x -geometry 480x+4+4 -background "#e4e5e7" -quality 86 \\
  docs/transfer.jpg

The words at the end are parts of the picture, names in PARTS of make_weights_picture.py. It also prints how far the
posed coats are from the one with the weights that its vertices had in the body.
"""

import sys
from pathlib import Path

import bmesh
import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
from make_weights_picture import import_ogre, look_at, pose, select, studio

BONES = ("pelvis", "spine", "chest", "clavicle", "upper_arm", "forearm")  # that the coat covers
THICKNESS, STEPS = 0.035, 6  # how far the coat stands off, share of the height; in so many steps
COLOR = (0.30, 0.13, 0.05, 1)


def make_coat(body, height):
    """The skin over these bones, blown up, with the body's weights."""
    coat = body.copy()
    coat.data = body.data.copy()
    coat.name = "Coat"
    bpy.context.collection.objects.link(coat)
    skin = coat.data.materials.find("skin")
    covered = {group.index for group in coat.vertex_groups if group.name.partition(".")[0] in BONES}
    mesh = bmesh.new()
    mesh.from_mesh(coat.data)
    layer = mesh.verts.layers.deform.verify()
    outside = [
        vertex
        for vertex in mesh.verts
        if sum(weight for group, weight in vertex[layer].items() if group in covered) < 0.5
        or any(face.material_index != skin for face in vertex.link_faces)
    ]
    bmesh.ops.delete(mesh, geom=outside, context="VERTS")
    for _ in range(STEPS):
        mesh.normal_update()
        for vertex in mesh.verts:
            vertex.co += vertex.normal * (THICKNESS * height / STEPS)
        bmesh.ops.smooth_vert(mesh, verts=mesh.verts, factor=0.5, use_axis_x=True, use_axis_y=True, use_axis_z=True)
    mesh.to_mesh(coat.data)
    mesh.free()
    material = bpy.data.materials.new("coat")
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = COLOR
    coat.data.materials.clear()
    coat.data.materials.append(material)
    return coat


def by_blender(body, coat):
    """Weights of the nearest points, as Object > Link/Transfer Data > Transfer Mesh Data gives them."""
    select(body, coat)
    bpy.ops.object.data_transfer(
        data_type="VGROUP_WEIGHTS",
        vert_mapping="POLYINTERP_NEAREST",
        layers_select_src="ALL",
        layers_select_dst="NAME",
        mix_mode="REPLACE",
    )


def by_sinew(body, coat):
    select(body, coat)
    bpy.ops.object.sinew_transfer_weights()


def shape(ob):
    bpy.context.view_layer.update()
    mesh = ob.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    places = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    return places.reshape(-1, 3)


def main(rig, folder, parts):
    bpy.ops.wm.read_homefile(use_empty=True)
    body, armature = import_ogre(rig)
    height = body.dimensions.y
    armature.hide_render = True
    studio(height)
    coat = make_coat(body, height)
    pose(armature)
    truth = shape(coat)
    for name, way in (("Blender", by_blender), ("Sinew", by_sinew)):
        coat.vertex_groups.clear()
        for bone in armature.pose.bones:  # Blender reads the body as it is posed
            bone.matrix_basis.identity()
        bpy.context.view_layer.update()
        way(body, coat)
        pose(armature)
        off = np.linalg.norm(shape(coat) - truth, axis=1) / height
        print(
            f"{name}: {1000 * off.mean():.2f} thousandths of the height off on average, {1000 * off.max():.0f} at most"
        )
        for part in parts:
            look_at(height, part)
            bpy.context.scene.render.filepath = str(folder / f"coat-{name}-{part}.png")
            bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :]
    main(words[0], Path(words[1]).resolve(), words[2:])
