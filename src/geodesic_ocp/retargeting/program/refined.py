"""Solutions of the program on grids that resolve the paths and keep joint limits between nodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.execution.clearance import Clearance
from geodesic_ocp.ocp.refinement import unresolved_energy
from geodesic_ocp.retargeting.program.motion_program import ArmPart, MotionProgram
from geodesic_ocp.retargeting.program.waypoints import ObjectiveWeights

_ROUNDS, _MOST_SEGMENTS = 12, 400
_RESOLVED = 1e-5  # of the energy
# With distances, which are kept at instants and make corners; and the number of grids on which it
# also counts how well the paths are resolved.
_RESOLVED_APART, _ROUNDS_APART = 1e-3, 3
_BETWEEN = np.array([0.25, 0.5, 0.75])  # of the way from node to node, where limits are checked
_TINY = 1e-12
_NO_ROWS: Mapping[tuple[int, float], float] = {}


@dataclass(frozen=True, eq=False)
class ProgramIterate:
    """Arms on their grids, positions at the nodes, relative times added, and how it was found."""

    parts: tuple[ArmPart, ...]
    nodes: tuple[Array, ...]
    longer: Array | None
    objective: float = np.inf
    iterations: int = 0
    kept: tuple[int, ...] = ()
    near_misses: tuple[tuple[bool, ...], ...] = ()
    success: bool = False
    status: str = ""


def refined(
    iterate: ProgramIterate,
    edges: Array,
    weights: ObjectiveWeights,
    tolerance: float,
    rows: Mapping[tuple[int, float], float] = _NO_ROWS,
    clearance: Clearance | None = None,
) -> ProgramIterate:
    """The solution on grids that resolve the paths, with these distances at these instants."""
    is_near = iterate.success
    for number in range(_ROUNDS):
        program = MotionProgram(iterate.parts, edges, weights, clearance, rows)
        start = program.guess(iterate.nodes, iterate.longer)
        outcome = program.solve(start, near=is_near)
        spent = iterate.iterations + outcome.iterations
        if not outcome.success and is_near:  # from the same start, with larger steps
            outcome = program.solve(start)
            spent += outcome.iterations
        nodes, longer = program.split(outcome.x)
        iterate = replace(
            iterate,
            nodes=tuple(nodes) if outcome.success else iterate.nodes,
            longer=longer if outcome.success else iterate.longer,
            objective=outcome.objective if outcome.success else iterate.objective,
            iterations=spent,
            success=outcome.success,
            status=outcome.status,
        )
        if not outcome.success:
            return iterate
        resolved = _RESOLVED
        if rows:  # then joint limits alone
            resolved = _RESOLVED_APART if number < _ROUNDS_APART else np.inf
        coarse = [
            _coarse(*pair, tolerance, resolved) for pair in zip(iterate.parts, nodes, strict=True)
        ]
        segments = sum(part.grid.segments for part in iterate.parts)
        if not any(np.any(each) for each in coarse):
            return iterate
        if segments + sum(int(each.sum()) for each in coarse) > _MOST_SEGMENTS:
            break
        finer = tuple(part.halved(each) for part, each in zip(iterate.parts, coarse, strict=True))
        on_finer = tuple(
            part.path(each)(fine.grid.nodes)
            for part, fine, each in zip(iterate.parts, finer, nodes, strict=True)
        )
        iterate, is_near = replace(iterate, parts=finer, nodes=on_finer), True
    status = f"not solved to {tolerance:g} on {segments} segments"
    return replace(iterate, success=False, status=status)


def _coarse(part: ArmPart, nodes: Array, tolerance: float, resolved: float) -> NDArray[np.bool_]:
    """Which segments to halve, (segments,)."""
    path, grid = part.path(nodes), part.grid
    unresolved = unresolved_energy(path) / max(path.energy, _TINY)
    coarse = unresolved > resolved / grid.segments
    if part.waypoints.limited:
        own = grid.nodes[: grid.degree + 1] / grid.widths[0]  # nodes are denser at the ends
        local = (own[:-1, None] + np.diff(own)[:, None] * _BETWEEN).ravel()
        s = (grid.breakpoints[:-1, None] + grid.widths[:, None] * local).ravel()
        q, arm = path(s), part.waypoints.arm
        excess = np.maximum(arm.lower - q, q - arm.upper).max(axis=1)
        coarse |= excess.reshape(grid.segments, -1).max(axis=1) > tolerance
    return np.asarray(coarse)
