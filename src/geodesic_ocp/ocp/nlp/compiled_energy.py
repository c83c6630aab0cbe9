"""The energy's derivatives at single points, from a metric's compiled library."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.nlp.conditions import Conditions
from geodesic_ocp.ocp.nlp.node_functions import NodeFunction, NodeFunctions


class CompiledEnergy(NodeFunction):
    """v' G(q) v / 2 at many points, with compiled derivatives.

    Its value is interpreted, so that CasADi can differentiate it.

    Args:
        metric: G.
        conditions: whose symbols are used.
        file: the library.
    """

    def __init__(self, metric: Metric, conditions: Conditions, file: str) -> None:
        c, n = conditions, metric.dim
        super().__init__("energy", ca.vertcat(c.q, c.v), c.p, (), metric.energy_density(c.q, c.v))
        self._gradient = ca.external("energy_gradient", file)
        self._hessian = ca.external("energy_hessian", file)
        # The library gives l_q, l_v, and by columns l_qq, l_qv and G.
        by_columns = 2 * n + np.arange(3 * n**2).reshape(n, 3 * n, order="F")
        qq, qv, vv = np.split(by_columns, 3, axis=1)
        self._entries = np.block([[qq, qv], [qv.T, vv]]).ravel(order="F").tolist()

    def first(self, columns: ca.MX, values: ca.MX) -> tuple[ca.MX, ca.MX]:
        """The energy (1, columns) and its gradient (2 n, columns)."""
        del values
        energy, gradient = self._gradient.map(columns.shape[1])(columns)
        return energy, gradient

    def second(self, columns: ca.MX, values: ca.MX, factors: ca.MX) -> ca.MX:
        """Hessians times factors (1, columns), (4 n^2, columns)."""
        del values
        _, derivatives = self._hessian.map(columns.shape[1])(columns)
        return derivatives[self._entries, :] * ca.repmat(factors, len(self._entries), 1)


def build_functions(metric: Metric, conditions: Conditions) -> NodeFunctions:
    """The functions for least energy, compiled where that is possible and there is no cost."""
    functions = NodeFunctions.build(metric, conditions)
    file = metric.kernels.file if conditions.cost.is_zero() else ""
    if not file:
        return functions
    try:
        return replace(functions, lagrangian=CompiledEnergy(metric, conditions, file))
    except RuntimeError:  # the file has been removed
        return functions
