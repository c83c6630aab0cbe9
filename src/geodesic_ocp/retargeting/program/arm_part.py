"""One arm's part of the program: positions at the nodes of its paths, energy, waypoints, speeds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Block
from geodesic_ocp.logarithm.pose_shooting import metric_of
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.nlp.definition import Structure
from geodesic_ocp.ocp.nlp.transcription import Transcription, Units
from geodesic_ocp.ocp.problem.point_to_point import PointToPoint
from geodesic_ocp.ocp.solve.refinement import halved
from geodesic_ocp.retargeting.program.terms import ObjectiveWeights
from geodesic_ocp.retargeting.program.waypoint_functions import parameters
from geodesic_ocp.retargeting.program.waypoints import ArmWaypoints
from geodesic_ocp.trajectory.grid import Grid
from geodesic_ocp.trajectory.path import Path


@dataclass(frozen=True, eq=False)
class ArmPart:
    """One arm with the grid of its paths, one after the other over the time in which it moves.

    Attributes:
        waypoints: of the arm.
        missed: weights of the squared errors of poses out of reach (m + 1,); zero for those within
            reach, which are equalities.
        grid: over the arm's own time from 0 to 1, in which rests are left out.
        last_segments: of the movements, (m,): number of segments up to the end of each.
    """

    waypoints: ArmWaypoints
    missed: Array
    grid: Grid
    last_segments: tuple[int, ...]

    @classmethod
    def evenly(cls, waypoints: ArmWaypoints, missed: Array, segments: int, degree: int) -> ArmPart:
        """With so many segments of equal duration for each movement."""
        edges = np.concatenate([[0.0], np.cumsum(waypoints.durations)])
        edges /= edges[-1]
        edges[-1] = 1.0
        fine = np.interp(
            np.arange(segments * waypoints.count + 1) / segments, np.arange(edges.size), edges
        )
        grid = Grid(fine.size - 1, degree, tuple(fine.tolist()))
        last = tuple(segments * (number + 1) for number in range(waypoints.count))
        return cls(waypoints, missed, grid, last)

    def halved(self, coarse: NDArray[np.bool_]) -> ArmPart:
        """With some of the segments (segments,) halved."""
        every = np.cumsum(1 + coarse)
        last = tuple(int(every[number - 1]) for number in self.last_segments)
        return replace(self, grid=halved(self.grid, coarse), last_segments=last)

    @property
    def within_reach(self) -> tuple[bool, ...]:
        """Which poses are equalities (m + 1,)."""
        return tuple((self.missed == 0.0).tolist())

    @property
    def dof(self) -> int:
        """Number n of joints."""
        return self.waypoints.arm.dof

    @property
    def size(self) -> int:
        """Number of variables."""
        return self.grid.size * self.dof

    @property
    def waypoint_nodes(self) -> list[int]:
        """Nodes of the grid at the waypoints (m + 1,)."""
        return [0, *(self.grid.degree * last for last in self.last_segments)]

    @property
    def moving_time(self) -> float:
        """Sum of the movements' durations [s]."""
        return float(self.waypoints.durations.sum())

    @cached_property
    def transcription(self) -> Transcription:
        """Energy of all paths with its derivatives."""
        return _structure(self.waypoints.arm).transcription(self.grid)

    def energy_parameters(self, action: float) -> ca.DM:
        """Of the transcription, so that its objective is the action in this unit [J s]."""
        units = Units(np.zeros(self.dof), 1.0, action * self.moving_time)
        return ca.DM(units.parameters(self.grid))

    def waypoint_block(self, first: int, weights: ObjectiveWeights) -> Block:
        """Poses and postures at the waypoints.

        Args:
            first: index of the first of the arm's variables.
            weights: of the objective.
        """
        given, rows = self.waypoints, []
        count = given.count + 1
        for number, pose in enumerate(given.poses):
            missed = np.zeros(6)
            missed[list(given.rows)] = self.missed[number] * count * given.row_weights**2
            offset = None if given.offsets is None else given.offsets[number]
            rows.append(parameters(pose, missed, offset, weights.posture, weights.likeness))
        places = first + self.dof * np.array(self.waypoint_nodes)[:, None] + np.arange(self.dof)
        free = ~np.array(self.within_reach)
        free[0] |= given.start is not None
        upper = np.where(free[:, None], np.inf, np.zeros(len(given.rows)))
        share = np.full(count, 1.0 / count)
        return Block(given.terms, places, np.array(rows), -upper, upper, share)

    def bounds(self) -> tuple[Array, Array]:
        """Of the positions at the nodes, (size, n) each."""
        given, shape = self.waypoints, (self.grid.size, self.dof)
        low, high = np.full(shape, -np.inf), np.full(shape, np.inf)
        if given.limited:
            low[:], high[:] = given.arm.lower, given.arm.upper
        if given.start is not None:
            low[0] = high[0] = given.start
        return low, high

    def speed_rows(self, intervals: Sequence[Array]) -> tuple[scipy.sparse.coo_array, Array]:
        """Matrices A (rows, size) and B (rows, intervals): A x <= 1 + B sigma bounds mean speeds.

        x are the positions, sigma the relative times added to the intervals. The means are those
        over the halves of the movements, which leaves the paths in between as they are.

        Args:
            intervals: for each movement the share of each interval in its duration.
        """
        n, given, degree = self.dof, self.waypoints, self.grid.degree
        rows: list[int] = []
        columns: list[int] = []
        entries: list[float] = []
        times: list[Array] = []
        breakpoints, first = self.grid.breakpoints, 0
        for number, last in enumerate(self.last_segments):
            middle = int(
                np.argmin(np.abs(2.0 * breakpoints - breakpoints[first] - breakpoints[last]))
            )
            pieces = [(first, last)] if last - first == 1 else [(first, middle), (middle, last)]
            joints = np.flatnonzero(np.isfinite(given.speed[number]))
            for begin, end in pieces:
                seconds = self.moving_time * (breakpoints[end] - breakpoints[begin])
                for joint in joints:
                    scale = 1.0 / (given.speed[number, joint] * seconds)
                    for sign in (scale, -scale):
                        rows += [len(times), len(times)]
                        columns += [degree * end * n + int(joint), degree * begin * n + int(joint)]
                        entries += [sign, -sign]
                        times.append(intervals[number])
            first = last
        matrix = scipy.sparse.coo_array((entries, (rows, columns)), (len(times), self.size))
        return matrix, np.reshape(times, (len(times), len(intervals[0])))

    def nodes_on_lines(self, q: Array) -> Array:
        """Positions at the nodes (size, n) on the straight lines between waypoints (m + 1, n)."""
        edges = self.grid.breakpoints[[0, *self.last_segments]]
        return np.column_stack(
            [np.interp(self.grid.nodes, edges, q[:, joint]) for joint in range(self.dof)]
        )

    def path(self, nodes: Array) -> Path:
        """The whole path through the nodes (size, n)."""
        return Path(metric_of(self.waypoints.arm), self.grid, nodes)

    def paths(self, nodes: Array) -> list[Path]:
        """The path of each movement."""
        grid, found, first = self.grid, [], 0
        for last in self.last_segments:
            ends = grid.breakpoints[first : last + 1]
            ends = (ends - ends[0]) / (ends[-1] - ends[0])
            part = Grid(
                last - first, grid.degree, tuple(ends.tolist()) if last - first > 1 else None
            )
            here = nodes[grid.degree * first : grid.degree * last + 1]
            found.append(Path(metric_of(self.waypoints.arm), part, here))
            first = last
        return found


@lru_cache(maxsize=32)
def _structure(arm: Model) -> Structure:
    """Of least energy alone."""
    metric = metric_of(arm)
    ends = tuple(np.zeros(arm.dof).tolist()), tuple(np.ones(arm.dof).tolist())
    return PointToPoint(metric, *ends).definition().structure
