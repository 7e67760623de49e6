"""Rig folders: import, export, and their poses."""
