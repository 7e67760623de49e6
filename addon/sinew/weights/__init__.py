"""Makes weights for a mesh from its bones or from another mesh, edits weights, and checks those that a mesh has."""
