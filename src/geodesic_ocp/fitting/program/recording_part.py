"""The contribution of one recording to the program of a fit."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.fitting.program.observed_segments import ObservedSegments
from geodesic_ocp.fitting.program.segment_functions import SegmentFunctions


@dataclass(frozen=True, eq=False)
class RecordingPart:
    """One recording's contribution: its data and the functions of its model.

    Attributes:
        functions: of one segment.
        observed: the data.
        deviation: standard deviation of the error that serves as unit [rad or m].
    """

    functions: SegmentFunctions
    observed: ObservedSegments
    deviation: float

    def __repr__(self) -> str:
        return f"RecordingPart({self.observed.recording.name!r}, {self.count} segments)"

    @cached_property
    def count(self) -> int:
        """Number of segments."""
        return len(self.observed.segments)

    @cached_property
    def _data(self) -> Array:
        """Observations (m, k) of the samples."""
        if self.functions.measure == "joint":
            return self.observed.samples.T
        return np.asarray(self.functions.model.hand_pose(self.observed.samples)[1].T)

    @cached_property
    def _owner_matrix(self) -> ca.DM:
        """(k, count), sums over the samples of each segment, as means of the recording."""
        k = self.observed.owners.size
        matrix = np.zeros((k, self.count))
        matrix[np.arange(k), self.observed.owners] = 1.0 / (k * self.deviation**2)
        return ca.sparsify(ca.DM(matrix))

    def _samples(self, x: ca.MX) -> list[ca.MX | ca.DM]:
        repeated = x[:, self.observed.owners.tolist()]
        return [repeated, ca.DM(self.observed.fractions[None]), ca.DM(self._data)]

    def errors(self, x: ca.MX) -> ca.MX:
        """Half the mean squared error of each segment's samples, relative, (1, count)."""
        function = self.functions.sample_error.map(self.observed.owners.size)
        return function(*self._samples(x)) @ self._owner_matrix

    def error_gradients(self, x: ca.MX) -> ca.MX:
        """Their gradients by x (num_x, count)."""
        function = self.functions.sample_gradient.map(self.observed.owners.size)
        return function(*self._samples(x)) @ self._owner_matrix

    def error_hessians(self, x: ca.MX) -> ca.MX:
        """Upper triangles of their Hessians by x, (num_x (num_x + 1) / 2, count)."""
        function = self.functions.sample_hessian.map(self.observed.owners.size)
        return function(*self._samples(x)) @ self._owner_matrix

    def _at_nodes(self, x: ca.MX, theta: ca.MX) -> list[ca.MX | ca.DM]:
        f = self.functions
        nodes = ca.reshape(x[: f.num_nodes, :], f.dim, f.grid.size * self.count)
        inner = f.grid.size - 2
        scales = np.repeat(self.observed.scales.T, inner, axis=1)
        return [f.states(nodes), ca.repmat(theta, 1, inner * self.count), ca.DM(scales)]

    def equations(self, x: ca.MX, theta: ca.MX) -> ca.MX:
        """Left sides of the geodesic equations (equations, count)."""
        f = self.functions
        every = f.node_equation.map(self.count * (f.grid.size - 2))(*self._at_nodes(x, theta))
        return ca.reshape(every, f.num_equations, self.count)

    def equation_jacobians(self, x: ca.MX, theta: ca.MX) -> ca.MX:
        """Their derivatives by theta and nodes, columns first, (.., count)."""
        f = self.functions
        every = f.node_jacobian.map(self.count * (f.grid.size - 2))(*self._at_nodes(x, theta))
        return f.assemble_jacobian.map(self.count)(every)

    def equation_hessians(self, x: ca.MX, theta: ca.MX, factors: ca.MX) -> ca.MX:
        """Upper triangles of the Hessians of factors' equations by theta and nodes, (.., count)."""
        f = self.functions
        inner = f.grid.size - 2
        per_node = ca.reshape(factors, f.dim, inner * self.count)
        arguments = [*self._at_nodes(x, theta), per_node]
        every = f.node_hessian.map(self.count * inner)(*arguments)
        return f.assemble_hessian.map(self.count)(every)
