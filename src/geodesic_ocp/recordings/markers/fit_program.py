"""The nonlinear program of a motion that fits markers.

Variables: root and joints of every frame, and what is common to all frames: lengths and offsets of
markers. Objective, divided by the duration:

    integral of sum_m rho(|r_m| / noise) + sum_i (q_i'' / a_i)^2 + (q_i''' / j_i)^2 dt, and priors

with the markers' residuals r_m and the loss rho(u) = c^2 u^2 / (c^2 + u^2) of Geman and McClure
(Bulletin of the International Statistical Institute 52, 1987), in which a marker that is far away
loses its weight, rho'(u) / 2u = 1 / (1 + u^2 / c^2)^2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import casadi as ca
import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.ipopt import Outcome
from geodesic_ocp.recordings.markers.body import MarkedBody

Base = Literal["fixed", "free"]

# Residuals count by their integral over time, relative to `noise`. Priors weigh as much as
# observations over this time [s]: errors of the markers on the skin last, so that a short recording
# says less about offsets than its number of samples suggests.
PRIOR_TIME = 10.0
# Translations of the root per rad: expected accelerations and jerks are so much of the joints' [m].
ROOT_LEVER = 0.2
# Spread of the joints about zero, or the limit next to it [rad]: one so wide that it hardly
# matters, and that of joints which the markers do not determine.
POSTURE_SPREAD, LOOSE_SPREAD = 10.0, 1.0
# Spread of segment lengths about their proportion to body height, relative; no more than an
# assumption of moderate size.
LENGTH_SPREAD = 0.05
# Spread of a body height about that of the model, if nothing else is known of it, relative.
HEIGHT_SPREAD = 0.3


@dataclass(frozen=True)
class FitSettings:
    """See `fit_motion`, whose arguments these are."""

    base: Base = "free"
    lengths: bool = True
    offsets: bool = True
    limits: bool = True
    noise: float = 0.002
    acceleration: float = 100.0
    jerk: float = 1000.0
    outlier: float = 0.03


def sample_shares(time: Array) -> Array:
    """The time (k,) [s] that each sample stands for: half of that to its neighbours."""
    steps = np.diff(time)
    shares: Array = np.convolve(steps, [0.5, 0.5])
    return shares


def roughness(time: Array, orders: dict[int, float]) -> scipy.sparse.csc_matrix:
    """Matrix R (k, k) with x' R x = sum over the orders n of the integral of (x^(n) / s_n)^2 dt.

    Derivatives are divided differences of the samples, so that the integral hardly depends on the
    sampling rate, and samples may be unevenly spaced.

    Args:
        time: increasing (k,) [s].
        orders: the expected size s_n of the derivative of every order n.
    """
    count = time.size
    total = scipy.sparse.csc_matrix((count, count))
    for order, size in orders.items():
        if count <= order:
            continue
        difference = scipy.sparse.identity(count, format="csc")
        for step in range(1, order + 1):
            weights = scipy.sparse.diags(step / (time[step:] - time[:-step]))
            difference = weights @ (difference[1:] - difference[:-1])
        widths = time[order:] - time[:-order]
        widths *= (time[-1] - time[0]) / widths.sum()
        total = total + difference.T @ scipy.sparse.diags(widths / size**2) @ difference
    return scipy.sparse.csc_matrix(total)


_IPOPT = {"max_iter": 200, "mu_strategy": "monotone", "acceptable_iter": 0}
# How rounding limits the tolerance, relative to the largest curvature of the objective.
_ROUNDING = 1e-14
# Of the barrier, summed over all variables with bounds: at first, and complementarity at the end.
# Together the barriers of all frames pull at lengths and offsets.
_BARRIER, _COMPLEMENTARITY = 1e-2, 1e-2


@dataclass(frozen=True, eq=False)
class FrameTerms:
    """Predicted positions of markers in one frame.

    Attributes:
        z: root and joints of the frame, symbols (nz, 1).
        shared: what is common to all frames, symbols (ns, 1).
        points: positions of the markers (3, m) [m].
    """

    z: ca.SX
    shared: ca.SX
    points: ca.SX

    @cached_property
    def positions(self) -> ca.Function:
        """(z, shared) -> positions (3, m)."""
        return ca.Function("positions", [self.z, self.shared], [ca.cse(ca.densify(self.points))])

    @cached_property
    def slopes(self) -> ca.Function:
        """(z, shared) -> positions (3 m, 1) and their derivatives by z (3 m, nz)."""
        stacked = ca.vec(self.points)
        outputs = [stacked, ca.densify(ca.jacobian(stacked, self.z))]
        return ca.Function("slopes", [self.z, self.shared], [ca.cse(each) for each in outputs])

    @cached_property
    def loss(self) -> Terms:
        """The loss of a frame.

        Parameters are the observed positions (3 m), weights (m) and the outlier size.
        """
        count = self.points.shape[1]
        observed, weights = ca.SX.sym("y", 3 * count), ca.SX.sym("w", count)
        outlier = ca.SX.sym("c")
        residuals = self.points - ca.reshape(observed, 3, count)
        squares = ca.sum1(residuals**2).T
        loss = ca.dot(weights, squares / (1 + squares / outlier**2)) / 2
        numbers = ca.vertcat(observed, weights, outlier)
        return Terms(ca.vertcat(self.z, self.shared), numbers, loss)


@dataclass(frozen=True, eq=False)
class FitProgram:
    """The program for the observations of K frames.

    Attributes:
        terms: of one frame.
        observed: positions (K, m, 3) [m], any number where the weight is zero.
        weights: of the squared residuals in the objective (K, m) [1/m^2].
        quadratic: of the rest of the objective, x' Q x / 2 - b' x: Q and b, over the variables
            of all frames in order, and then the shared ones.
        lower, upper: bounds of the variables.
    """

    terms: FrameTerms
    observed: Array
    weights: Array
    quadratic: tuple[scipy.sparse.csc_matrix, Array]
    lower: Array
    upper: Array

    def solve(
        self, x: Array, outlier: float, tolerance: float, options: dict[str, Any] | None = None
    ) -> Outcome:
        """The solution from x, where a marker `outlier` [m] away keeps a quarter of its weight."""
        stiffest = float(abs(self.quadratic[0]).max())
        bounded = max(1, int(np.isfinite(self.lower).sum() + np.isfinite(self.upper).sum()))
        own = {
            "tol": max(tolerance, _ROUNDING * stiffest),
            "compl_inf_tol": _COMPLEMENTARITY / bounded,
            "mu_init": _BARRIER / bounded,
        }
        solver = self.program.solver({**_IPOPT, **own, **(options or {})})
        start = np.clip(x, self.lower, self.upper)
        return solver(x0=start, p=outlier, lbx=self.lower, ubx=self.upper)

    @cached_property
    def program(self) -> BlockProgram:
        """The frames' losses and the rest; the outlier size is its parameter."""
        frames, nz, outlier = len(self.observed), int(self.terms.z.numel()), ca.MX.sym("c")
        shared = np.arange(frames * nz, self.lower.size)
        own = np.arange(frames * nz).reshape(frames, nz)
        places = np.hstack([own, np.tile(shared, (frames, 1))])
        numbers = np.hstack([self.observed.reshape(frames, -1), self.weights])
        values = ca.horzcat(ca.DM(numbers), ca.repmat(outlier, frames, 1))
        block = Block(self.terms.loss, places, values)
        return BlockProgram(self.lower.size, [block], outlier, self.quadratic)


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
