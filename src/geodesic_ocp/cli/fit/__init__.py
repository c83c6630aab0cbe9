"""The command fit."""
