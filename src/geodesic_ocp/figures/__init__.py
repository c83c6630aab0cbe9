"""Functions that draw into matplotlib Axes."""
