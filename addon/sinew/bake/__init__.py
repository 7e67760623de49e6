"""Writes the shapes of every frame to files: caches that other machines and other programs can play."""
