"""Paths on which links keep clear of each other and of obstacles at instants of the motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance import Clearance, active_rows
from geodesic_ocp.retargeting.program.motion_program import positions_at
from geodesic_ocp.retargeting.program.refined import ProgramIterate, refined
from geodesic_ocp.retargeting.program.waypoints import ObjectiveWeights

_INSTANTS = 24  # of a movement at which distances are checked
_DISTANCE_ROUNDS = 6
_HOPELESS = 0.8  # of what distances lacked before a round, that they still lack after it
_ROUNDING = 1e-4  # [m] by which a distance may fall below its bound between those instants
_BELOW = 1e-3  # [m] by which a distance falls below its bound before that is reported
# Weight of the squared error of a pose at which links are too near [1/m^2] or [1/rad^2].
_YIELDING = 50.0


def keep_apart(
    iterate: ProgramIterate,
    clearance: Clearance,
    edges: Array,
    weights: ObjectiveWeights,
    tolerance: float,
) -> ProgramIterate:
    """The solution with all distances above their bounds, or the last one that was found.

    Only those distances enter the program that are below their bounds at some instants, and only
    at these instants. Where that does not help, poses at which links are too near are replaced by
    the nearest ones at which they are not.
    """
    rows: dict[tuple[int, float], float] = {}
    free, lacking = iterate, np.inf
    for _ in range(_DISTANCE_ROUNDS):
        more, lacks = _too_near(clearance, iterate)
        if not more:
            break
        if not more.keys() - rows.keys() or lacks > _HOPELESS * lacking:
            missed = _yielding(clearance, iterate)
            if missed is None:
                break
            # From the paths without distances, as poses that cannot be attained have led astray.
            parts = zip(free.parts, missed, strict=True)
            free = replace(free, parts=tuple(replace(part, missed=each) for part, each in parts))
            iterate, lacks = replace(free, iterations=iterate.iterations), np.inf
        rows, lacking = rows | more, lacks
        found = refined(iterate, edges, weights, tolerance, rows, clearance)
        if not found.success:
            return replace(iterate, iterations=found.iterations)
        iterate = replace(found, kept=tuple(sorted({number for number, _ in rows})))
    return iterate


def _yielding(clearance: Clearance, iterate: ProgramIterate) -> list[Array] | None:
    """Weights of missed poses, with those at which links are too near; None if there are no new."""
    every, any_new = [], False
    for part in iterate.parts:
        given = part.waypoints
        times = np.append(given.begins[0], given.ends)
        q = positions_at(iterate.parts, iterate.nodes, times)
        active = active_rows(clearance, q, -_BELOW)
        found = clearance.function.map(len(q))(q.T).full()[active.rows, active.samples]
        near = np.zeros(times.size, dtype=bool)
        near[active.samples[active.lower - found > 0.0]] = True
        new = near & (part.missed == 0.0)
        new[0] &= given.start is None
        every.append(np.where(new, _YIELDING, part.missed))
        any_new |= bool(new.any())
    return every if any_new else None


def _positions(iterate: ProgramIterate) -> tuple[Array, Array]:
    """Instants (k,) [s] within the movements, and the joints of all arms there (k, N)."""
    instants = np.unique(
        np.concatenate(
            [
                np.linspace(begin, end, _INSTANTS)
                for part in iterate.parts
                for begin, end in zip(part.waypoints.begins, part.waypoints.ends, strict=True)
            ]
        ).round(9)
    )
    return instants, positions_at(iterate.parts, iterate.nodes, instants)


def _too_near(
    clearance: Clearance, iterate: ProgramIterate
) -> tuple[dict[tuple[int, float], float], float]:
    """Bounds of the distances that enter the program, by number and instant; what they lack [m].

    Where each lacks most, and around; the sum is that of the most that each lacks.
    """
    instants, q = _positions(iterate)
    active = active_rows(clearance, q, -_ROUNDING)
    distances = clearance.function.map(len(q))(q.T).full()
    found: dict[tuple[int, float], float] = {}
    total = 0.0
    for row in np.unique(active.rows).tolist():
        here = active.rows == row
        lower = np.full(len(q), -np.inf)
        lower[active.samples[here]] = active.lower[here]
        lacks = np.pad(lower - distances[row], 1, constant_values=-np.inf)
        peaks = (lacks[1:-1] >= lacks[:-2]) & (lacks[1:-1] >= lacks[2:]) & np.isfinite(lower)
        around = peaks | np.append(peaks[1:], False) | np.append(False, peaks[:-1])
        for sample in np.flatnonzero(around & np.isfinite(lower)).tolist():
            found[row, float(instants[sample])] = float(lower[sample]) + _ROUNDING
        total += float(lacks.max())
    return found, total


def lacking_distances(
    clearance: Clearance | None, iterate: ProgramIterate
) -> tuple[tuple[str, float, float], ...]:
    """Distances below their bounds, the worst first: name, amount [m], time [s]."""
    if clearance is None:
        return ()
    instants, q = _positions(iterate)
    active = active_rows(clearance, q, -_BELOW)
    values = clearance.function.map(len(q))(q.T).full()[active.rows, active.samples]
    worst: dict[str, tuple[str, float, float]] = {}
    for index in np.argsort(values - active.lower):
        name = clearance.names[int(active.rows[index])]
        amount = float(active.lower[index] - values[index])
        worst.setdefault(name, (name, amount, float(instants[active.samples[index]])))
    return tuple(worst.values())


def least_distances(clearance: Clearance | None, iterate: ProgramIterate) -> Array:
    """Least distances (m,) along the paths."""
    if clearance is None:
        return np.zeros(0)
    _, q = _positions(iterate)
    return np.asarray(clearance.function.map(len(q))(q.T).full().min(axis=1))
