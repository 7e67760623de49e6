"""Shows messages to the user, from any part of the add-on."""
