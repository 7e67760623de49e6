"""Finds materials that use Generated coordinates."""

from typing import Any

# Textures that use Generated coordinates if their vector is not linked.
_PROCEDURAL = {
    "TEX_BRICK",
    "TEX_CHECKER",
    "TEX_GABOR",
    "TEX_GRADIENT",
    "TEX_MAGIC",
    "TEX_MUSGRAVE",
    "TEX_NOISE",
    "TEX_VORONOI",
    "TEX_WAVE",
}


def user_of_generated(ob: Any) -> str | None:
    """Returns the name of a material of the object that uses Generated coordinates, or None."""
    for slot in ob.material_slots:
        material = slot.material
        if material is not None and material.node_tree is not None and _uses_generated(material.node_tree, set()):
            return material.name
    return None


def _uses_generated(tree, seen):
    if tree in seen:
        return False
    seen.add(tree)
    return any(
        _takes_generated(node)
        or node.type == "GROUP"
        and node.node_tree is not None
        and _uses_generated(node.node_tree, seen)
        for node in tree.nodes
    )


def _takes_generated(node):
    if node.type == "TEX_COORD":
        return node.outputs["Generated"].is_linked
    return (
        node.type in _PROCEDURAL
        and not node.inputs["Vector"].is_linked
        and any(output.is_linked for output in node.outputs)
    )
