"""Solution: what a solver found, and how."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.figures.path_figure import draw_path
from geodesic_ocp.ocp.nlp.bounds import NodeBounds
from geodesic_ocp.ocp.nlp.violations import BETWEEN_NODES, Violation, find_violations
from geodesic_ocp.ocp.problem.drawn_obstacles import drawn_obstacles
from geodesic_ocp.ocp.problem.problem import Problem
from geodesic_ocp.ocp.solve.certificate import Certificate, certify_iterate
from geodesic_ocp.ocp.solve.encoding import as_json, encoded_fields
from geodesic_ocp.ocp.solve.final_iterate import FinalIterate
from geodesic_ocp.ocp.solve.stats import Stats
from geodesic_ocp.records import write_file
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw
from geodesic_ocp.trajectory.timed_path import motion_along

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMAT, VERSION = "geodesic_ocp solution", 2


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """A path of least energy under a problem's conditions, or the last iterate towards one.

    Attributes:
        problem: the problem that was solved.
        path: the path that was found.
        stats: statistics of the solve; `stats.success` distinguishes a solution from an iterate.
        violations: conditions that the path violates, between its nodes included, the worst first.
        iterate: the NLP's last iterate, in its units.
        multipliers: derivatives of the least energy by the value of each condition, by its name,
            with Ipopt's sign (positive for an active upper bound): (m,) at an end, (nodes, m) along
            the path, and for conditions in q and v (segments * (degree + 1), m), as interior
            breakpoints belong to two segments.
    """

    problem: Problem
    path: Path
    stats: Stats
    multipliers: Mapping[str, Array]
    violations: tuple[Violation, ...]
    iterate: FinalIterate = field(repr=False)

    def __repr__(self) -> str:
        stats, kind = self.stats, type(self.problem).__name__
        if not stats.success:
            return f"Solution of {kind}: not solved, {stats.status}"
        lines = [
            f"Solution of {kind}: energy {stats.energy:.6g}, length {self.path.length:.6g}",
            f"  {stats.status} in {stats.total_iterations} iterations, "
            f"{stats.total_seconds:.2g} s; largest violation {stats.max_path_violation:.1e}",
        ]
        if "certificate" in self.__dict__:  # computing it takes longer than a repr may
            lines.append(f"  {self.certificate}")
        return "\n".join(lines)

    @cached_property
    def certificate(self) -> Certificate:
        """How close the path is to a geodesic, and whether it is locally minimizing.

        Under constraints: whether the energy decreases, to second order, in any direction in which
        the active conditions remain satisfied.
        """
        conditions = self.problem.definition().conditions
        return certify_iterate(self.iterate, NodeBounds.on_grid(conditions, self.path.grid))

    def record(self) -> dict[str, Any]:
        """The solution as JSON values: nodes of the path [rad or m], statistics, multipliers.

        The problem is recorded by the name of its class and by those fields that are numbers,
        strings, obstacles, or lists and arrays of them.
        """
        grid, iterate = self.path.grid, self.iterate
        nlp = {
            "origin": iterate.units.origin,
            "length": iterate.units.length,
            "scale": iterate.units.scale,
            "energy_only": iterate.energy_only,
            **{name: getattr(iterate, name) for name in ITERATE_ARRAYS},
        }
        record = {
            "format": FORMAT,
            "version": VERSION,
            "problem": type(self.problem).__qualname__,
            "module": type(self.problem).__module__,
            **encoded_fields(self.problem),
            "joint_names": self.path.metric.joint_names,
            "grid": asdict(grid),
            "s": grid.nodes,
            "nodes": self.path.nodes,
            "stats": asdict(self.stats),
            "multipliers": dict(self.multipliers),
            "nlp": nlp,
        }
        plain: dict[str, Any] = as_json(record)
        return plain

    def save(self, file: str | PathLike[str]) -> FilePath:
        """Write `record` to a JSON file, which `load_solution` reads; all of it or nothing.

        Returns:
            Path of the file.

        Raises:
            OSError: the file cannot be written.
        """
        text = json.dumps(self.record(), indent=1, allow_nan=False)
        return write_file(file, text)

    def resample(self, count: int, by: str = "length") -> Array:
        """Positions (count, n) along the path; see `Path.resample`."""
        return self.path.resample(count, by)

    def to_motion(self, timing: float | TimeLaw, rate: float = 100.0) -> Motion:
        """The path as a motion in time, with velocities.

        Args:
            timing: duration [s] of a motion from rest to rest with the least squared acceleration
                s''(t) along the path (`time_law`); or a time law, which may have any end speeds.
            rate: samples per second [Hz], rounded so that they are evenly spaced up to the end.

        Raises:
            ValueError: a duration or rate that is not positive, a path of zero length, or a time
                law for another length.
            NotConverged: the path is no solution, or violates the problem's conditions.
        """
        allowed = max(BETWEEN_NODES, 1.1 * self.stats.max_path_violation)
        names, conditions = self.path.metric.joint_names, self.problem.definition().conditions
        violations = find_violations(conditions, self.path, names)
        if not self.stats.success or (violations and not violations[0].amount <= allowed):
            cause = "; ".join(map(str, violations[:1])) or self.stats.status
            raise NotConverged(f"no motion along a path that is not a solution: {cause}", self)
        return motion_along(self.path, timing, rate)

    def plot(self) -> Figure:
        """Coordinates and speed over s, beside the path of the hand or in the plane, and the arm.

        The arm is drawn at some values of s, with the obstacles of the problem; where it comes
        nearest to one of them, the distance of its collision bodies is given.
        """
        title = (
            f"{type(self.problem).__name__}: energy {self.stats.energy:.4g}, "
            f"length {self.path.length:.4g}"
        )
        return draw_path(
            self.path,
            title,
            self.problem.draw,
            obstacles=drawn_obstacles(self.problem),
            links=getattr(self.problem, "links", None),
        )


ITERATE_ARRAYS = ("p_values", "x", "lam_x", "lam_g", "fixed_x", "fixed_g")


def with_effort_of(before: Stats, solution: Solution) -> Solution:
    """The solution with the iterations and seconds of a preceding solve added to its own."""
    stats = solution.stats
    iterations, seconds = stats.iterations + before.iterations, stats.seconds + before.seconds
    return replace(solution, stats=replace(stats, iterations=iterations, seconds=seconds))
