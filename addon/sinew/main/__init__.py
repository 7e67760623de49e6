"""What Blender calls in the main thread: handlers, properties, and what they maintain."""
