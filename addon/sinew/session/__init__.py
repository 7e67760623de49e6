"""What runs: native objects made from the .blend, called in Blender's evaluation. Never saved."""
