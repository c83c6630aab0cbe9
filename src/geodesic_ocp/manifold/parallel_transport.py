"""Parallel transport along curves."""

from __future__ import annotations

from itertools import pairwise
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive, as_vector
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.manifold.metric import Metric, as_metric


class Curve(Protocol):
    """A curve in R^n, smooth between its breakpoints: a Path, or the samples of a Motion."""

    @property
    def breakpoints(self) -> Array:
        """Increasing parameters (k,) from the curve's start to its end."""

    def __call__(self, s: ArrayLike, order: int = 0) -> Array:
        """Positions (len(s), n) at the parameters s, or derivatives of that order by s."""


def parallel_transport(
    metric: Metric, path_or_motion: Curve, v: ArrayLike, *, tolerance: float = 1e-9
) -> Array:
    """The vector v (n,) at the start of a curve, carried in parallel to its end, (n,).

    sum_j g_ij w'_j + sum_jk Gamma_ijk gamma'_j w_k = 0, w(0) = v. Norms and angles stay, to
    `tolerance` relative to |v|. The curve is a Path, or a Motion, whose samples are joined by the
    cubic spline through them.

    Raises:
        ValueError: wrong shape, numbers that are not finite, or a curve of another dimension.
        IntegrationFailed: the metric becomes singular on the way.
    """
    curve = path_or_motion
    carried = transport_between(metric, curve, v, curve.breakpoints, tolerance=tolerance)
    return np.asarray(carried[-1])


def transport_between(
    metric: Metric, curve: Curve, v: ArrayLike, stops: Array, *, tolerance: float = 1e-9
) -> Array:
    """The vector v (n,) at stops[0], carried along the curve to each of the k stops, (k, n).

    The curve must be smooth from each stop to the next.
    """
    metric = as_metric(metric)
    carried = as_vector("v", v, metric.dim)
    tolerance = as_positive("tolerance", tolerance)
    if np.shape(curve(stops[:1]))[-1] != metric.dim:
        raise ValueError(f"the curve is not of the metric's dimension {metric.dim}")
    size = float(np.linalg.norm(carried))
    if size == 0.0:
        return np.zeros((len(stops), metric.dim))
    result = [carried / size]
    for start, stop in pairwise(stops):

        def along(
            times: Array, middle: float = (start + stop) / 2, half: float = (stop - start) / 2
        ) -> Array:
            # One-sided at the ends of the piece: never the next piece's derivative.
            inside = middle + (1.0 - 1e-12) * np.clip(times - middle, -half, half)
            return np.vstack([curve(inside).T, curve(inside, 1).T])

        try:
            states = metric.transport_integrator(
                result[-1], np.array([start, stop]), 0.01 * tolerance, along
            )
        except IntegrationFailed as failure:
            raise IntegrationFailed(f"parallel transport: {failure}") from None
        result.append(states[-1])
    return size * np.array(result)
