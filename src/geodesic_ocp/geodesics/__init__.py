"""Geodesics between two configurations, and from a configuration to a pose of the hand."""
