"""Solutions of problems: the path with its statistics, multipliers and violations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from functools import cached_property
from os import PathLike
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.ipopt import STOPPED
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Ball, Box, Capsule, HalfSpace
from geodesic_ocp.ocp.certificate import Certificate, FinalIterate, certify_iterate
from geodesic_ocp.ocp.conditions import Conditions
from geodesic_ocp.ocp.nlp import NLP
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.ocp.transcription import Units
from geodesic_ocp.ocp.violations import BETWEEN_NODES, NEGLIGIBLE, Violation, find_violations
from geodesic_ocp.records import as_json, write_record
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.time_law import TimeLaw, motion_along


@dataclass(frozen=True)
class MeshIteration:
    """One solve of a mesh refinement.

    Attributes:
        segments: segments of its grid.
        iterations, seconds: iterations and seconds of Ipopt.
        objective: the value reached.
        max_path_violation: largest violation of any condition anywhere on the path, in its scale.
    """

    segments: int
    iterations: int
    seconds: float
    objective: float
    max_path_violation: float


@dataclass(frozen=True, repr=False)
class Stats:
    """Statistics of one solve.

    Attributes:
        success: whether the path is a local solution, to Ipopt's tolerance.
        status: how the solver stopped, a sentence.
        iterations: iterations of Ipopt; with several grids, on the last one (`mesh_history` has
            all).
        seconds: wall time of the solver, likewise.
        variables, constraints: sizes of the NLP, bounds not counted.
        energy: energy of the path by the quadrature of its grid, 1/2 int |q'|_G^2 ds.
        objective: what was minimized, energy and running cost.
        max_node_violation: largest violation of any condition at the nodes, in its scale: how much
            its value changes over the size of the problem (docs/how-to/problem.md).
        worst_constraint: name of the condition with that violation.
        max_path_violation: the same anywhere on the path, between the nodes included.
        mesh_history: the solves of a mesh refinement; empty if there was none.
        guess: the guess that led to the solution, if `solve` has found another than the first.
        gap: how far the objective may be above the least on this grid, as Ipopt stays off bounds.
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
    guess: str = ""
    gap: float = 0.0

    def __repr__(self) -> str:
        refined = f" on {len(self.mesh_history)} grids" if len(self.mesh_history) > 1 else ""
        return (
            f"Stats({self.status}: {self.total_iterations} iterations{refined}, "
            f"{self.total_seconds:.2g} s, energy {self.energy:.6g}, "
            f"largest violation {self.max_path_violation:.1e})"
        )

    @property
    def total_iterations(self) -> int:
        """Iterations of Ipopt on all grids."""
        return sum(each.iterations for each in self.mesh_history) or self.iterations

    @property
    def total_seconds(self) -> float:
        """Wall time [s] of the solver on all grids."""
        return sum(each.seconds for each in self.mesh_history) or self.seconds


@dataclass(frozen=True)
class Attempt:
    """One guess that a search has tried.

    Attributes:
        guess: its name; empty: the problem's own, or the one given.
        segments: of the last grid.
        success, status, objective: how its solve ended.
        iterations, seconds: of Ipopt, on all grids.
    """

    guess: str
    segments: int
    success: bool
    status: str
    objective: float
    iterations: int
    seconds: float

    @classmethod
    def of(cls, guess: str, segments: int, stats: Stats) -> Attempt:
        """Return the record of a solve with these statistics."""
        return cls(
            guess=guess,
            segments=segments,
            success=stats.success,
            status=stats.status,
            objective=stats.objective,
            iterations=stats.total_iterations,
            seconds=stats.total_seconds,
        )


_DATACLASSES = {kind.__name__: kind for kind in (Ball, Box, Capsule, HalfSpace)}


def encoded_fields(problem: object) -> dict[str, Any]:
    """Return the fields of a dataclass as JSON values.

    Returns:
        "fields", values by name; "models", descriptions of models, which are not saved themselves;
        and "left_out", names of all other fields that JSON cannot hold, metrics excepted.
    """
    kept: dict[str, Any] = {}
    models: dict[str, Any] = {}
    left_out = []
    for each in fields(problem) if is_dataclass(problem) else ():
        if not each.init:
            continue
        value = getattr(problem, each.name)
        if isinstance(value, Model):
            models[each.name] = described_model(value)
            continue
        try:
            kept[each.name] = encoded(value)
        except TypeError:
            if not isinstance(value, Metric):  # the path's energy identifies it
                left_out.append(each.name)
    return {"fields": kept, "models": models, "left_out": left_out}


def described_model(model: Model) -> dict[str, Any]:
    """Return what must be equal for a model to be taken for the one that was saved."""
    return {
        "name": model.name,
        "hand": model.hand,
        "joint_names": list(model.joint_names),
        "lower": as_json(model.lower),
        "upper": as_json(model.upper),
    }


