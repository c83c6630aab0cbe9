"""A sparse nonlinear program as a sum of small functions of a few variables each.

f(x) = sum_k f_b(x[i_bk], p_bk) and g(x) = (g_b(x[i_bk], p_bk))_bk over kinds b of blocks and their
instances k. First and second derivatives are exact: those of one block are generated once as a
function, mapped over the instances, and added up in the places of their variables.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.ipopt import Ipopt, Outcome

Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Block:
    """One kind of terms.

    Attributes:
        variables: symbols (z, 1) of an instance.
        parameters: symbols (p, 1) of an instance.
        objective: its part of the objective, a scalar.
        constraints: its constraint functions (m, 1).
        indices: of the variables of every instance in x, (instances, z), all different in a row.
        values: of the parameters, (instances, p).
        lower, upper: bounds of the constraint functions, (instances, m).
    """

    variables: ca.SX
    parameters: ca.SX
    objective: ca.SX
    constraints: ca.SX
    indices: Indices
    values: Array
    lower: Array
    upper: Array

    @property
    def count(self) -> int:
        """Number of instances."""
        return len(self.indices)

    @property
    def size_g(self) -> int:
        """Number of constraint functions of all instances."""
        return int(self.constraints.numel()) * self.count

    @property
    def size_p(self) -> int:
        """Number of parameters of all instances."""
        return int(self.parameters.numel()) * self.count


@dataclass(frozen=True, eq=False)
class _Derivatives:
    """Functions of one block's instances, and where their values belong in x."""

    block: Block
    values: ca.Function
    gradient: ca.Function
    jacobian: ca.Function
    hessian: ca.Function
    jacobian_places: ca.Sparsity
    hessian_places: ca.Sparsity

    @classmethod
    def of(cls, block: Block) -> _Derivatives:
        z, p, f, g = block.variables, block.parameters, block.objective, block.constraints
        lam_f, lam_g = ca.SX.sym("lam_f"), ca.SX.sym("lam_g", g.numel())
        hessian, _ = ca.hessian(lam_f * f + ca.dot(lam_g, g), z)
        upper, jacobian = ca.triu(ca.SX(hessian)), ca.SX(ca.jacobian(g, z))

        def function(name: str, inputs: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
            tidy = [ca.cse(ca.densify(each)) for each in outputs]
            return ca.Function(name, inputs, tidy).map(block.count)

        return cls(
            block,
            function("values", [z, p], [f, g]),
            function("gradient", [z, p], [ca.gradient(f, z)]),
            function("jacobian", [z, p], [ca.SX(jacobian.nz[:])]),
            function("hessian", [z, p, lam_f, lam_g], [ca.SX(upper.nz[:])]),
            jacobian.sparsity(),
            upper.sparsity(),
        )


@dataclass(frozen=True, eq=False)
class BlockProgram:
    """The program of all blocks: x, p -> f, g, with blocks and their instances in order.

    Attributes:
        size_x: number of variables.
        blocks: the kinds of terms.
    """

    size_x: int
    blocks: Sequence[Block]

    @property
    def size_p(self) -> int:
        """Number of parameters."""
        return sum(block.size_p for block in self.blocks)

    def solve(self, x: Array, bounds: tuple[Array, Array], options: Mapping[str, Any]) -> Outcome:
        """The solution by Ipopt from x (size_x,), within bounds of the variables."""
        functions = self._functions()
        nlp = functions.pop("nlp")
        lower, upper = bounds
        return Ipopt(nlp, functions, options)(
            x0=np.clip(x, lower, upper),
            p=_joined([block.values for block in self.blocks]),
            lbx=lower,
            ubx=upper,
            lbg=_joined([block.lower for block in self.blocks]),
            ubg=_joined([block.upper for block in self.blocks]),
        )

    def _functions(self) -> dict[str, ca.Function]:
        x, p = ca.MX.sym("x", self.size_x), ca.MX.sym("p", self.size_p)
        lam_f = ca.MX.sym("lam_f")
        lam_g = ca.MX.sym("lam_g", sum(block.size_g for block in self.blocks))
        f, g, gradient = ca.MX(0), [], ca.MX.zeros(self.size_x, 1)
        jacobians, hessians = [], []
        at_p = at_g = 0
        for each in map(_Derivatives.of, self.blocks):
            block = each.block
            z = ca.reshape(x[block.indices.ravel().tolist()], block.indices.shape[1], block.count)
            own_p = ca.reshape(p[at_p : at_p + block.size_p], -1, block.count)
            own_g = ca.reshape(lam_g[at_g : at_g + block.size_g], -1, block.count)
            if block.size_p == 0:
                own_p = ca.MX(0, block.count)
            if block.size_g == 0:
                own_g = ca.MX(0, block.count)
            value, constraints = each.values(z, own_p)
            f += ca.sum2(value)
            g.append(ca.vec(constraints))
            slopes = ca.vec(each.gradient(z, own_p))
            gradient += _adder(block.indices.ravel(), self.size_x) @ slopes
            rows, columns = _triplets(each.jacobian_places)
            within = block.size_g // max(block.count, 1)
            jacobians.append(
                (
                    at_g + np.arange(block.count)[:, None] * within + rows,
                    block.indices[:, columns],
                    ca.vec(each.jacobian(z, own_p)),
                )
            )
            rows, columns = _triplets(each.hessian_places)
            first, second = block.indices[:, rows], block.indices[:, columns]
            curvature = each.hessian(z, own_p, ca.repmat(lam_f, 1, block.count), own_g)
            hessians.append(
                (np.minimum(first, second), np.maximum(first, second), ca.vec(curvature))
            )
            at_p, at_g = at_p + block.size_p, at_g + block.size_g
        jacobian = _assembled((at_g, self.size_x), jacobians)
        hessian = _assembled((self.size_x, self.size_x), hessians)
        constraints = ca.vertcat(*g)
        names = ["x", "p"]
        return {
            "nlp": ca.Function("nlp", [x, p], [f, constraints], names, ["f", "g"]),
            "grad_f": ca.Function(
                "nlp_grad_f", [x, p], [f, ca.densify(gradient)], names, ["f", "grad_f_x"]
            ),
            "jac_g": ca.Function(
                "nlp_jac_g", [x, p], [constraints, jacobian], names, ["g", "jac_g_x"]
            ),
            "hess_lag": ca.Function(
                "nlp_hess_l",
                [x, p, lam_f, lam_g],
                [hessian],
                [*names, "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
        }


def _joined(parts: Sequence[Array]) -> Array:
    return np.concatenate([part.ravel() for part in parts])


def _triplets(pattern: ca.Sparsity) -> tuple[Indices, Indices]:
    rows, columns = pattern.get_triplet()
    return np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)


def _adder(places: Array | Indices, size: int) -> ca.DM:
    """Matrix that adds entries up in their places, (size, entries)."""
    order = list(range(len(places)))
    return ca.DM.triplet(places.tolist(), order, np.ones(len(order)), size, len(order))


def _assembled(shape: tuple[int, int], parts: Sequence[tuple[Indices, Indices, ca.MX]]) -> ca.MX:
    """Sparse matrix with the entries added up in their places (rows, columns)."""
    rows = np.concatenate([part[0].ravel() for part in parts])
    columns = np.concatenate([part[1].ravel() for part in parts])
    entries = ca.vertcat(*(part[2] for part in parts))
    # CasADi's order is by columns.
    unique, places = np.unique(columns * shape[0] + rows, return_inverse=True)
    pattern = ca.Sparsity.triplet(
        *shape, (unique % shape[0]).tolist(), (unique // shape[0]).tolist()
    )
    if unique.size == rows.size:
        order = np.argsort(places)
        return ca.MX(pattern, entries[order.tolist()])
    return ca.MX(pattern, ca.densify(_adder(places.ravel(), unique.size) @ entries))
