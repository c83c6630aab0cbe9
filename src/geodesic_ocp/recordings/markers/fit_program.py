"""The nonlinear program of a motion that fits markers.

Variables: root and joints of every frame, and what is common to all frames: lengths and offsets of
markers. Objective, divided by the duration:

    integral of sum_m rho(|r_m| / noise) + sum_i (q_i'' / a_i)^2 + (q_i''' / j_i)^2 dt, and priors

with the markers' residuals r_m and the loss rho(u) = c^2 u^2 / (c^2 + u^2) of Geman and McClure
(Bulletin of the International Statistical Institute 52, 1987), in which a marker that is far away
loses its weight, rho'(u) / 2u = 1 / (1 + u^2 / c^2)^2.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.ipopt import Outcome
from geodesic_ocp.recordings.markers.body import SHOULDERS, MarkedBody, on_trunk
from geodesic_ocp.recordings.markers.chosen_markers import ChosenMarkers, FitSettings, KnownHeight

ROOT = 6  # coordinates of a root that moves
# Residuals count by their integral over time, relative to `noise`. Priors weigh as much as
# observations over this time [s]: errors of the markers on the skin last, so that a short recording
# says less about offsets than its number of samples suggests.
PRIOR_TIME = 10.0
# Spread of the joints about zero, or the limit next to it [rad]: one so wide that it hardly
# matters, and that of joints which the markers do not determine.
_POSTURE_SPREAD = 10.0
LOOSE_SPREAD = 1.0
# Translations of the root per rad: expected accelerations and jerks are so much of the joints' [m].
_ROOT_LEVER = 0.2
# Spread of segment lengths about their proportion to body height, relative; no more than an
# assumption of moderate size.
_LENGTH_SPREAD = 0.05
_IPOPT = {"max_iter": 200, "mu_strategy": "monotone", "acceptable_iter": 0}
# How rounding limits the tolerance, relative to the largest curvature of the objective.
_ROUNDING = 1e-14
# Of the barrier, summed over all variables with bounds: at first, and complementarity at the end.
# Together the barriers of all frames pull at lengths and offsets.
_BARRIER = 1e-2
_COMPLEMENTARITY = 1e-2


LOST = 0.25  # weight below which a marker counts as lost: it is farther away than `outlier`


def kept_weights(errors: Array, outlier: float) -> Array:
    """Return the weights of markers (k, m), from 1 to 0, at distances from their fitted places.

    It is the derivative of the loss by half the squared distance. NaN remains NaN.

    Args:
        errors: (k, m) [m], NaN where missing.
        outlier: distance at which a marker keeps a quarter of its weight [m].
    """
    weights: Array = 1.0 / (1.0 + (errors / outlier) ** 2) ** 2
    return weights


@dataclass(frozen=True, eq=False)
class FitProgram:
    """The program for the observations of some frames.

    Attributes:
        program: in the variables of all frames in order, and then the shared ones; its parameter is
            the distance [m] at which a marker keeps a quarter of its weight.
        lower, upper: bounds of the variables.
    """

    program: BlockProgram
    lower: Array
    upper: Array

    def solve(
        self, x: Array, outlier: float, tolerance: float, options: dict[str, Any] | None
    ) -> Outcome:
        """Return the solution from x, where a marker `outlier` [m] away keeps a quarter of its
        weight.
        """
        assert self.program.quadratic is not None
        stiffest = float(abs(self.program.quadratic[0]).max())
        bounded = max(1, int(np.isfinite([self.lower, self.upper]).sum()))
        own = {
            "tol": max(tolerance, _ROUNDING * stiffest),
            "compl_inf_tol": _COMPLEMENTARITY / bounded,
            "mu_init": _BARRIER / bounded,
        }
        solver = self.program.solver({**_IPOPT, **own, **(options or {})})
        start = np.clip(x, self.lower, self.upper)
        return solver(x0=start, p=outlier, lbx=self.lower, ubx=self.upper)


@dataclass(frozen=True, eq=False)
class FitProblem:
    """The unknowns of a fit, and the markers that it uses.

    The variables of a frame are the root's position [m] and angles about z, y and x, if it moves,
    and the joints of the model. Shared are lengths, in units of their spread, and offsets relative
    to the marker set's, in units of the marker's uncertainty.
    """

    body: MarkedBody  # body with its root
    chosen: ChosenMarkers  # the m markers
    known: KnownHeight  # what is known of the height
    settings: FitSettings
    # axes of the space in which the root's angles are taken (3, 3)
    axes: Array = field(default_factory=lambda: np.eye(3))

    @property
    def moves(self) -> bool:
        """True if the root moves."""
        return self.settings.base == "free"

    @property
    def first_joint(self) -> int:
        """Index of the first joint among the variables of a frame."""
        return ROOT if self.moves else 0

    @property
    def nz(self) -> int:
        """Number of variables of a frame."""
        return self.first_joint + self.body.model.dof

    @property
    def ns(self) -> int:
        """Number of shared variables."""
        return int(np.count_nonzero(self._spreads))

    @cached_property
    def _sought(self) -> NDArray[np.bool_]:
        """Which lengths are estimated: those between markers, and an unknown height."""
        segments = self.chosen.segments
        # Both shoulders tell the distance between them, markers of trunk and arm that to the arm.
        both = {"right shoulder", "left shoulder"}
        trunk = {each for each in segments if on_trunk(each)} - both
        shoulders = both <= {*segments} or bool(trunk and {*segments} - trunk - both)
        found = {"height": self.known.spread > 0.0, SHOULDERS: shoulders}
        for side in ("right", "left"):
            found[f"{side} forearm"] = f"{side} hand" in segments
            beyond = (f"{side} {part}" for part in ("elbow", "forearm", "hand"))
            found[f"{side} upper arm"] = any(each in segments for each in beyond)
        return np.array([self.settings.lengths and found[name] for name in self.body.lengths], bool)

    @cached_property
    def _spreads(self) -> Array:
        """Spreads of lengths and of offsets, marker after marker; zero where not sought.

        The others are the shared variables.
        """
        uncertainty = self.chosen.uncertainty * self.settings.offsets
        return np.concatenate([_LENGTH_SPREAD * self._sought, np.repeat(uncertainty, 3)])

    def shared_values(self, shared: ca.SX | ca.DM) -> tuple[Any, Any]:
        """Return lengths relative to the model's (l, 1), and offsets (3, m) [m], by shared
        variables.
        """
        count = self._sought.size
        given = np.concatenate([np.full(count, self.known.factor), self.chosen.places.ravel()])
        matrix = ca.sparsify(ca.DM(np.diag(self._spreads)[:, self._spreads > 0.0]))
        lengths, offsets = ca.vertsplit(given + matrix @ shared, [0, count, given.size])
        return lengths, ca.reshape(offsets, 3, -1)

    @cached_property
    def frame(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Symbols of a frame's and the shared variables, and markers' positions (3, m) [m]."""
        z = ca.SX.sym("z", self.nz)
        shared = ca.SX.sym("s", self.ns)
        lengths, offsets = self.shared_values(shared)
        attachments = [self.body.attachment(segment) for segment in self.chosen.segments]
        points = self.body.points(z[self.first_joint :], lengths, attachments, offsets)
        if self.moves:
            points = z[:3] + self._root_rotation(z[3:ROOT]) @ points
        else:
            points -= self.body.base(lengths)
        return z, shared, points

    def _root_rotation(self, angles: ca.SX) -> ca.SX:
        """Return rotation of the root from its angles about z, y and x, in this order."""
        rotation = ca.SX(self.axes)
        for angle, axis in zip(ca.vertsplit(angles), (2, 1, 0), strict=True):
            turn = ca.SX.eye(3)
            (i, j) = ((axis + 1) % 3, (axis + 2) % 3)
            turn[i, i] = turn[j, j] = ca.cos(angle)
            turn[j, i] = ca.sin(angle)
            turn[i, j] = -turn[j, i]
            rotation @= turn
        return rotation

    def root_rotations(self, angles: Array) -> Array:
        """Return rotations (k, 3, 3) of the root from its angles (k, 3)."""
        turns = scipy.spatial.transform.Rotation.from_euler("ZYX", angles)
        return np.asarray(self.axes @ turns.as_matrix())

    def root_angles(self, rotations: Array) -> Array:
        """Return angles (k, 3) of rotations (k, 3, 3) over time, without jumps."""
        own = scipy.spatial.transform.Rotation.from_matrix(self.axes.T @ rotations)
        return np.unwrap(own.as_euler("ZYX"), axis=0)

    @cached_property
    def slopes(self) -> ca.Function:
        """(z, shared) -> positions (3 m, 1) and their derivatives by z (3 m, nz)."""
        z, shared, points = self.frame
        stacked = ca.densify(ca.vec(points))
        outputs = [stacked, ca.densify(ca.jacobian(stacked, z))]
        return ca.Function("slopes", [z, shared], [ca.cse(each) for each in outputs])

    def positions(self, z: Array, shared: Array) -> Array:
        """Return markers' positions (k, m, 3) [m] from the variables of frames (k, nz) and shared
        ones.
        """
        *symbols, points = self.frame
        at = ca.Function("positions", symbols, [ca.cse(ca.densify(ca.vec(points)))]).map(len(z))
        stacked = at(z.T, np.repeat(shared[:, None], len(z), axis=1)).full()
        return np.asarray(stacked.T.reshape(len(z), -1, 3))

    def errors(self, z: Array, shared: Array, observed: Array) -> Array:
        """Return distances (k, m) [m] of observed positions (k, m, 3) [m] from the fitted ones."""
        return np.asarray(np.linalg.norm(self.positions(z, shared) - observed, axis=2))

    @cached_property
    def _loss(self) -> Terms:
        """The loss of a frame.

        Parameters are the observed positions (3 m), weights (m) and the outlier size.
        """
        z, shared, points = self.frame
        observed = ca.SX.sym("y", points.numel())
        weights = ca.SX.sym("w", points.shape[1])
        outlier = ca.SX.sym("c")
        squares = ca.sum1((points - ca.reshape(observed, *points.shape)) ** 2).T
        loss = ca.dot(weights, squares / (1 + squares / outlier**2)) / 2
        return Terms(ca.vertcat(z, shared), ca.vertcat(observed, weights, outlier), loss)

    @cached_property
    def neutral(self) -> Array:
        """Variables of a frame (nz,) with the joints at zero, or at the limit next to it."""
        return np.clip(np.zeros(self.nz), *self.limits)

    @cached_property
    def limits(self) -> Array:
        """Lower and upper limits of the variables of a frame (2, nz)."""
        limits = np.full((2, self.nz), np.inf)
        limits[0] *= -1.0
        limits[:, self.first_joint :] = self.body.model.lower, self.body.model.upper
        return limits

    def program(self, time: Array, observed: Array, loose: NDArray[np.bool_]) -> FitProgram:
        """Return the program for observed positions (k, m, 3) [m], NaN where missing.

        `loose` (n,) says which joints the markers do not determine.
        """
        settings = self.settings
        count = time.size
        size = time.size * self.nz + self.ns
        # The time that each sample stands for: half of that to its neighbours.
        shares = np.convolve(np.diff(time), [0.5, 0.5])
        scale = float(time[-1] - time[0]) * observed.shape[1]
        missing = np.isnan(observed)
        weights = np.where(missing[:, :, 0], 0.0, shares[:, None] / scale) / settings.noise**2
        numbers = np.hstack([np.where(missing, 0.0, observed).reshape(count, -1), weights])
        own = np.arange(count * self.nz).reshape(count, self.nz)
        places = np.hstack([own, np.tile(np.arange(own.size, size), (count, 1))])
        outlier = ca.MX.sym("c")
        losses = Block(self._loss, places, ca.horzcat(ca.DM(numbers), ca.repmat(outlier, count, 1)))

        of_frames, weak = self.stiffness(time, loose)
        matrix = scipy.sparse.block_diag([of_frames, PRIOR_TIME * self.priors], format="csc")
        towards = np.concatenate([np.kron(shares, weak * self.neutral), np.zeros(self.ns)])
        bounds = np.full((2, size), np.inf)
        bounds[0] *= -1.0
        if settings.limits:
            bounds[:, : own.size] = np.tile(self.limits, count)
        quadratic = matrix / scale, towards / scale
        return FitProgram(BlockProgram(size, [losses], outlier, quadratic), *bounds)

    def stiffness(
        self, time: Array, loose: NDArray[np.bool_]
    ) -> tuple[scipy.sparse.csc_matrix, Array]:
        """Return Hessian of the smoothness and posture of all frames (k nz, k nz), and weights of
        the posture in a frame (nz,).
        """
        settings = self.settings
        shares = np.convolve(np.diff(time), [0.5, 0.5])
        levers = np.ones(self.nz)
        weak = np.zeros(self.nz)
        levers[: 3 if self.moves else 0] = _ROOT_LEVER
        weak[self.first_joint :] = np.where(loose, LOOSE_SPREAD, _POSTURE_SPREAD) ** -2.0
        rough = roughness(time, {2: settings.acceleration, 3: settings.jerk})
        of_frames = scipy.sparse.kron(rough, scipy.sparse.diags(levers**-2.0))
        of_frames += scipy.sparse.diags(np.kron(shares, weak))
        return of_frames, weak

    @cached_property
    def priors(self) -> Array:
        """Hessian of the priors of the shared variables, which are least at zero.

        Lengths are in proportion to the body height, which is near its first value.
        """
        count = int(self._sought.sum())
        rows = np.diag(self._spreads)[:, self._spreads > 0.0]
        rows = (rows[: self._sought.size] - rows[:1]) / _LENGTH_SPREAD
        if self._sought[:1].any():
            rows[0, 0] = _LENGTH_SPREAD / (self.known.factor * self.known.spread)
        rows = np.vstack([rows[self._sought], np.eye(self.ns)[count:]])
        return np.asarray(rows.T @ rows)


def roughness(time: Array, orders: dict[int, float]) -> scipy.sparse.csc_matrix:
    """Return matrix R (k, k) with x' R x = sum over the orders n of the integral of (x^(n) / s_n)^2
    dt.

    Derivatives are divided differences of the samples, so that the integral hardly depends on the
    sampling rate, and samples may be unevenly spaced.

    Args:
        time: increasing (k,) [s].
        orders: the expected size s_n of the derivative of every order n.
    """
    total = scipy.sparse.csc_matrix((time.size, time.size))
    for order, size in orders.items():
        if time.size <= order:
            continue
        difference = scipy.sparse.identity(time.size, format="csc")
        for step in range(1, order + 1):
            weights = scipy.sparse.diags(step / (time[step:] - time[:-step]))
            difference = weights @ (difference[1:] - difference[:-1])
        widths = time[order:] - time[:-order]
        widths *= (time[-1] - time[0]) / widths.sum()
        total = total + difference.T @ scipy.sparse.diags(widths / size**2) @ difference
    return scipy.sparse.csc_matrix(total)
