"""The ogre with Direct Delta Mush, what Bake to Bones makes of it, and how far that is off: the picture in
bake-to-bones.md.

In a Blender with the add-on:

blender --python docs/make_bake_to_bones_picture.py -b -- data/ogre/skeleton.bf build 12
montage -label "Direct Delta Mush" build/original.png -label "12 bones, linear" build/baked.png \\
  -label "how far it is off" build/error.png -tile 3x -geometry 440x+4+4 -background "#e4e5e7" -font DejaVu-Sans \\
  -pointsize 18 -quality 86 docs/bake-to-bones.jpg

The last number is how many bones are found.
"""

import sys
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
from make_weights_picture import look_at, studio

FRAMES = (1, 33)
SHOWN = 9  # the frame of the picture
# Of the heat map: share of the largest error, color.
RAMP = (
    (0.0, (0.05, 0.12, 0.5, 1)),
    (0.35, (0.1, 0.6, 0.55, 1)),
    (0.65, (0.95, 0.8, 0.2, 1)),
    (1.0, (0.8, 0.08, 0.05, 1)),
)


def heat_map(mesh):
    """Replaces the mesh's materials with one that shows the attribute bone_error. Returns the largest error."""
    errors = np.empty(len(mesh.vertices), np.float32)
    mesh.attributes["bone_error"].data.foreach_get("value", errors)
    material = bpy.data.materials.new("heat map")
    material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    attribute = nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = "bone_error"
    share = nodes.new("ShaderNodeMath")
    share.operation, share.inputs[1].default_value = "DIVIDE", float(errors.max())
    ramp = nodes.new("ShaderNodeValToRGB")
    while len(ramp.color_ramp.elements) < len(RAMP):
        ramp.color_ramp.elements.new(0.5)
    for element, (position, color) in zip(ramp.color_ramp.elements, RAMP):
        element.position, element.color = position, color
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    links.new(attribute.outputs["Fac"], share.inputs[0])
    links.new(share.outputs[0], ramp.inputs[0])
    links.new(ramp.outputs["Color"], shader.inputs["Base Color"])
    mesh.materials.clear()
    mesh.materials.append(material)
    return errors.max()


def render(folder, name, shown, all_objects):
    for each in all_objects:
        each.hide_render = each != shown
    bpy.context.scene.render.filepath = str(folder / f"{name}.png")
    bpy.ops.render.render(write_still=True)


def main(rig, folder, bones):
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.import_scene.sinew_rig(filepath=rig, pose="walk.dmat", method="DIRECT_DELTA_MUSH")
    ob, scene = bpy.context.active_object, bpy.context.scene
    height = ob.dimensions.y  # its own Y axis points up
    ob.sinew.armature.hide_render = True
    scene.frame_start, scene.frame_end = FRAMES
    bpy.ops.object.sinew_bake_to_bones(bones=bones, max_influences=4)
    baked = bpy.data.objects[f"{ob.name}_baked"]
    baked.parent.hide_render = True
    studio(height)
    look_at(height, "all")
    scene.frame_set(SHOWN)
    render(folder, "original", ob, (ob, baked))
    render(folder, "baked", baked, (ob, baked))
    print(f"the largest error is {heat_map(baked.data):.4f} of a height of {height:.3f}")
    render(folder, "error", baked, (ob, baked))


if __name__ == "__main__":
    words = sys.argv[sys.argv.index("--") + 1 :]
    main(words[0], Path(words[1]).resolve(), int(words[2]))
