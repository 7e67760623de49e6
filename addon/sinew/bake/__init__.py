"""Shapes of every frame, written to files: caches that other machines and other programs play."""
