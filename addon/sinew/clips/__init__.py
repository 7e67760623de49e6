"""Stores the poses of imported rigs in the file, and poses armatures with them."""
