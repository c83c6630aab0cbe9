"""Trajectories that a robot can execute: limits, planning in time, checks, replay."""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
