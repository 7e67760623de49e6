"""Computes deformation from influences and poses. Pure: numpy and the native library, nothing of Blender."""
