"""Symbolic rigid-body algorithms, in two back ends."""
