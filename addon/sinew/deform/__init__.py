"""Computes influences and the motions of joints. Uses only numpy and the native library, nothing of Blender."""
