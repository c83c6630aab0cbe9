"""Solution: what a solver found, and how."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path as FilePath

from matplotlib.figure import Figure

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.path_figure import draw
from geodesic_ocp.ocp.nlp.violations import Violation
from geodesic_ocp.ocp.problem.problem import Problem
from geodesic_ocp.ocp.solve.certificate import Attempt, Certificate
from geodesic_ocp.ocp.solve.save_solution import save_solution
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw
from geodesic_ocp.trajectory.timed_path import moved_along


@dataclass(frozen=True)
class MeshIteration:
    """One solve of a refinement.

    Attributes:
        segments: of its grid.
        iterations, seconds: of Ipopt.
        objective: that was reached.
        max_path_violation: largest violation anywhere on the path.
    """

    segments: int
    iterations: int
    seconds: float
    objective: float
    max_path_violation: float


@dataclass(frozen=True)
class Stats:
    """Figures of one solve.

    Attributes:
        success: whether the path is a local solution, to Ipopt's tolerance.
        status: how the solver stopped, a sentence.
        iterations: of Ipopt; of several grids, on the last (`mesh_history` has all).
        seconds: wall time of the solver, likewise.
        variables, constraints: sizes of the NLP, bounds not counted.
        energy: of the path on its grid, 1/2 int |q'|_G^2 ds.
        objective: what was minimised, the energy and the problem's own cost.
        max_node_violation: largest violation of any condition at the nodes, in the condition's unit.
        worst_constraint: name of the condition with that violation.
        max_path_violation: largest violation anywhere on the path, between the nodes, too.
        mesh_history: what was done until the solution held to a tolerance, if one was asked for.
    """

    success: bool
    status: str
    iterations: int
    seconds: float
    variables: int
    constraints: int
    energy: float
    objective: float
    max_node_violation: float
    worst_constraint: str
    max_path_violation: float
    mesh_history: tuple[MeshIteration, ...] = ()


@dataclass(frozen=True, eq=False)
class Solution:
    """A path of least energy under a problem's conditions, or the last iterate towards one.

    Attributes:
        problem: what was solved.
        path: the path found.
        stats: figures of the solve; `stats.success` tells a solution from an iterate.
        violations: the conditions that the path misses, between its nodes, too; the worst first.
        attempt: the NLP's last iterate, in its units.
        multipliers: by condition's name, derivatives of the least energy by the condition's value
            with the sign of Ipopt (positive where an upper bound holds the path back): (m,) at an
            end, (nodes, m) along the path; conditions in q and v at both sides of each segment's
            end, (segments * (degree + 1), m).
    """

    problem: Problem
    path: Path
    stats: Stats
    multipliers: Mapping[str, Array]
    violations: tuple[Violation, ...]
    attempt: Attempt = field(repr=False)

    @cached_property
    def certificate(self) -> Certificate:
        """How near the path is to a geodesic, and whether it is locally shortest.

        Under constraints: whether the energy falls in any direction, to second order, in which the
        conditions that hold the path back stay met.
        """
        return self.attempt.certificate()

    def save(self, file: str | PathLike[str]) -> FilePath:
        """Write the solution as JSON; see `save_solution`, and `load_solution` to read it."""
        return save_solution(file, self)

    def resample(self, count: int, by: str = "length") -> Array:
        """Positions (count, n) along the path; see `Path.resample`."""
        return self.path.resample(count, by)

    def to_motion(self, timing: float | TimeLaw, rate: float = 100.0) -> Motion:
        """The path in time, with velocities.

        Args:
            timing: the duration [s], in which the path is travelled from rest to rest with the
                least square of the acceleration s''(t) along it (`time_law`); or a time law, which
                may have speeds at its ends.
            rate: samples a second [Hz], rounded so that they are evenly spaced up to the end.

        Raises:
            ValueError: a duration or rate that is not positive, a path of no length, or a time law
                of another length.
        """
        return moved_along(self.path, timing, rate)

    def plot(self) -> Figure:
        """Coordinates, speed, and the hand's path or, of two coordinates, the path in the plane."""
        return draw(self)


def added(solution: Solution, before: Stats) -> Solution:
    """The solution with the iterations and seconds of a solve that led to it."""
    stats = solution.stats
    iterations, seconds = stats.iterations + before.iterations, stats.seconds + before.seconds
    return replace(solution, stats=replace(stats, iterations=iterations, seconds=seconds))
