"""Rig folders: import, export, and keyframes from clips."""
