"""How the code of a frame leaves a mesh to Blender."""


class LeaveToBlender(Exception):
    """Blender's own modifiers deform the mesh in this evaluation. That is not an error. Its text is the reason."""
