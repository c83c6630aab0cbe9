"""A fit of markers as variables, predictions, priors and bounds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.recordings.markers.program.body import MarkedBody
from geodesic_ocp.recordings.markers.program.fit_program import FitProgram, FrameTerms
from geodesic_ocp.recordings.markers.program.fit_settings import (
    LENGTH_SPREAD,
    LOOSE_SPREAD,
    POSTURE_SPREAD,
    PRIOR_TIME,
    ROOT_LEVER,
    FitSettings,
)
from geodesic_ocp.recordings.markers.program.smoothness import roughness, sample_shares

ROOT = 6  # coordinates of a root that moves


@dataclass(frozen=True, eq=False)
class FitProblem:
    """What is sought, and from which markers.

    The variables of a frame are the root's position [m] and angles about z, y and x, if it moves,
    and the joints of the model. Lengths are relative to the model's, in units of LENGTH_SPREAD;
    offsets are relative to the marker set's, in units of the marker's uncertainty.

    Attributes:
        body: with its root.
        segments: of the m markers.
        places: of the markers on them (m, 3) [m].
        uncertainty: of the places (m,) [m].
        lengths: relative to the model's, as far as they are known.
        sought: which of the lengths are estimated.
        height_spread: standard deviation of the body height, relative, if it is estimated.
        axes: of the space in which the root's angles are taken (3, 3).
        settings: of the fit.
    """

    body: MarkedBody
    segments: tuple[str, ...]
    places: Array
    uncertainty: Array
    lengths: Array
    sought: NDArray[np.bool_]
    height_spread: float
    axes: Array
    settings: FitSettings

    @property
    def moves(self) -> bool:
        """Whether the root moves."""
        return self.settings.base == "free"

    @property
    def first_joint(self) -> int:
        """Index of the first joint among the variables of a frame."""
        return ROOT if self.moves else 0

    @property
    def nz(self) -> int:
        """Number of variables of a frame."""
        return self.first_joint + self.body.model.dof

    @cached_property
    def free_offsets(self) -> NDArray[np.int64]:
        """Indices of the markers whose offsets are estimated."""
        if not self.settings.offsets:
            return np.zeros(0, dtype=np.int64)
        return np.flatnonzero(self.uncertainty > 0.0)

    @property
    def ns(self) -> int:
        """Number of shared variables."""
        return int(self.sought.sum()) + 3 * self.free_offsets.size

    def shared_values(self, shared: Array) -> tuple[Array, Array]:
        """Lengths relative to the model's, and offsets (m, 3) [m], from the shared variables."""
        lengths, offsets = self._shared(ca.SX(shared))
        return ca.evalf(lengths).full()[:, 0], ca.evalf(offsets).full().T

    def _shared(self, shared: ca.SX) -> tuple[ca.SX, ca.SX]:
        lengths = ca.SX(self.lengths)
        count = int(self.sought.sum())
        for place, index in enumerate(np.flatnonzero(self.sought)):
            lengths[int(index)] += LENGTH_SPREAD * shared[place]
        offsets = ca.SX(self.places.T)
        for place, marker in enumerate(self.free_offsets.tolist()):
            own = shared[count + 3 * place : count + 3 * place + 3]
            offsets[:, marker] += self.uncertainty[marker] * own
        return lengths, offsets

    @cached_property
    def terms(self) -> FrameTerms:
        """Predicted positions of the markers in a frame."""
        z, shared = ca.SX.sym("z", self.nz), ca.SX.sym("s", self.ns)
        lengths, offsets = self._shared(shared)
        attachments = [self.body.attachment(segment) for segment in self.segments]
        points = self.body.points(z[self.first_joint :], lengths, attachments, offsets)
        if self.moves:
            points = z[:3] + self.root_rotation(z[3:ROOT]) @ points
        else:
            base = ca.SX(self.body.to_base)
            if self.body.lone_side:
                base *= lengths[self.body.lengths.index("shoulder half width")]
            points = points - base
        return FrameTerms(z, shared, points)

    def root_rotation(self, angles: ca.SX) -> ca.SX:
        """Rotation of the root from its angles about z, y and x, in this order."""
        turn, side, tilt = ca.vertsplit(angles)
        z = _rotation(ca.cos(turn), ca.sin(turn), 2)
        y = _rotation(ca.cos(side), ca.sin(side), 1)
        return ca.SX(self.axes) @ z @ y @ _rotation(ca.cos(tilt), ca.sin(tilt), 0)

    def root_angles(self, rotations: Array) -> Array:
        """Angles (k, 3) of rotations (k, 3, 3) over time, without jumps."""
        own = scipy.spatial.transform.Rotation.from_matrix(self.axes.T @ rotations)
        return np.unwrap(own.as_euler("ZYX"), axis=0)

    @cached_property
    def neutral(self) -> Array:
        """Variables of a frame (nz,) with the joints at zero, or at the limit next to it."""
        model = self.body.model
        posture = np.clip(np.zeros(model.dof), model.lower, model.upper)
        return np.concatenate([np.zeros(self.first_joint), posture])

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Of the variables of a frame."""
        n, free = self.body.model.dof, np.full(self.first_joint, np.inf)
        lower, upper = self.body.model.lower, self.body.model.upper
        if not self.settings.limits:
            lower, upper = np.full(n, -np.inf), np.full(n, np.inf)
        return np.concatenate([-free, lower]), np.concatenate([free, upper])

    def program(self, time: Array, observed: Array, loose: NDArray[np.bool_]) -> FitProgram:
        """The program for observed positions (k, m, 3) [m], NaN where missing.

        `loose` (n,) says which joints the markers do not determine.
        """
        count, (lower, upper) = time.size, self.bounds
        duration = float(time[-1] - time[0])
        seen = ~np.isnan(observed[:, :, 0])
        share = sample_shares(time)[:, None] / (duration * len(self.segments))
        none = np.full(self.ns, np.inf)
        return FitProgram(
            self.terms,
            np.where(np.isnan(observed), 0.0, observed),
            np.where(seen, share, 0.0) / self.settings.noise**2,
            self._quadratic(time, duration, loose),
            np.concatenate([np.tile(lower, count), -none]),
            np.concatenate([np.tile(upper, count), none]),
        )

    def _quadratic(
        self, time: Array, duration: float, loose: NDArray[np.bool_]
    ) -> tuple[scipy.sparse.csc_matrix, Array]:
        """Smoothness and priors."""
        settings = self.settings
        rough = roughness(time, {2: settings.acceleration, 3: settings.jerk})
        levers = np.ones(self.nz)
        if self.moves:
            levers[:3] = 1.0 / ROOT_LEVER
        share = sample_shares(time)
        weak = np.zeros(self.nz)
        weak[self.first_joint :] = np.where(loose, LOOSE_SPREAD, POSTURE_SPREAD) ** -2.0
        of_frames = scipy.sparse.kron(rough, scipy.sparse.diags(levers**2))
        of_frames += scipy.sparse.kron(scipy.sparse.diags(share), scipy.sparse.diags(weak))
        towards = np.kron(share, weak * self.neutral) / (duration * len(self.segments))
        scale = duration * len(self.segments)
        hessian, slope = self.priors()
        weight = PRIOR_TIME / scale
        matrix = scipy.sparse.block_diag([of_frames / scale, weight * hessian], format="csc")
        return matrix, np.concatenate([towards, weight * slope])

    def priors(self) -> tuple[Array, Array]:
        """Hessian and minus the slope, at zero, of the priors of the shared variables.

        Lengths are in proportion to the body height, which is near its first value.
        """
        shared = ca.SX.sym("s", self.ns)
        lengths, _ = self._shared(shared)
        count = int(self.sought.sum())
        total = ca.dot(shared[count:], shared[count:]) / 2
        for index in np.flatnonzero(self.sought).tolist():
            if index == 0:
                total += ((lengths[0] / self.lengths[0] - 1) / self.height_spread) ** 2 / 2
            else:
                total += ((lengths[index] - lengths[0]) / LENGTH_SPREAD) ** 2 / 2
        if not self.ns:
            return np.zeros((0, 0)), np.zeros(0)
        hessian, gradient = ca.hessian(total, shared)
        at = ca.Function("priors", [shared], [ca.densify(hessian), ca.densify(gradient)])
        values = at(np.zeros(self.ns))
        return values[0].full(), -values[1].full()[:, 0]


def _rotation(cos: ca.SX, sin: ca.SX, axis: int) -> ca.SX:
    matrix = ca.SX.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix[i, i], matrix[j, j], matrix[i, j], matrix[j, i] = cos, cos, -sin, sin
    return matrix
