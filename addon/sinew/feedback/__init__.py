"""What any part of the add-on says to the person at the screen."""
