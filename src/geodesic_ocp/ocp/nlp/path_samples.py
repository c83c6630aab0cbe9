"""Values of path constraints along a path, sampled where violations peak."""

from __future__ import annotations

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.ocp.nlp.conditions import Condition, Conditions, stacked
from geodesic_ocp.trajectory.path import Path

_PER_NODE = 4  # samples between two nodes
_NEAR_BOUND = 1e-2  # of the range of a condition's values
_REFINEMENTS = 3  # times that the vertices of parabolas are added to the samples


def excess_over_bounds(condition: Condition, values: Array) -> Array:
    """Distance of values (m, k) from the bounds, positive outside; NaN counts as infinite."""
    excess = np.maximum(condition.lower[:, None] - values, values - condition.upper[:, None])
    return np.asarray(np.where(np.isnan(excess), np.inf, excess))


class PathSamples:
    """Evaluates the path constraints of a problem along paths.

    Samples lie at the nodes, between them, and at the local maxima of the excess over the bounds,
    which parabolas through neighbouring samples locate.
    """

    def __init__(self, conditions: Conditions) -> None:
        c = conditions
        self._conditions, self._functions = c, (*c.along_q, *c.along_qv)
        self._function = ca.Function("along", [c.q, c.v, c.p], [stacked(self._functions)])

    def __call__(self, path: Path) -> tuple[Array, list[tuple[Condition, Array]]]:
        """Parameters s (k,), and for each path constraint its values (m, k) there."""
        s = sample_parameters(path)
        found = self._values(path, s)
        for _ in range(_REFINEMENTS):
            peaks = [_peaks(s, excess_over_bounds(c, values)) for c, values in found]
            new = np.setdiff1d(np.concatenate([np.zeros(0), *peaks]), s)
            if not new.size:
                break
            s = np.sort(np.concatenate([s, new]))
            found = self._values(path, s)
        return s, found

    def _values(self, path: Path, s: Array) -> list[tuple[Condition, Array]]:
        positions = path(s)
        found = [(c, positions[:, list(c.coordinates or ())].T) for c in self._conditions.bounds]
        if self._functions:
            parameters = np.tile(self._conditions.p_values[:, None], s.size)
            values = evaluate(self._function.map(s.size), positions.T, path(s, 1).T, parameters)
            ends = np.cumsum([condition.size for condition in self._functions])[:-1]
            found += zip(self._functions, np.split(values, ends), strict=True)
        return found


def sample_parameters(path: Path) -> Array:
    """Parameters s (k,) at the nodes and between them; one-sided at interior breakpoints."""
    nodes = path.grid.nodes
    steps = np.arange(_PER_NODE) / _PER_NODE
    between = (nodes[:-1, None] + np.diff(nodes)[:, None] * steps).ravel()
    inner = path.breakpoints[1:-1]
    return np.sort(np.concatenate([between, [1.0], inner - 1e-12]))


def _peaks(s: Array, excess: Array) -> Array:
    """Vertices of parabolas through three neighbours of excess (m, k) that are near or above 0."""
    if s.size < 3:
        return np.zeros(0)
    left, middle, right = excess[:, :-2], excess[:, 1:-1], excess[:, 2:]
    a, b = np.diff(s)[:-1], np.diff(s)[1:]
    with np.errstate(all="ignore"):  # there may be infinities
        before, after = (middle - left) / a, (right - middle) / b
        curvature = (after - before) / (a + b)
        slope = before + curvature * a
        maximum = middle - slope**2 / (4.0 * curvature)
        vertex = s[1:-1] - slope / (2.0 * curvature)
        inside = (vertex > s[:-2]) & (vertex < s[2:])
        finite = np.where(np.isfinite(excess), excess, 0.0)
        near = -_NEAR_BOUND * np.ptp(finite, axis=1, keepdims=True)  # parabolas are approximate
        relevant = (curvature < 0.0) & (maximum > near) & inside
    return np.asarray(vertex[relevant])
