"""Curves: grids, paths, sampled motions, and how a path is travelled in time."""
