"""Modifiers at the end of a stack whose vertices are fixed weighted sums of those before them, such as Subdivision. The
sums are found by asking Blender, and computed natively from then on.

`tails` says which modifiers those are; `probing` finds the sums, a sinew_native.Stencils."""
