"""The second-order functions of a metric: motions of least covariant acceleration, and in tension.

The action of a motion q(t) is int (|D_t q'|^2_G + s |q'|^2_G) / 2 dt, where s is the square of the
tension [1/s]. Its first part is int tau' G^-1 tau / 2 dt, where tau = G q'' + Gamma(q', q') is the
generalised force without gravity. Its stationary motions satisfy

    D_t^3 q' + R(D_t q', q') q' - s D_t q' = 0.

Without tension they are Riemannian cubics (Noakes, Heinzinger, Paden 1989; Crouch, Silva Leite
1995), with tension elastic curves (Silva Leite, Camarinha, Crouch 2000). The equation is here in
the form of Hamilton's equations of (q, v, p, r), where r = tau is the momentum of
the velocity and p that of the configuration (Pontryagin's principle).
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from ctypes import byref, c_double, c_int, c_long
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import Legendre, leggauss
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.blocks import Terms
from geodesic_ocp.manifold.kernels import Kernels, blas, one_blas_thread

if TYPE_CHECKING:
    from geodesic_ocp.manifold.metric import Metric

# Functions of a segment that meet (1, 0, 0, 0), ... in value and slope at its two ends.
_HERMITE = ([1, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1])
_BUBBLE = Polynomial([0, 0, 1, -2, 1])  # vanishes at both ends with its slope


def motion_functions(metric: Metric) -> dict[str, ca.Function]:
    """Return the functions of points (q, v, a), (3 n,), or states (q, v, p, r), (4 n,), and of s.

    - motion_cost: L = (tau' G^-1 tau + s v' G v) / 2
    - motion_hessian: L; its gradient (3 n), blocks of a positive semidefinite part of its second
      derivatives, J' G^-1 J (Gauss-Newton) and s G by v, and of the rest, see core/motion.h
    - motion_rate: (q, v, p, r)', Hamilton's equations

    With w = G^-1 tau held constant, tau' G^-1 tau / 2 has the derivatives of w' tau - w' G w / 2
    (envelope theorem).
    """
    n = metric.dim
    sym = ca.SX.sym
    q, v, a, w, u, p, r = (sym(name, n) for name in "qvawupr")
    s = sym("s")
    tensor = metric._matrix_function(q)
    force = metric._christoffel_force(q, v, v)
    factors = ca.ldl(tensor, False)

    def torque(acceleration: ca.SX) -> ca.SX:
        return tensor @ acceleration + force

    def solved(columns: ca.SX) -> ca.SX:
        return ca.horzcat(*(ca.ldl_solve(each, *factors) for each in ca.horzsplit(columns)))

    def block(matrix: ca.SX, i: int, j: int) -> ca.SX:
        return ca.vec(ca.densify(matrix[i * n : (i + 1) * n, j * n : (j + 1) * n]))

    point = ca.vertcat(q, v, a)
    tau = torque(a)
    covariant = solved(tau)
    kinetic = s * ca.dot(v, tensor @ v) / 2
    cost = ca.dot(tau, covariant) / 2 + kinetic
    gradient = ca.gradient(ca.dot(w, torque(a - w / 2)) + kinetic, point)
    slope = ca.jacobian(torque(a - w), point)  # of tau - G w
    gauss = ca.horzcat(slope.T @ solved(slope[:, : 2 * n]), slope.T)
    gauss[n : 2 * n, n : 2 * n] += s * tensor
    rest = ca.jacobian(gradient, point)
    rest[n : 2 * n, n : 2 * n] = ca.jacobian(ca.gradient(ca.dot(w, force), v), v)
    first = ((0, 0), (0, 1), (0, 2), (1, 1))
    mixed = ((1, 2), (2, 2))
    blocks = [block(gauss, *each) for each in first + mixed]
    blocks += [block(rest, *each) for each in first]
    derivatives = ca.substitute(ca.vertcat(gradient, *blocks), w, covariant)
    momentum = ca.gradient(ca.dot(w, torque(w / 2 - u)) + kinetic, q)
    forces = ca.vertcat(momentum, ca.gradient(ca.dot(w, force) + kinetic, v) - p)
    acceleration = solved(r)
    drift = solved(force)
    forces = ca.substitute(ca.substitute(forces, w, acceleration), u, drift)
    rate = ca.vertcat(v, acceleration - drift, forces)
    outputs = {
        "motion_cost": (point, [cost]),
        "motion_hessian": (point, [cost, derivatives]),
        "motion_rate": (ca.vertcat(q, v, p, r), [rate]),
    }
    return {
        name: ca.Function(name, [given, s], [ca.densify(ca.cse(each)) for each in results])
        for name, (given, results) in outputs.items()
    }


@dataclass(frozen=True, eq=False)
class SegmentBasis:
    """Polynomials of a segment: cubic Hermite functions of its ends, and `bubbles` others."""

    bubbles: int  # number of polynomials that vanish with their slopes at both ends
    points: int  # number of Gauss points

    @cached_property
    def polynomials(self) -> list[Polynomial]:
        """The 4 + bubbles functions of the fraction s of the duration."""
        legendre = (Legendre.basis(k, [0, 1]).convert(kind=Polynomial) for k in range(self.bubbles))
        return [*map(Polynomial, _HERMITE), *(_BUBBLE * each for each in legendre)]

    def values(self, s: Array, order: int = 0) -> Array:
        """Return derivatives of this order of the functions at s (k,), (4 + bubbles, k)."""
        return np.array([each.deriv(order)(s) if order else each(s) for each in self.polynomials])

    @cached_property
    def rule(self) -> tuple[Array, Array]:
        """Gauss points of [0, 1] and their weights, (points,) each."""
        nodes, weights = leggauss(self.points)
        return (nodes + 1.0) / 2.0, weights / 2.0

    @cached_property
    def halves(self) -> list[Array]:
        """Matrices from the coefficients on a segment to those on its first and second half."""
        s = np.linspace(0.0, 1.0, 2 * self.bubbles + 8)
        here = self.values(s).T
        there = (self.values((s + k) / 2.0).T for k in range(2))
        return [np.asarray(np.linalg.lstsq(here, each)[0], dtype=float) for each in there]

    @cached_property
    def tables(self) -> dict[str, Array]:
        """The constants of a level in core/motion.h."""
        s, weights = self.rule
        values = np.array([self.values(s, order) for order in range(3)])
        b, a = np.tril_indices(4 + self.bubbles)
        pairs = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2), (1, 0), (2, 0), (2, 1)]
        products = np.array([weights * values[i][a] * values[j][b] for i, j in pairs])
        basis = values.transpose(0, 2, 1)
        named = {"weights": weights, "basis": basis, "products": products}
        return {name: np.ascontiguousarray(table) for name, table in named.items()}


class MotionLevel(ctypes.Structure):
    """The struct `motion_level` of core/motion.h."""

    _fields_ = [
        *((name, c_int) for name in ("bubbles", "points")),
        *((name, ctypes.c_void_p) for name in ("weights", "basis", "products")),
        ("decrease", c_double),
        ("max_steps", c_long),
    ]


@lru_cache
def motion_levels(*levels: tuple[SegmentBasis, float]) -> ctypes.Array[MotionLevel]:
    """Return levels for the compiled core: bases, and relative decreases that end them."""
    result = (MotionLevel * len(levels))()
    for level, (basis, decrease) in zip(result, levels, strict=True):
        level.bubbles = basis.bubbles
        level.points = basis.points
        for name, table in basis.tables.items():
            setattr(level, name, table.ctypes.data)
        level.decrease = decrease
        level.max_steps = 60
    return result


@dataclass(frozen=True, eq=False)
class DiscreteMotion:
    """A motion of least discrete action."""

    knots: Array  # positions and velocities (k + 1, 2 n)
    coefficients: Array  # of the segments' other functions (k, bubbles, n)
    action: float  # int (|D_t q'|^2 + s |q'|^2) / 2 dt
    gradients: Array  # of the action of each segment by its knots (k, 4 n)
    hessians: Array  # the second derivatives (k, 4 n, 4 n), the coefficients eliminated


class MotionKernels(Kernels):
    """The compiled second-order functions of a metric."""

    def __init__(self, metric: Metric) -> None:
        self._metric = metric

        def functions() -> Mapping[str, ca.Function]:
            return self.functions

        super().__init__(functions, f"motion {metric.fingerprint}", metric.dim, "find_motion")

    @cached_property
    def functions(self) -> dict[str, ca.Function]:
        """The functions of `motion_functions`."""
        return motion_functions(self._metric)

    @cached_property
    def terms(self) -> Terms:
        """The running cost as terms of a program, in (q, q', q'') and s."""
        point = ca.SX.sym("z", 3 * self._dim)
        square = ca.SX.sym("s")
        return Terms(point, square, self.functions["motion_cost"](point, square))

    @property
    def rate(self) -> ca.Function:
        """Hamilton's equations, (q, v, p, r) and s -> (q, v, p, r)'."""
        return self.functions["motion_rate"]

    def find(
        self,
        levels: ctypes.Array[MotionLevel],
        durations: Array,
        knots: Array,
        coefficients: Array,
        is_free: NDArray[np.bool_],
        tension: float,
    ) -> DiscreteMotion | None:
        """Minimize the discrete action on all levels; None where that fails.

        Args:
            levels: from coarse to fine.
            durations: durations of the segments (k,) [s].
            knots: positions and velocities (k + 1, 2 n), the first guess where they are free.
            coefficients: first guess (k, bubbles of the first level, n).
            is_free: True for the components of knots that may change, (k + 1, 2 n).
            tension: square root of s [1/s].
        """
        n = self._dim
        count = len(durations)
        handle = self.handle(True)
        assert handle is not None
        handle.motion_memory.restype = c_long
        number = c_int(len(levels))
        parts = c_int(count)
        memory = self._memory(handle.motion_memory(levels, number, parts))
        x = np.zeros((count * (2 + max(level.bubbles for level in levels)) + 2) * n)
        rows = np.hstack([knots[:-1], coefficients.reshape(count, -1)])
        x[: rows.size + 2 * n] = np.append(rows, knots[-1])
        flags = np.empty(x.size, dtype=np.int8)
        free = np.ascontiguousarray(is_free, dtype=np.int8)
        action = c_double()
        steps = c_long()
        gradients = np.empty((count, 4 * n))
        hessians = np.empty((count, 4 * n, 4 * n))
        pointers = (ctypes.c_void_p(each.ctypes.data) for each in (free, memory, flags))
        rounding = self._rounding(durations, knots)
        given = byref(blas()), levels, number, parts, durations, tension, rounding
        results = byref(action), gradients, hessians, byref(steps)
        with one_blas_thread:
            status = self._call("find_motion", *given, *pointers, x, *results)
        if status:
            return None
        width = (2 + levels[len(levels) - 1].bubbles) * n
        rows = x[: count * width].reshape(count, width)
        last = x[count * width : count * width + 2 * n]
        return DiscreteMotion(
            np.vstack([rows[:, : 2 * n], last]),
            rows[:, 2 * n :].reshape(count, -1, n),
            action.value,
            gradients,
            hessians,
        )

    def _rounding(self, durations: Array, knots: Array) -> float:
        """Return changes of the action that do not count, also where the least action vanishes.

        A displacement d within a time h has an action of the order of G d^2 / h^3. Displacements
        count down to a tenth of the tolerance to which knots meet, 1e-9 of the motion's own, and to
        a hundred times the rounding of coordinates, of which positions on a segment are sums.
        """
        n = self._dim
        mean = float(durations.mean())
        moved = np.ptp(knots[:, :n], axis=0) + mean * np.abs(knots[:, n:]).max(axis=0)
        rounding = np.finfo(float).eps * np.abs(knots[:, :n]).max()
        least = 1e-10 * moved.max() + 100.0 * rounding
        return float(np.trace(self._metric.matrix(knots[0, :n])) * least**2 / mean**3)

    def states(
        self, start: Array, times: Array, tension: float, tolerance: float, max_steps: int
    ) -> Array:
        """Return states (k, 4 n) at times (k,) of Hamilton's equations, like
        `integrate_by_scipy`.
        """
        given = start, tension
        return self._integrate("integrate_motion", given, times, tolerance, max_steps)


def second_order(metric: Metric) -> MotionKernels:
    """Return the compiled second-order functions of a metric, made once."""
    if "motion_kernels" not in metric.__dict__:
        metric.__dict__["motion_kernels"] = MotionKernels(metric)
    kernels: MotionKernels = metric.__dict__["motion_kernels"]
    return kernels
