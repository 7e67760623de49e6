"""Deforms bound meshes during Blender's own evaluation. A frame uses a plan and data that were made before."""
