"""Curves: grids, paths, sampled motions, and how a path is travelled in time."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
