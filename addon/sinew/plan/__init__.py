"""Decides: which path a bound mesh takes, what the native pass takes over, and what the file needs for that."""
