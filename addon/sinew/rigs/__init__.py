"""Rig folders: import, export, and the poses that they bring."""
