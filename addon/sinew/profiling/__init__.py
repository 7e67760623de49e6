"""What evaluating a scene costs, object by object."""
