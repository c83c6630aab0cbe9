"""The functions that are derived from a metric tensor, built once: symbolic and compiled."""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_expression
from geodesic_ocp.manifold.kernels import Kernels


class MetricFunctions(ABC):
    """CasADi functions of a metric tensor G(q) on R^n, and compiled code."""

    dim: int

    @abstractmethod
    def matrix(self, q: Any) -> Any:
        """Return metric tensor G(q), (n, n), symmetric and positive definite."""

    @cached_property
    def _matrix_function(self) -> ca.Function:
        q = ca.SX.sym("q", self.dim)
        matrix = as_expression(f"{type(self).__name__}.matrix(q)", self.matrix(q))
        if matrix.shape != (self.dim, self.dim):
            raise ValueError(
                f"{type(self).__name__}.matrix(q) must have shape ({self.dim}, {self.dim}), "
                f"got {matrix.shape}"
            )
        if free := [str(each) for each in ca.symvar(matrix) if not ca.depends_on(each, q)]:
            raise ValueError(
                f"{type(self).__name__}.matrix(q) contains {', '.join(free)}, which q does not "
                "determine: only q may be a symbol"
            )
        return ca.Function("G", [q], [ca.densify(matrix)], ["q"], ["G"])

    @cached_property
    def has_constant_tensor(self) -> bool:
        """True if the expression of G(q) does not contain q.

        Then geodesics are straight lines at constant speed, and parallel transport leaves the
        components of a vector as they are: `exp`, `log` and the others use these closed forms.
        """
        q = ca.SX.sym("q", self.dim)
        return not ca.depends_on(self._matrix_function(q), q)

    @cached_property
    def _matrix_derivative(self) -> ca.Function:
        """Derivatives of vec(G) with respect to each coordinate: q -> (n^2, n)."""
        q = ca.SX.sym("q", self.dim)
        derivative = ca.jacobian(ca.vec(self._matrix_function(q)), q)
        return ca.Function("dG", [q], [ca.densify(ca.cse(derivative))])

    def _energy(self, q: ca.SX, v: ca.SX) -> ca.SX:
        """Return half of the squared norm, v' G(q) v / 2, for symbols q and v."""
        # Not through a function of q, as the parameters of a metric may be symbols as well.
        tensor = as_expression(f"{type(self).__name__}.matrix(q)", self.matrix(q))
        return ca.dot(v, tensor @ v) / 2

    @cached_property
    def energy_density(self) -> ca.Function:
        """(q, v) -> v' G(q) v / 2, the integrand of the energy of a path."""
        q = ca.SX.sym("q", self.dim)
        v = ca.SX.sym("v", self.dim)
        return ca.Function("energy_density", [q, v], [self._energy(q, v)], ["q", "v"], ["T"])

    def _christoffel_force(self, q: ca.SX, u: ca.SX, v: ca.SX) -> ca.SX:
        """Return sum_jk Gamma_ijk u_j v_k, (n, 1), for symbols q, u and v."""
        tensor = self._matrix_function(q)
        momentum_u = tensor @ u
        momentum_v = tensor @ v
        return 0.5 * (
            ca.jtimes(momentum_u, q, v)
            + ca.jtimes(momentum_v, q, u)
            - ca.gradient(ca.dot(u, momentum_v), q)
        )

    def _transport_rate(self, q: ca.SX, u: ca.SX, v: ca.SX) -> ca.SX:
        """Return derivative of v transported along u: -G^-1 sum_jk Gamma_ijk u_j v_k, (n, 1)."""
        # L D L' without pivoting: G is positive definite, and the graph stays small.
        factors, upper, permutation = ca.ldl(self._matrix_function(q), False)
        force = self._christoffel_force(q, u, v)
        # Detects an invalid G where its derivatives are zero.
        valid = ca.if_else(ca.trace(self._matrix_function(q)) > 0, 0.0, np.nan)
        return ca.densify(ca.cse(valid - ca.ldl_solve(force, factors, upper, permutation)))

    @cached_property
    def geodesic_equation(self) -> ca.Function:
        """First-order form of the geodesic equation: y = (q, v), (2n,) -> y' = (v, v')."""
        q = ca.SX.sym("q", self.dim)
        v = ca.SX.sym("v", self.dim)
        rate = ca.vertcat(v, self._transport_rate(q, v, v))
        return ca.Function("geodesic", [ca.vertcat(q, v)], [rate], ["y"], ["dy"])

    @cached_property
    def transport_equation(self) -> ca.Function:
        """Parallel transport: w (n,), p = (q, q') (2n,) of the curve -> w' (n,)."""
        w, q, v = (ca.SX.sym(name, self.dim) for name in ("w", "q", "v"))
        rate = self._transport_rate(q, v, w)
        return ca.Function("transport", [w, ca.vertcat(q, v)], [rate], ["w", "p"], ["dw"])

    @cached_property
    def transport_matrix(self) -> ca.Function:
        """(q, v) (2n,) -> A (n, n) of parallel transport along a curve, w' = A w."""
        q, v, w = (ca.SX.sym(name, self.dim) for name in ("q", "v", "w"))
        matrix = ca.jacobian(self._transport_rate(q, v, w), w)
        return ca.Function(
            "transport_matrix", [ca.vertcat(q, v)], [ca.densify(ca.cse(matrix))], ["p"], ["A"]
        )

    def transport_matrices(self, curve: Array) -> Array:
        """Return the matrices A (k, n, n) of `transport_matrix` along positions and velocities (k,
        2n).
        """
        n = self.dim
        if self.has_constant_tensor:
            return np.zeros((len(curve), n, n))
        if self.kernels.available(at_once=False):
            return self.kernels.transport_matrices(curve)
        began = time.perf_counter()
        found = self.transport_matrix.map(len(curve))(curve.T).full()
        self.kernels.used(time.perf_counter() - began)
        return np.asarray(found.reshape(n, len(curve), n).swapaxes(0, 1))

    @cached_property
    def curvature_form(self) -> ca.Function:
        """Riemann curvature tensor <R(u, v) w, z>: q, u, v, w, z, each (n,), -> number.

        With constant vector fields and Christoffel symbols C of the first kind, it is
        (d_w d_u <z, v> + d_z d_v <w, u> - d_z d_u <w, v> - d_w d_v <z, u>) / 2
        + C(w, u)' G^-1 C(z, v) - C(w, v)' G^-1 C(z, u).
        """
        q, u, v, w, z = (ca.SX.sym(name, self.dim) for name in ("q", "u", "v", "w", "z"))

        def second(a: ca.SX, b: ca.SX, c: ca.SX, d: ca.SX) -> ca.SX:
            """Return second derivative of <c, d> along a and b."""
            return ca.jtimes(ca.jtimes(ca.dot(c, self._matrix_function(q) @ d), q, a), q, b)

        def product(a: ca.SX, b: ca.SX, c: ca.SX, d: ca.SX) -> ca.SX:
            """Return c(a, b)' G^-1 C(c, d)."""
            return -ca.dot(self._christoffel_force(q, a, b), self._transport_rate(q, c, d))

        linear = second(w, u, z, v) + second(z, v, w, u) - second(z, u, w, v) - second(w, v, z, u)
        form = linear / 2 + product(w, u, z, v) - product(w, v, z, u)
        return ca.Function("R", [q, u, v, w, z], [ca.cse(form)])

    @cached_property
    def kernel_functions(self) -> dict[str, ca.Function]:
        """The functions that the compiled core calls, by name.

        Of positions q, velocities v and momenta p, (n,) each:

        - metric_tensor: q -> G
        - metric_solve: (q, p) -> G^-1 p
        - geodesic_rate: (q, v) -> (v, v'), the geodesic equation
        - transport_rate: (w, (q, v)) -> w', parallel transport
        - transport_matrix: (q, v) -> A, with w' = A w
        - energy_gradient: (q, v) -> l = v' G v / 2, and (l_q, l_v)
        - energy_hessian: (q, v) -> l, and (l_q, l_v, vec l_qq, vec l_qv, vec G)
        """
        n = self.dim
        q, v, w, p = (ca.SX.sym(name, n) for name in "qvwp")
        state = ca.vertcat(q, v)
        tensor = self._matrix_function(q)
        energy = self.energy_density(q, v)
        gradient = ca.gradient(energy, state)
        by_position = ca.triu2symm(ca.triu(ca.jacobian(gradient[:n], q)))
        mixed = ca.jacobian(gradient[n:], q).T  # l_vv is G itself
        blocks = (ca.vec(ca.densify(each)) for each in (by_position, mixed, tensor))
        outputs: dict[str, tuple[list[ca.SX], list[ca.SX]]] = {
            "metric_tensor": ([q], [tensor]),
            "metric_solve": ([q, p], [ca.ldl_solve(p, *ca.ldl(tensor, False))]),
            "geodesic_rate": ([state], [self.geodesic_equation(state)]),
            "transport_rate": ([w, state], [self.transport_equation(w, state)]),
            "energy_gradient": ([state], [energy, gradient]),
            "energy_hessian": ([state], [energy, ca.vertcat(gradient, *blocks)]),
        }
        functions = {
            name: ca.Function(name, inputs, [ca.densify(ca.cse(result)) for result in results])
            for name, (inputs, results) in outputs.items()
        }
        return functions | {"transport_matrix": self.transport_matrix}

    @cached_property
    def kernels(self) -> Kernels:
        """These functions compiled, where there is a compiler."""
        return Kernels(lambda: self.kernel_functions, self.fingerprint, self.dim)

    @property
    def fingerprint(self) -> str:
        """Text that changes with the metric tensor."""
        return f"{type(self).__qualname__} {self._matrix_function.serialize()}"

    def __getstate__(self) -> dict[str, Any]:
        state = self.__dict__.items()
        return {name: value for name, value in state if not name.endswith("kernels")}
