"""Keeps the node groups that Sinew's modifiers share in the file as long as a mesh of the file is bound.

They are kept even if no modifier uses them. What handlers change comes after the step that Blender's undo has saved,
and data-blocks that two steps have in common stay as they are now. So if a handler gave an object a modifier with a new
group, undo would keep the object but not the group.
"""

from ..blender import nodes
from ..run import characters, mail


def see_to() -> None:
    """Adds the groups or removes them: after a mesh was bound or released, a file was opened, and before saving."""
    follow()
    mail.once_handlers_are_done(_forget)


def _forget():
    if not _is_needed():
        nodes.forget_unused_groups()


def follow() -> None:
    """Adds the groups or gives them up, in handlers: bound meshes may have been appended or deleted.

    It removes no data-block, because an operator may be running.
    """
    if _is_needed():
        nodes.make_groups()
    else:
        nodes.let_groups_go()


def _is_needed():
    """Whether a mesh that is not linked is bound."""
    return any(ob.library is None for ob in characters.bound_objects())
