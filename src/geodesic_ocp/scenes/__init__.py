"""Scenes of arms in motion, independent of how they are drawn."""