def encoded(value: Any) -> Any:
    """Return a JSON value from which `decoded` restores the value.

    Raises:
        TypeError: a value that JSON cannot hold.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray):
        if value.dtype.kind not in "biuf":
            raise TypeError
        return {"array": [encoded(each) for each in value.ravel().tolist()], "shape": value.shape}
    if isinstance(value, (list, tuple)):
        return {type(value).__name__: [encoded(each) for each in value]}
    if type(value).__name__ in _DATACLASSES:
        parts = {each.name: encoded(getattr(value, each.name)) for each in fields(value)}
        return {"dataclass": type(value).__name__, "fields": parts}
    if isinstance(value, float) and not np.isfinite(value):
        return {"number": str(value)}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError


def decoded(value: Any) -> Any:
    """Return the value from which `encoded` made a JSON value."""
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return np.array([decoded(each) for each in value["array"]]).reshape(value["shape"])
    if "number" in value:
        return float(value["number"])
    if "dataclass" in value:
        parts = {name: decoded(each) for name, each in value["fields"].items()}
        return _DATACLASSES[value["dataclass"]](**parts)
    [(name, entries)] = value.items()
    return {"tuple": tuple, "list": list}[name](map(decoded, entries))


FORMAT = "geodesic_ocp solution"
VERSION = 1


class SavedSolution:
    """What solutions of paths and of motions have in common: an objective, and a file."""

    problem: Any
    stats: Stats

    @property
    def objective(self) -> float:
        """The value reached: energy and running cost of a path, cost of a motion."""
        return self.stats.objective

    def record(self) -> dict[str, Any]:
        """Return the solution as JSON values."""
        raise TypeError(f"{type(self).__name__} has no record")

    def recorded(self, **found: Any) -> dict[str, Any]:
        """Return JSON values of the problem, the statistics, and what was found."""
        record = {
            "format": FORMAT,
            "version": VERSION,
            "problem": type(self.problem).__qualname__,
            "module": type(self.problem).__module__,
            **encoded_fields(self.problem),
            "joint_names": self.problem.metric.joint_names,
            "stats": asdict(self.stats),
            **found,
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
        return write_record(file, self.record())


@dataclass(frozen=True, eq=False, repr=False)
class Solution(SavedSolution):
    """A path of least energy under a problem's conditions, or the last iterate towards one.

    Attributes:
        problem: the problem that was solved.
        conditions: all its conditions; the NLP may have some of them.
        path: the path that was found.
        stats: statistics of the solve; `stats.success` distinguishes a solution from an iterate.
        iterate: the NLP's last iterate, in its units.
    """

    problem: Problem
    conditions: Conditions
    path: Path
    stats: Stats
    iterate: FinalIterate

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle problem and numbers: CasADi's expressions are built again from the problem."""
        return restored, (self.problem, self._numbers)

    @property
    def _numbers(self) -> SolutionNumbers:
        iterate = self.iterate
        return SolutionNumbers(
            grid=self.path.grid,
            nodes=self.path.nodes,
            stats=self.stats,
            size=iterate.nlp.definition.size,
            scales={each.name: each.scales for each in self.conditions},
            kept=iterate.nlp.conditions.kept,
            units=iterate.nlp.units,
            x=iterate.x,
            lam_bounds=iterate.lam_bounds,
            lam_g=iterate.lam_g,
        )

    def __repr__(self) -> str:
        stats = self.stats
        kind = type(self.problem).__name__
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
    def violations(self) -> tuple[Violation, ...]:
        """Conditions that the path violates, between its nodes included, the worst first."""
        return find_violations(self.conditions, self.path)

    @cached_property
    def multipliers(self) -> Mapping[str, Array]:
        """Derivatives of the least energy by the value of each condition, by its name, with Ipopt's
        sign (positive for an active upper bound): (m,) at an end, (nodes, m) along the path, and
        for conditions in q and v (segments * (degree + 1), m), as interior breakpoints belong to
        two segments.
        """
        iterate = self.iterate
        units = self.iterate.nlp.units
        sizes = {each.name: (self.path.grid.size, each.size) for each in self.conditions.along_q}
        others: dict[str, Array] = {name: np.zeros(size) for name, size in sizes.items()}
        bounds = iterate.nlp.bounds
        lam_x = units.scale / units.length * iterate.lam_x
        lam_g = units.scale / bounds.scales_g * iterate.lam_g
        return others | bounds.multipliers(lam_x, lam_g)

    @cached_property
    def certificate(self) -> Certificate:
        """The certificate: distance from a geodesic, and whether the path is locally minimizing.

        Under constraints: whether the energy decreases, to second order, in any direction in which
        the active conditions remain satisfied.
        """
        return certify_iterate(self.iterate, self.stats.success)

    def record(self) -> dict[str, Any]:
        """Return the solution as JSON values: nodes of the path [rad or m], statistics,
        multipliers.

        The problem is recorded by the name of its class and by those fields that are numbers,
        strings, obstacles, or lists and arrays of them.
        """
        numbers = self._numbers
        arrays = {name: getattr(self.iterate, name) for name in ("x", "lam_x", "lam_g")}
        arrays["conditions"] = numbers.kept
        return self.recorded(
            grid=asdict(numbers.grid),
            s=numbers.grid.nodes,
            nodes=self.path.nodes,
            nlp=asdict(numbers.units) | arrays,
            size=numbers.size,
            scales=numbers.scales,
            multipliers=dict(self.multipliers),
        )

    def resample(self, count: int) -> Array:
        """Return positions (count, n) along the path; see `Path.resample`."""
        return self.path.resample(count)

    def to_motion(self, timing: float | TimeLaw, rate: float = 100.0) -> Motion:
        """Return the path as a motion in time, with velocities.

        Args:
            timing: duration [s] of a motion from rest to rest with the least squared acceleration
                s''(t) along the path (`time_law`); or a time law, which may have any end speeds.
            rate: samples per second [Hz], rounded so that they are evenly spaced up to the end.

        Raises:
            ValueError: a duration or rate that is not positive, a path of zero length, a time law
                for another length, or joints that would be faster than the problem's `speed`.
            NotConverged: the path is no solution, or violates the problem's conditions.
        """
        allowed = max(BETWEEN_NODES, 1.1 * self.stats.max_path_violation)
        violations = self.violations
        if not self.stats.success or (violations and not violations[0].relative <= allowed):
            cause = "; ".join(map(str, violations[:1])) or self.stats.status
            raise NotConverged(f"no motion along a path that is not a solution: {cause}", self)
        motion = motion_along(self.path, timing, rate)
        limit = getattr(self.problem, "speed", None)
        if limit is not None and hasattr(self.problem, "check_path_constraints"):  # in q'(s)
            shares = np.abs(np.asarray(motion.velocity)).max(axis=0) / limit
            joint = motion.joint_names[int(shares.argmax())]
            excess = float(shares.max())
            if excess > 1.0 + allowed:
                raise ValueError(
                    f"in {motion.duration:g} s {joint} would move at {excess:.3g} times the speed "
                    f"of the problem; in {excess * motion.duration:.4g} s it keeps that limit"
                )
        return motion


