"""Blender's data as numbers: meshes, armatures, memory, node groups, drivers. Nothing here knows what they are for."""
