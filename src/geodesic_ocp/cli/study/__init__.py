"""The command study."""
