"""Synergies of a person on a robot."""
