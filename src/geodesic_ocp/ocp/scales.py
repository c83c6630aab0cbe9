"""The size of a problem: one length for its coordinates, and one number for each condition.

Lengths, spacings and tolerances of the search are relative to these, so that the same problem takes
the same iterates in any unit. The scale of a condition is the change of its value over the size of
the problem, where it holds with equality: a violation in this unit is nearly a distance, in sizes
of the problem, from the configurations that are allowed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.cells import Indices
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.conditions import Condition, Conditions, stacked
from geodesic_ocp.ocp.nlp import ProblemDefinition
from geodesic_ocp.trajectory.path import Path

_SAMPLES = 9  # along the initial path, and as many beside it
# Newton's steps towards a bound. Each halves the distance from a double root, so that these find
# bodies a millionth as thick as the path is long.
_STEPS = 20
# A tolerance must not let a path through a thin body: the scale is at most so many times the
# deepest violation, of those at `_DEPTHS` from a bound, in sizes of the problem.
_THIN = 10.0
_DEPTHS = 2.0 ** np.arange(-_STEPS, 2)
_NEAREST = 3  # samples from which the steps begin, as a function may meet its bound in many places
_REACHED = 1e-6  # last of these steps, in sizes of the problem


def measured(definition: ProblemDefinition, path: Path) -> ProblemDefinition:
    """Return the definition with its size and the scales of its conditions, by an initial path."""
    c = definition.conditions
    n = definition.metric.dim
    functions = _functions(c) if definition.key is None else _shared_functions(definition)
    size = size_of(definition.metric, path.nodes) or _size_of_step(c, path, functions.at_ends)
    s = np.linspace(0.0, 1.0, _SAMPLES)
    units = np.full(2 * n, size)
    states = with_beside(np.hstack([path(s), path(s, 1)]), units)
    at_via = [each for at_one in c.via for each in at_one]
    scales: dict[str, Array | float] = {
        **scales_of(c.ends, functions.at_ends, _both_ends(path), np.full(4 * n, size), c.p_values),
        **scales_of(at_via, functions.at_via, states[:, :n], units[:n], c.p_values),
        **scales_of(_along(c), functions.along, states, units, c.p_values),
    }
    distances = [each.name for each in c.along_q if each.instance is not None]
    scales |= dict.fromkeys(distances, _reach(definition.metric, size))
    return replace(definition, conditions=c.with_scales(scales, size), size=size)


def size_of(metric: Metric, q: Array) -> float:
    """Return the size of a problem: half the extent of an initial path through q (k, n), but one
    radian for a mechanism with revolute joints; zero if the path does not move.
    """
    model = getattr(metric, "model", None)
    if model is not None and "rad" in model.units:
        return 1.0
    return float(np.ptp(q, axis=0).max()) / 2.0


def _size_of_step(c: Conditions, path: Path, at_ends: ca.Function) -> float:
    """Return half the extent of a step that meets the conditions at the ends, if linear; or one."""
    values, slopes = (each.full() for each in at_ends(_both_ends(path)[0], c.p_values))
    lacking = values[:, 0] - np.concatenate([np.zeros(0), *(each.lower for each in c.ends)])
    step = np.linalg.lstsq(np.nan_to_num(slopes), np.nan_to_num(lacking), rcond=None)[0]
    return float(np.abs(step).max(initial=0.0)) / 2.0 or 1.0


def with_beside(samples: Array, units: Array) -> Array:
    """Return samples (k, .) and as many at random beside them, within half a unit."""
    beside = np.random.default_rng(0).uniform(-0.5, 0.5, samples.shape)
    return np.vstack([samples, samples + units * beside])


def _reach(metric: Metric, size: float) -> float:
    """Return the reach [m] of a mechanism, to which distances of its bodies are compared."""
    reach = float(getattr(getattr(metric, "model", None), "reach", size))
    return reach if 0.0 < reach < np.inf else size


def _both_ends(path: Path) -> Array:
    """Return q0, q1, v0 and v1 of a path in one row."""
    return np.concatenate([*path([0.0, 1.0]), *path([0.0, 1.0], 1)])[None]


def _along(c: Conditions) -> list[Condition]:
    """Return the conditions along the path but bounds of coordinates and distances of bodies."""
    return [each for each in (*c.along_q, *c.along_qv) if each.instance is None]


class _Functions(NamedTuple):
    """Functions (z, p) -> values of conditions (m, 1), Jacobian by z.

    The variables z are q0, q1, v0 and v1 at the ends, q at via points, q and v along the path.
    """

    at_ends: ca.Function
    at_via: ca.Function
    along: ca.Function


def _functions(c: Conditions) -> _Functions:
    def function(z: ca.SX, group: Sequence[Condition]) -> ca.Function:
        values = stacked(group)
        return ca.Function("conditions", [z, c.p], [values, ca.densify(ca.jacobian(values, z))])

    return _Functions(
        at_ends=function(ca.vertcat(c.q0, c.q1, c.v0, c.v1), c.ends),
        at_via=function(c.q, [each for at_one in c.via for each in at_one]),
        along=function(ca.vertcat(c.q, c.v), _along(c)),
    )


@lru_cache(maxsize=32)
def _shared_functions(definition: ProblemDefinition) -> _Functions:
    """Return the functions of all problems with one key, which differ in numbers alone."""
    return _functions(definition.conditions)


@dataclass(frozen=True)
class _BoundedRows:
    """All rows of some conditions, as functions of z.

    Attributes:
        function: (z, p) -> values (m, 1), Jacobian by z.
        p: values of the parameters.
        lower, upper: bounds (m,).
        units: how far each variable of z moves in a problem of this size; zero if it is held.
    """

    function: ca.Function
    p: Array
    lower: Array
    upper: Array
    units: Array

    def excess(self, z: Array) -> tuple[Array, Array]:
        """Return how far values exceed the nearer bound (k, m), and the gradients (k, m, .) by z in
        its units.
        """
        values, jacobians = self.function.map(len(z))(z.T, np.tile(self.p[:, None], len(z)))
        values = values.full().T
        slopes = jacobians.full().reshape(self.lower.size, len(z), -1).transpose(1, 0, 2)
        below = self.lower - values
        above = values - self.upper
        is_below = np.abs(below) <= np.abs(above)
        signs = np.where(is_below, -1.0, 1.0)
        return np.where(is_below, below, above), signs[:, :, None] * slopes * self.units

    def of_one(self, z: Array, rows: Indices) -> tuple[Array, Array]:
        """Return the excess (k,) of one row at each z, and its gradient (k, .)."""
        excess, slopes = self.excess(z)
        points = np.arange(len(z))
        return excess[points, rows], slopes[points, rows]

    def at_bounds(self, z: Array, rows: Indices) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Return points (k, .) near z at which one row of each meets a bound with equality, by
        Newton's steps, the gradients there, and which of them have been reached.
        """
        z = z.copy()
        for _ in range(_STEPS):
            excess, slopes = self.of_one(z, rows)
            steps = -(excess / np.sum(slopes**2, axis=1))[:, None] * slopes
            lengths = np.linalg.norm(steps, axis=1)
            moves = np.isfinite(lengths) & (lengths > _REACHED)
            if not np.any(moves):
                break
            z[moves] += self.units * (steps / np.maximum(lengths, 1.0)[:, None])[moves]
        return z, slopes, lengths <= _REACHED

    def depths(self, z: Array, slopes: Array, rows: Indices) -> Array:
        """Return the largest excess (k,) beyond points where one row of each meets a bound, in the
        directions of its gradients.
        """
        outward = self.units * slopes / np.linalg.norm(slopes, axis=1, keepdims=True)
        beyond = z + _DEPTHS[:, None, None] * outward
        every = beyond.reshape(-1, z.shape[1])
        excess, _ = self.of_one(every, np.tile(rows, _DEPTHS.size))
        return np.asarray(np.nan_to_num(excess).reshape(_DEPTHS.size, -1).max(axis=0))

    def scales(self, samples: Array) -> Array:
        """Return the scale of every row (m,), from samples z (k, .).

        If no point is found where a row meets a bound, its scale is the median change over the size
        of the problem, but no more than change and distance from the bound together at any sample.
        """
        excess, slopes = self.excess(samples)
        changes = np.linalg.norm(slopes, axis=2)
        nearest = np.argsort(np.abs(excess) / changes, axis=0)[:_NEAREST]
        rows = np.tile(np.arange(self.lower.size), len(nearest))
        z, slopes, reached = self.at_bounds(samples[nearest.ravel()], rows)
        steep = np.linalg.norm(slopes, axis=1)
        depths = np.full(rows.size, np.inf)
        if np.any(between := (self.lower < self.upper)[rows]):
            depths[between] = self.depths(z[between], slopes[between], rows[between])
        around = np.abs(excess) + changes
        found = np.ones(self.lower.size)
        for row in range(self.lower.size):
            own = reached & (rows == row) & (steep > 0.0)
            usable = np.isfinite(around[:, row]) & (around[:, row] > 0.0)
            if np.any(own):
                found[row] = min(np.median(steep[own]), _THIN * depths[own].max())
            elif np.any(usable):
                usual = np.median(changes[usable, row])
                least = around[usable, row].min()
                found[row] = min(usual, least) if usual > 0.0 else least
        return found


def scales_of(
    group: Sequence[Condition], function: ca.Function, samples: Array, units: Array, p: Array
) -> dict[str, Array]:
    """Return the scales (m,) of the rows of each of these conditions, by name.

    Args:
        group: the conditions.
        function: (z, p) -> all their values, Jacobian by z.
        samples: z (k, .) on an initial path or motion, and beside it.
        units: how far the variables of z move in a problem of this size, zero where they are held.
        p: values of the parameters.
    """
    if not group:
        return {}
    lower = np.concatenate([each.lower for each in group])
    upper = np.concatenate([each.upper for each in group])
    with np.errstate(all="ignore"):  # functions need not be finite everywhere
        scales = _BoundedRows(function, p, lower, upper, units).scales(samples)
    parts = np.split(scales, np.cumsum([each.size for each in group])[:-1])
    return dict(zip((each.name for each in group), parts, strict=True))
