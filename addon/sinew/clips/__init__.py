"""Poses that are stored in a file, and armatures that are posed by them."""
