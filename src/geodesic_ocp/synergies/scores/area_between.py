"""Area between two curves in space."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.arrays import Array

_CELLS = 200  # along the curves; the error falls with the square of their number
_ACROSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)  # from one curve to the other


def area_between(first: Array, second: Array) -> float:
    """Area of the ruled surface between two curves, polylines through (k, d) and (m, d) points.

    Straight lines connect points of equal relative arc length, x(s, u) = (1 - u) a(s) + u b(s),
    and the area is that of these lines, int int |dx/ds x dx/du| du ds. Where plane curves do not
    cross, and the lines do not either, it is the area of the region between them; where they cross,
    both sides count as positive. This is the construction of Jekel, Venter, Venter, Stander, Haftka
    (International Journal of Material Forming 12, 2019), who sum quadrilaterals between plane
    curves, in any dimension.
    """
    a, b = _evenly_spaced(first), _evenly_spaced(second)
    across = (b[1:] + b[:-1] - a[1:] - a[:-1]) / 2.0
    u = (_ACROSS[:, None, None] + 1.0) / 2.0
    along = (1.0 - u) * np.diff(a, axis=0) + u * np.diff(b, axis=0)
    # |x|^2 |y|^2 - (x.y)^2, the square of the area spanned by x and y, in any dimension.
    squares = np.sum(along**2, axis=2) * np.sum(across**2, axis=1)
    squares = squares - np.sum(along * across, axis=2) ** 2
    return float(np.sum(_WEIGHTS @ np.sqrt(np.maximum(squares, 0.0))) / 2.0)


def _evenly_spaced(points: Array) -> Array:
    """Points at equal distances along the polyline; a curve of length zero stays where it is."""
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    upto = np.concatenate([[0.0], np.cumsum(lengths)])
    wanted = np.linspace(0.0, upto[-1], _CELLS + 1)
    return np.column_stack([np.interp(wanted, upto, column) for column in points.T])
