"""Functions of single nodes and their derivatives, from which the NLP on any grid is built."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.ocp.nlp.conditions import Condition, Conditions, stacked


@dataclass(frozen=True, eq=False)
class NodeFunctions:
    """All functions of single nodes (or of both ends) of a problem.

    Attributes:
        dim: n of the metric.
        num_parameters: number of the problem's parameters.
        num_continuous_via: number of via points at which the velocity is continuous.
        at_ends, at_nodes, at_via, in_segments: the conditions.
        lagrangian: integrand of energy and cost.
    """

    dim: int
    num_parameters: int
    num_continuous_via: int
    at_ends: NodeFunction
    at_nodes: NodeFunction
    at_via: tuple[NodeFunction, ...]
    in_segments: NodeFunction
    lagrangian: NodeFunction

    @classmethod
    def build(cls, metric: Metric, conditions: Conditions) -> NodeFunctions:
        """The functions for least energy in the metric under these conditions."""
        c = conditions
        p, q, state = c.p, c.q, ca.vertcat(c.q, c.v)
        ends = ca.vertcat(c.q0, c.q1, c.v0, c.v1)
        density = metric.energy_density(q, c.v) + c.cost
        return cls(
            dim=metric.dim,
            num_parameters=p.shape[0],
            num_continuous_via=len(c.via_continuity),
            at_ends=NodeFunction("ends", ends, p, c.ends),
            at_nodes=NodeFunction("node", q, p, c.along_q),
            at_via=tuple(NodeFunction("via", q, p, at_one) for at_one in c.via),
            in_segments=NodeFunction("state", state, p, c.along_qv),
            lagrangian=NodeFunction("energy", state, p, (), density),
        )


class NodeFunction:
    """Expressions in one node's (or both ends') symbols, evaluated at many columns at once.

    Args:
        name: of the CasADi functions.
        symbols: (m, 1), with a different value in every column.
        parameters: of the problem (k, 1), the same in all columns.
        conditions: whose expressions are evaluated.
        density: an expression that comes before those.
    """

    def __init__(
        self,
        name: str,
        symbols: ca.SX,
        parameters: ca.SX,
        conditions: Sequence[Condition],
        density: ca.SX | None = None,
    ) -> None:
        outputs = stacked(conditions)
        if density is not None:
            outputs = ca.vertcat(density, outputs)
        self._name, self._symbols, self._parameters = name, symbols, parameters
        self._outputs = ca.densify(outputs)
        self.size = int(outputs.shape[0])

    @cached_property
    def _value(self) -> ca.Function:
        return self._function("", [self._outputs])

    @cached_property
    def _first(self) -> ca.Function:
        gradient = ca.densify(ca.cse(ca.gradient(self._outputs[0], self._symbols)))
        return self._function("_gradient", [self._outputs[0], gradient])

    @cached_property
    def _second(self) -> ca.Function:
        weights = ca.SX.sym("factors", self.size)
        hessian, _ = ca.hessian(ca.dot(weights, self._outputs), self._symbols)
        return self._function("_hessian", [ca.vec(ca.densify(ca.cse(hessian)))], weights)

    def _function(self, suffix: str, outputs: list[ca.SX], *more: ca.SX) -> ca.Function:
        inputs = [self._symbols, *([self._parameters] if self._parameters.shape[0] else []), *more]
        return ca.Function(self._name + suffix, inputs, outputs)

    def value(self, columns: ca.MX, values: ca.MX) -> ca.MX:
        """All outputs, (size, columns)."""
        if not self.size:
            return ca.MX(0, columns.shape[1])
        return self._mapped(self._value, columns, values)[0]

    def first(self, columns: ca.MX, values: ca.MX) -> tuple[ca.MX, ca.MX]:
        """The first output (1, columns) and its gradient (symbols, columns)."""
        value, slope = self._mapped(self._first, columns, values)
        return value, slope

    def second(self, columns: ca.MX, values: ca.MX, factors: ca.MX) -> ca.MX:
        """Hessian of factors' * outputs, (symbols^2, columns)."""
        return self._mapped(self._second, columns, values, factors)[0]

    def _mapped(
        self, function: ca.Function, columns: ca.MX, values: ca.MX, *more: ca.MX
    ) -> list[ca.MX]:
        count = columns.shape[1]
        repeated = [ca.repmat(values, 1, count)] if self._parameters.shape[0] else []
        return list(function.map(count).call([columns, *repeated, *more]))
