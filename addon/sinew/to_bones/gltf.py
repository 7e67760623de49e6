"""Writes a baked skeleton with its meshes to glTF, by Blender's own exporter."""

from collections.abc import Sequence

import bpy

from ..blender.selection import select

# With these the exporter writes the keyframes as they are, and each NLA track as an animation of its name. It does not
# evaluate the scene for each frame of each action.
SETTINGS = {
    "use_selection": True,
    "export_animations": True,
    "export_animation_mode": "ACTIONS",
    "export_merge_animation": "NLA_TRACK",
    "export_force_sampling": False,
    "export_anim_single_armature": False,
    "export_frame_range": False,
    "export_optimize_animation_size": False,
    "export_all_influences": True,
}


def export(context: bpy.types.Context, objects: Sequence[bpy.types.Object], path: str) -> None:
    """Writes objects to a .glb or .gltf file. Raises ValueError."""
    if "gltf" not in dir(bpy.ops.export_scene):
        raise ValueError("this Blender has no glTF exporter: enable the add-on glTF 2.0 format")
    if not path.lower().endswith((".glb", ".gltf")):
        raise ValueError(f"{path} does not end in .glb or .gltf")
    known = bpy.ops.export_scene.gltf.get_rna_type().properties.keys()
    settings = {name: value for name, value in SETTINGS.items() if name in known}
    active, selected = context.view_layer.objects.active, list(context.selected_objects)
    select(context, objects[0], objects)
    try:
        bpy.ops.export_scene.gltf(
            filepath=path, export_format="GLB" if path.lower().endswith(".glb") else "GLTF_SEPARATE", **settings
        )
    except RuntimeError as error:
        raise ValueError(str(error).strip().removeprefix("Error: ")) from error
    finally:
        select(context, active, selected)
