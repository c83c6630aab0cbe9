"""Drawings of numbers of several subjects."""
