"""Writes to the file, in the main thread: binds, unbinds, and repairs what a plan lacks."""