@dataclass(frozen=True, eq=False)
class SolutionNumbers:
    """A solution but for its problem.

    Attributes:
        grid: grid of the path.
        nodes: positions (size, n) at its nodes.
        stats: statistics of the solve.
        size: size of the problem in its coordinates.
        scales: scales (m,) of its conditions, by name.
        kept: cells of s in which conditions in q were part of the program, by name.
        units: units of the program.
        x, lam_bounds, lam_g: see `FinalIterate`.
    """

    grid: Grid
    nodes: Array
    stats: Stats
    size: float
    scales: Mapping[str, Array]
    kept: Mapping[str, NDArray[np.bool_]]
    units: Units
    x: Array
    lam_bounds: Array
    lam_g: Array


def restored(problem: Problem, numbers: SolutionNumbers) -> Solution:
    """Return a solution of a problem from its numbers; ValueError if shapes do not fit."""
    definition = problem.definition()
    grid = numbers.grid
    conditions = definition.conditions.with_scales(numbers.scales, numbers.size)
    path = Path(problem.metric, grid, numbers.nodes)
    definition = replace(definition, conditions=conditions, size=numbers.size)
    definition = definition.restricted(numbers.kept)
    if len(grid.via_segments) != len(conditions.via):
        raise ValueError(
            f"the path has {len(grid.via_segments)} via points, not {len(conditions.via)}"
        )
    nlp = NLP(
        definition=definition,
        transcription=definition.transcription(grid),
        grid=grid,
        bounds=definition.bounds(grid),
        units=numbers.units,
        nodes=path.nodes,
    )
    iterate = FinalIterate(nlp, numbers.x, numbers.lam_bounds, numbers.lam_g)
    sizes = {
        "x": path.nodes.size,
        "lam_bounds": path.nodes.size,
        "lam_g": nlp.bounds.lower_g.size,
    }
    for name, size in sizes.items():
        if getattr(iterate, name).shape != (size,):
            raise ValueError(f"nlp.{name} must be {size} numbers")
    return Solution(problem, conditions, path, numbers.stats, iterate)


def with_effort_of(before: Stats, solution: Solution) -> Solution:
    """Return the solution with the iterations and seconds of a preceding solve added to its own."""
    stats = solution.stats
    iterations = stats.iterations + before.iterations
    seconds = stats.seconds + before.seconds
    return replace(solution, stats=replace(stats, iterations=iterations, seconds=seconds))


_LISTED = 3  # violations in a message


def describe_failure(solution: Solution) -> str:
    """Return why there is no solution, which conditions are violated, and what to try."""
    stats = solution.stats
    large = [each for each in solution.violations if each.relative > NEGLIGIBLE][:_LISTED]
    violated = f": {'; '.join(map(str, large))}" if large else ", with no condition violated"
    advice = (
        ". Are its conditions compatible? If so, try another guess (guess(s) or solve(..., "
        "guess=path)) or a finer grid"
    )
    told = stats.status == STOPPED or len(stats.mesh_history) > 1 or "leave grid" in stats.status
    advice = "" if told else advice
    return (
        f"{type(solution.problem).__name__} was not solved: {stats.status}, after "
        f"{stats.iterations} iterations{violated}{advice}."
    )
