"""The user interface: panels, menus, operators and preferences."""
