"""Decides which path a bound mesh takes, what Sinew replaces, and what the file needs for that."""
