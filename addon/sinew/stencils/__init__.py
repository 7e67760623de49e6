"""Modifiers at the end of a stack whose vertices are fixed weighted sums of those before them, such as Subdivision. The
sums are found by asking Blender, and computed natively from then on.

`plan/tails.py` says which modifiers those are; `probing` finds the sums, a sinew_native.Stencils; `searching` has them
found for the meshes whose frames get faster by them."""
