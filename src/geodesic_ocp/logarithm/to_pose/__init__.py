"""Geodesics from a configuration to a pose of the hand."""
