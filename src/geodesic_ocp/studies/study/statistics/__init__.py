"""Means and tests over subjects."""
