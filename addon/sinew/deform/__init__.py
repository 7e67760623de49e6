"""From influences and poses to vertex positions. Pure: numpy and the native library, nothing of Blender."""
