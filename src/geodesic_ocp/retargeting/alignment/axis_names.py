"""Directions in words."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array

_ALONG = np.cos(np.radians(5.0))


def axis_name(direction: ArrayLike, frame: str) -> str:
    """Such as "along +x of the base", or with components where it is along none of the axes."""
    vector: Array = np.asarray(direction, dtype=float)
    vector = vector / np.linalg.norm(vector)
    largest = int(np.argmax(np.abs(vector)))
    if abs(vector[largest]) >= _ALONG:
        return f"along {'-+'[int(vector[largest] > 0.0)]}{'xyz'[largest]} of {frame}"
    entries = ", ".join(f"{entry:.2f}" for entry in vector + 0.0)
    return f"along ({entries}) of {frame}"
