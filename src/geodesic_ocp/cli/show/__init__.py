"""The command show."""
