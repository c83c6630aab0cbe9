"""Geodesics between two configurations, and from a configuration to a hand pose."""
