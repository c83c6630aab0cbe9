"""Geodesic synergies of a recorded motion.

A geodesic synergy is a segment of a recorded motion that follows a geodesic of the kinetic-energy
metric (Klein, Jaquier, Meixner, Asfour, "A Riemannian Take on Human Motion Analysis and
Retargeting", IROS 2022). It is not a muscle synergy of motor control.
"""

from lazy_loader import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
