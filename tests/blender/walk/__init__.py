"""A random walk: what people do in Blender, in any order, with bound meshes and unbound twins side by side."""
