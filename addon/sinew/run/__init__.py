"""Deforms, in Blender's own evaluation. A frame reads a plan and data that were made before."""
