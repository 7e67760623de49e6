"""Measures what evaluating a scene costs, object by object."""
