"""The node group that Sinew's modifiers share. It stays in the file as long as a mesh of the file is bound, also while
no modifier uses it.

For what handlers do comes after the step that Blender's undo has saved, and what two steps have in common undo keeps as
it now is: an object to which a handler gave a modifier with a new group would be kept, and the group would not.
"""

from ..blender import nodes
from ..run import characters


def see_to():
    """After a mesh was bound or released, or a file opened, and before saving."""
    if _is_needed():
        nodes.node_group()
    else:
        nodes.forget_unused_groups()


def follow():
    """In handlers, which remove no data-block in the middle of somebody's operator: bound meshes may have been appended
    or deleted."""
    if _is_needed():
        nodes.node_group()
    else:
        nodes.let_groups_go()


def _is_needed():
    """Whether a mesh is bound that is this file's own."""
    return any(ob.library is None for ob in characters.bound_objects())
