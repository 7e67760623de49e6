"""Bakes any deformation to bones: an armature with keyframes and a mesh with weights, which every game engine plays."""
