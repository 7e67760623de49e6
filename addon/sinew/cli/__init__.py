"""The command line and its benchmark."""
