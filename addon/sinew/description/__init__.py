"""Rigs as programs: reads an armature of Blender into a description from which the native library computes its bones,
and compares the two."""
