"""Crowds of agents that play one clip: its phases as meshes, and a node group that lets instances of them walk."""
