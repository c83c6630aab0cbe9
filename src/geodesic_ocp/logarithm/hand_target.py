"""A pose of the hand as the end of a motion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np
import scipy.linalg

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.logarithm.pose_shooting import pose_error_function
from geodesic_ocp.model.model import Model


@dataclass(frozen=True, eq=False, repr=False)
class HandTarget(ShortRepr):
    """A position of the hand, a rotation, or both.

    Attributes:
        model: model whose hand it is.
        position: (3,) [m] in the base frame; None: it is free.
        rotation: (3, 3); None: it is free.
    """

    model: Model
    position: Array | None
    rotation: Array | None

    _shown = ("position", "rotation")

    @property
    def size(self) -> int:
        """Number m of conditions."""
        return 3 * ((self.position is not None) + (self.rotation is not None))

    @cached_property
    def _functions(self) -> tuple[ca.Function, ca.Function]:
        """(q -> pose error (m,) and its Jacobian), (q, factors -> Hessian of their product)."""
        q = ca.SX.sym("q", self.model.dof)
        rotation, position = self.model.hand_pose(q)
        target = np.zeros(3) if self.position is None else self.position
        wanted = np.eye(3) if self.rotation is None else self.rotation
        given = [self.position is not None] * 3 + [self.rotation is not None] * 3
        every = pose_error_function()(rotation, position, target, wanted, [1.0, 1.0])
        error = every[np.flatnonzero(given).tolist()]
        factors = ca.SX.sym("factors", error.shape[0])
        hessian, _ = ca.hessian(ca.dot(factors, error), q)
        first = ca.Function("pose", [q], [ca.densify(error), ca.densify(ca.jacobian(error, q))])
        return first, ca.Function("pose_hessian", [q, factors], [ca.densify(hessian)])

    def error(self, q: Array) -> Array:
        """Return the differences (m,) of the target from the hand's pose at q [m, rad]."""
        return np.asarray(self._functions[0](q)[0].full()[:, 0])

    def jacobian(self, q: Array) -> Array:
        """Return the derivatives (m, n) of the error."""
        return np.asarray(self._functions[0](q)[1].full())

    def tangents(self, q: Array) -> Array:
        """Return an orthonormal basis (n, n - m) of the directions in which the pose is kept."""
        return np.asarray(scipy.linalg.null_space(self.jacobian(q)))

    def reaction(self, q: Array, force: Array) -> tuple[Array, Array, Array]:
        """Return what balances a force (n,) at the end as well as the pose can, J' f, its
        derivative f' J' (n, n), and the tangents.
        """
        jacobian = self.jacobian(q)
        factors = -np.linalg.lstsq(jacobian.T, force, rcond=None)[0]
        curvature = self._functions[1](q, factors).full()
        return jacobian.T @ factors, curvature, self.tangents(q)
