"""Makes weights for a mesh from its bones, and checks the weights that it has."""
