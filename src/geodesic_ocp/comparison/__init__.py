"""Comparison of methods and metrics over recordings."""
