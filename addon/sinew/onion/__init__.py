"""Ghosts of characters around the current frame, the paths of their bones, and how both are drawn."""
