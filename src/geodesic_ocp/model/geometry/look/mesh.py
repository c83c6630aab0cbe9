"""Mesh: a triangle mesh of a link."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array

Indices: TypeAlias = NDArray[np.int64]
Colour: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, eq=False, repr=False)
class Mesh:
    """A triangle mesh that is fixed to a link.

    Attributes:
        link: name of the frame of the link.
        vertices: (k, 3) [m], in the frame of the link.
        triangles: (m, 3), indices of vertices, counter-clockwise seen from outside.
        colour: red, green and blue, from 0 to 1.
    """

    link: str
    vertices: Array
    triangles: Indices
    colour: Colour

    def __repr__(self) -> str:
        return f"Mesh({self.link!r}, {len(self.triangles)} triangles)"
