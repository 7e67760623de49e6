"""Reads and writes Blender's data: meshes, armatures, node groups, drivers. Does not depend on what it is used for."""
