"""The one nonlinear program of the package: a sum of small functions of a few variables each.

f(x) = sum_k w_k f_b(z_k, p_k) and g(x) = (g_b(z_k, p_k))_bk over kinds b of terms and their
instances k, with z_k = offset_k + scale_k * (A_k x): some of the variables, or values and slopes of
polynomials between them. First and second derivatives are exact: those of one instance are
generated once as a function, compiled, mapped over the instances, and added up in the places of
their variables.
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from hashlib import sha256
from typing import Any, TypeAlias, TypeVar

import casadi as ca
import numpy as np
import scipy.sparse

from geodesic_ocp.arrays import Array
from geodesic_ocp.cells import Cells, Indices, as_dm
from geodesic_ocp.compiled.library import Library
from geodesic_ocp.ipopt import Ipopt, Outcome, Relay

Start = TypeVar("Start")
Found = TypeVar("Found")
_MANY = 200  # instructions from which on a function is compiled
# From which on looking for common subexpressions takes longer than the few that there are.
_LONG = 2000


class Terms:
    """An objective f(z, p) and constraint functions g(z, p) of one instance, with derivatives.

    Args:
        variables: symbols z (size, 1).
        parameters: symbols p (k, 1).
        objective: f, a scalar.
        constraints: g (m, 1).
        slopes: Jacobian of g by z (m, size), where it is simpler in closed form, as of minima.
        lasting: whether many programs use them, so that an optimizing compiler pays.
    """

    def __init__(
        self,
        variables: ca.SX,
        parameters: ca.SX | None = None,
        objective: ca.SX | float = 0.0,
        constraints: ca.SX | None = None,
        slopes: ca.SX | None = None,
        lasting: bool = False,
    ) -> None:
        self._z = variables
        self._p = ca.SX(0, 1) if parameters is None else parameters
        self._f = ca.SX(objective)
        self._g = ca.SX(0, 1) if constraints is None else ca.densify(constraints)
        self.size, self.size_g = int(self._z.numel()), int(self._g.numel())
        self.size_p = int(self._p.numel())
        self.has_objective = not self._f.is_zero()
        self._given_slopes = slopes
        self._lasting = lasting

    @cached_property
    def value(self) -> ca.Function:
        """(z, p) -> f, g."""
        return self._function("value", [], [self._f, self._g])

    @cached_property
    def gradient(self) -> ca.Function:
        """(z, p) -> f and its gradient."""
        return self._function("gradient", [], [self._f, ca.gradient(self._f, self._z)])

    @cached_property
    def jacobian(self) -> ca.Function:
        """(z, p) -> g and the entries of its Jacobian."""
        return self._function("jacobian", [], [self._g, ca.vec(self._slopes.nz[:])])

    @cached_property
    def hessian(self) -> ca.Function:
        """(z, p, lam_f, lam_g) -> entries of the Lagrangian's Hessian, its upper triangle."""
        factors, hessian = self._curvature
        return self._function("hessian", factors, [ca.vec(hessian.nz[:])])

    def mapped(self, name: str, count: int, arguments: Sequence[Any]) -> list[Any]:
        """Return outputs of one of these functions for so many instances, one column each.

        "interpreted" is the value, which CasADi can differentiate.
        """
        function = self.value if name == "interpreted" else getattr(self, name)
        is_compiled = self._lasting if name == "value" else name != "interpreted"
        library = self._compiled(name) if is_compiled else None
        if library is not None and (file := library.file):
            self.in_use[name] = library
            with suppress(RuntimeError):  # the file has been removed
                function = ca.external(name, file)
        return list(function.map(count).call(list(arguments)))

    @cached_property
    def in_use(self) -> dict[str, Library]:
        """Libraries of the functions of the last program."""
        return {}

    def at(self, name: str, z: Array, p: Array, at_once: bool = True) -> list[Array]:
        """Return outputs (k, .) of `value` or `jacobian` at z (k, size) for p (k, .) or (.).

        `at_once`: whether they are compiled at their first use, not after some, see `Library`.
        """
        function = getattr(self, name)
        library = self._compiled(name)
        if not len(z):
            return [np.empty((0, function.numel_out(k))) for k in range(function.n_out())]
        p = np.ascontiguousarray(p, dtype=float)
        begin = time.perf_counter()
        if library is None or (handle := library.handle(at_once)) is None:
            every = np.broadcast_to(p, (len(z), self.size_p))
            found = function.map(len(z)).call([ca.DM(z.T), ca.DM(every.T)])
            if library is not None:
                library.used(time.perf_counter() - begin)
            return [each.full().T for each in found]
        z = np.ascontiguousarray(z, dtype=float)
        if name not in self._sizes:
            widths = [function.numel_out(k) for k in range(function.n_out())]
            self._sizes[name] = widths, (function.sz_arg(), function.sz_res(), function.sz_w())
        sizes, (arguments, results, numbers) = self._sizes[name]
        outputs = [np.empty((len(z), size)) for size in sizes]
        steps = [self.size, self.size_p * (p.ndim - 1)], sizes
        pointers = _pointers([z, p], arguments), _pointers(outputs, results)
        work = np.empty(numbers + 1)
        handle.many(
            getattr(handle, name),
            ctypes.c_longlong(len(z)),
            2,
            len(outputs),
            *(each for pair in zip(pointers, map(_steps, steps), strict=True) for each in pair),
            work.ctypes.data_as(ctypes.c_void_p),
        )
        library.used(time.perf_counter() - begin)
        return outputs

    def jacobians(self, z: Array, p: Array) -> tuple[Array, Array]:
        """Return g (k, m) and its Jacobians (k, m, size) at z (k, size), for p as in `at`."""
        g, entries = self.at("jacobian", z, p)
        found = np.zeros((len(z), self.size_g, self.size))
        found[:, self.jacobian_entries[0], self.jacobian_entries[1]] = entries
        return g, found

    def _compiled(self, name: str) -> Library | None:
        """Return a library with a function, if that takes long enough."""
        if name not in self._libraries:
            function = getattr(self, name)
            found = None
            if self._lasting or function.n_instructions() > _MANY:
                digest = sha256(function.serialize().encode()).hexdigest()
                found = Library(lambda: {name: function}, digest, lasting=self._lasting)
            self._libraries[name] = found
        return self._libraries[name]

    @cached_property
    def _libraries(self) -> dict[str, Library | None]:
        return {}

    @cached_property
    def _sizes(self) -> dict[str, tuple[list[int], tuple[int, int, int]]]:
        return {}

    @cached_property
    def jacobian_entries(self) -> tuple[Indices, Indices]:
        """Rows and columns of the Jacobian's entries."""
        return _triplets(self._slopes.sparsity())

    @cached_property
    def hessian_entries(self) -> tuple[Indices, Indices]:
        """Rows and columns of the Hessian's entries."""
        return _triplets(self._curvature[1].sparsity())

    @cached_property
    def _slopes(self) -> ca.SX:
        given = self._given_slopes
        return ca.SX(ca.jacobian(self._g, self._z) if given is None else given)

    @cached_property
    def _curvature(self) -> tuple[list[ca.SX], ca.SX]:
        lam_f = ca.SX.sym("lam_f")
        lam_g = ca.SX.sym("lam_g", self.size_g)
        if self._given_slopes is None:
            hessian, _ = ca.hessian(lam_f * self._f + ca.dot(lam_g, self._g), self._z)
        else:
            gradient = lam_f * ca.gradient(self._f, self._z) + self._given_slopes.T @ lam_g
            hessian = ca.jacobian(gradient, self._z)
        return [lam_f, lam_g], ca.triu(ca.SX(hessian))

    def _function(self, name: str, more: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
        arguments = [self._z, self._p, *more]
        dense = [ca.densify(each) for each in outputs]
        whole = ca.Function(name, arguments, dense)
        if whole.n_instructions() > _LONG:
            return whole
        return ca.Function(name, arguments, [ca.cse(each) for each in dense])


def at_rows(function: ca.Function, *rows: Array) -> Array:
    """Return outputs of a function of vectors (k, .), one after the other by columns, for k rows of
    each; compiled when it has been used for some time.
    """
    return _of_rows(function).at("value", np.hstack(rows), np.zeros(0), at_once=False)[1]


@lru_cache(maxsize=256)
def _of_rows(function: ca.Function) -> Terms:
    arguments = function.sx_in()
    outputs = ca.vertcat(*map(ca.vec, function.call(arguments)))
    return Terms(ca.vertcat(*arguments), constraints=outputs, lasting=True)


def _pointers(arrays: Sequence[Array], size: int) -> ctypes.Array[ctypes.c_void_p]:
    own = (ctypes.c_void_p * max(size, len(arrays)))()
    own[: len(arrays)] = [each.ctypes.data for each in arrays]
    return own


def _steps(steps: Sequence[int]) -> ctypes.Array[ctypes.c_longlong]:
    return (ctypes.c_longlong * len(steps))(*steps)


class Instance(ca.SX):
    """An expression in some variables that is the constraint function g(z, p) of terms.

    Its derivatives are not generated again for other numbers, or for other z of as many variables.

    Args:
        expression: the expression.
        terms: terms, of which there may be many instances.
        numbers: values of p (k,).
        variables: symbols (n, 1).
        inner: terms in these variables whose constraint functions include z.
        indices: those of z among them.
    """

    def __init__(
        self,
        expression: ca.SX,
        terms: Terms,
        numbers: Array,
        variables: ca.SX,
        inner: Terms,
        indices: Indices,
    ) -> None:
        super().__init__(expression)
        self.terms = terms
        self.numbers = numbers
        self.variables = variables
        self.inner = inner
        self.indices = indices

    def __repr__(self) -> str:
        return f"Instance({self.numbers.size} numbers)"


@dataclass(frozen=True, eq=False)
class Block:
    """Instances of one kind of terms. Numbers may be expressions in the program's parameters.

    Attributes:
        terms: terms of an instance.
        places: places of the variables of every instance in x: indices (instances, size), all
            different in a row; a sparse matrix (instances * size, number of variables); or cells.
        values: values of the parameters, (instances, k).
        lower, upper: bounds of the constraint functions, (instances, m); or of the sums of them.
        weights: weights of the objective (instances,); None: one.
        units: offset and scale of the variables (rows of places, size); None: zero and one.
        groups: for each instance the row of `places` with its variables, of terms without
            constraints; None: each has its own.
        sums: matrix (sums, instances * m) of the weighted sums of the constraint functions that are
            constrained, as in weak forms of equations; None: each function is by itself.
        inner: block whose constraint functions, of one instance after the other, take the place of
            x, as points of a mechanism do in distances; only for terms without an objective.
    """

    terms: Terms
    places: Indices | scipy.sparse.sparray | Cells
    values: Array | ca.MX | None = None
    lower: Array | None = None
    upper: Array | None = None
    weights: Array | ca.MX | ca.DM | None = None
    units: tuple[Any, Any] | None = None
    groups: Indices | None = None
    sums: scipy.sparse.sparray | None = None
    inner: Block | None = None

    @property
    def count(self) -> int:
        """Number of instances."""
        return self.num_places if self.groups is None else self.groups.size

    @cached_property
    def num_places(self) -> int:
        """Number of different sets of variables."""
        if isinstance(self.places, Cells):
            return len(self.places.indices) * int(self.places.rows.shape[-3])
        rows = int(self.places.shape[0])
        return rows if isinstance(self.places, np.ndarray) else rows // max(self.terms.size, 1)

    @property
    def size_g(self) -> int:
        """Number of constraint functions of all instances, or of their sums."""
        return self.terms.size_g * self.count if self.sums is None else int(self.sums.shape[0])

    def constraints(self, values: ca.MX) -> ca.MX:
        """Return the constraint functions from those of all instances, one column each."""
        return ca.vec(values) if self.sums is None else as_dm(self.sums) @ ca.vec(values)

    def of_instances(self, lam_g: ca.MX | ca.DM) -> ca.MX | ca.DM:
        """Return multipliers of the constraint functions of all instances, one column each."""
        own = lam_g if self.sums is None else as_dm(self.sums.T) @ lam_g
        return ca.reshape(own, self.terms.size_g, self.count)

    @cached_property
    def _matrix(self) -> scipy.sparse.csr_array:
        """Matrix A of all instances, with as many columns as it needs."""
        if isinstance(self.places, np.ndarray):
            size = self.places.size
            return scipy.sparse.csr_array((np.ones(size), self.places.ravel(), np.arange(size + 1)))
        if isinstance(self.places, Cells):
            rows, columns, entries = self.places.matrix
            shape = self.terms.size * self.num_places, columns.max() + 1
            return scipy.sparse.csr_array((entries, (rows, columns)), shape)
        return scipy.sparse.csr_array(self.places)

    def arguments(self, x: ca.MX | ca.DM) -> list[ca.MX | ca.DM]:
        """Return variables and parameters of all instances, one column each."""
        if isinstance(self.places, np.ndarray):
            z = x[self.places.ravel().tolist()]
        else:
            z = as_dm(self._matrix) @ x[: self._matrix.shape[1]]
        z = ca.reshape(ca.densify(z), self.terms.size, self.num_places)
        if self.units is not None:
            offset, scale = (_columns(each) for each in self.units)
            z = offset + scale * z
        if self.groups is not None:
            z = z[:, self.groups.tolist()]
        values = ca.DM(0, self.count) if self.values is None else _columns(self.values)
        return [z, values]

    def objectives(self, x: ca.MX) -> ca.MX:
        """Return the weighted sums of the objective over the instances with the same variables."""
        values = self.terms.mapped("value", self.count, self.arguments(x))[0]
        weights = ca.DM.ones(1, self.count) if self.weights is None else _columns(self.weights)
        return ca.vec(self._summed(values * weights))

    def spread(self, at: Indices, values: ca.MX) -> tuple[Indices, Indices, Array, ca.MX]:
        """Return entries of all instances by their variables, as entries by x.

        Args:
            at: the variable of each entry of an instance.
            values: one column an instance, by variables in their units.

        Returns:
            Numbers of the entries, variables in x, coefficients, and the entries.
        """
        values = self._summed(values)
        if self.units is not None:
            values = values * _columns(self.units[1])[at.tolist(), :]
        number, entry = self._expanded(self._of_instances(at))
        return number, self._matrix.indices[entry], self._matrix.data[entry], ca.vec(values)

    def summed_jacobian(self, slopes: ca.MX) -> ca.MX:
        """Return the Jacobian of the sums by x from the entries of all instances, one column each.

        As products of sparse matrices, for each sum has the variables of many instances.
        """
        rows, columns = self.terms.jacobian_entries
        size_g = self.terms.size_g
        size = self.terms.size
        each = np.arange(self.count)[:, None]
        of_instances = _assembled(
            (size_g * self.count, size * self.count),
            [_Entries((each * size_g + rows).ravel(), (each * size + columns).ravel(), slopes)],
        )
        matrix = self._matrix
        if self.units is not None:
            matrix = scipy.sparse.diags_array(np.ravel(self.units[1])) @ matrix
        return as_dm(self.sums) @ of_instances @ as_dm(matrix)

    def _of_instances(self, at: Indices) -> Indices:
        """Return rows of the matrix A for some of the variables of every instance, in order."""
        return np.asarray((self.terms.size * np.arange(self.num_places)[:, None] + at).ravel())

    def _summed(self, values: ca.MX) -> ca.MX:
        """Get values of instances, one column each, added up where they have the same variables."""
        if self.groups is None:
            return values
        ones = np.ones(self.count)
        each = np.arange(self.count)
        shape = self.count, self.num_places
        return values @ as_dm(scipy.sparse.csc_array((ones, (each, self.groups)), shape))

    def _expanded(self, rows: Indices) -> tuple[Indices, Indices]:
        """Return, for rows of A, numbers in the list and each of their entries in `_matrix`."""
        starts = self._matrix.indptr
        lengths = np.diff(starts)[rows]
        number = np.repeat(np.arange(rows.size), lengths)
        within = np.arange(number.size) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        return number, starts[rows][number] + within

    def curvature(self, values: ca.MX) -> _Entries:
        """Return the Hessian by x from the entries of those of all instances, one column each."""
        first, second = pattern = self.terms.hessian_entries
        values = self._summed(values)
        if self.units is not None:
            scale = _columns(self.units[1])
            values = values * (scale[first.tolist(), :] * scale[second.tolist(), :])
        if isinstance(self.places, Cells):
            row, column, entries = self.places.hessians(pattern, values)
            return _Entries(row, column, entries)
        columns = self._matrix.indices
        factors = self._matrix.data
        number, one = self._expanded(self._of_instances(first))
        # Every entry of the one row of A with every entry of the other.
        again, other = self._expanded(self._of_instances(second)[number])
        number = number[again]
        one = one[again]
        row = columns[one]
        column = columns[other]
        off_diagonal = np.tile(first != second, self.num_places)[number]
        coefficient = factors[one] * factors[other]
        coefficient *= np.where((row == column) & off_diagonal, 2.0, 1.0)
        kept = off_diagonal | (row <= column)
        row, column = np.minimum(row, column), np.maximum(row, column)
        return _Entries(row[kept], column[kept], ca.vec(values), number[kept], coefficient[kept])


@dataclass(frozen=True, eq=False)
class _Entries:
    """Entries of a sparse matrix: `values[source] * factors` is added at (row, column)."""

    row: Indices
    column: Indices
    values: ca.MX
    source: Indices | None = None
    factors: Array | None = None


# Blocks with the variables and parameters of their instances.
_Pairs: TypeAlias = Sequence[tuple[Block, list[Any]]]


@dataclass(frozen=True, eq=False)
class BlockProgram:
    """The program of all blocks: x, p -> f, g, with blocks and their instances in order.

    Attributes:
        size: number of variables.
        blocks: the kinds of terms.
        parameters: symbols of the parameters p in which numbers of the blocks are expressed.
        quadratic: Q (size, size) and b (size,) of a term x' Q x / 2 - b' x; None: there is none.
        differentiable: whether CasADi can differentiate `functions`; they are slower then.
        scales: symbols (size_g, 1), further parameters by which constraint functions are divided;
            None: they are not.
    """

    size: int
    blocks: Sequence[Block]
    parameters: ca.MX | None = None
    quadratic: tuple[scipy.sparse.sparray, Array] | None = None
    differentiable: bool = False
    scales: ca.MX | None = None

    @property
    def size_g(self) -> int:
        """Number of constraint functions."""
        return sum(block.size_g for block in self.blocks)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Bounds of the constraint functions."""
        sides = [(each.lower, each.upper) for each in self.blocks if each.size_g]
        lower, upper = zip(*sides, strict=True) if sides else ((), ())
        return _joined(lower), _joined(upper)

    def solve(
        self,
        x: Array,
        bounds: tuple[Array, Array],
        options: Mapping[str, Any],
        multipliers: tuple[Array, Array] | None = None,
        p: Array | tuple[()] = (),
        relay: Relay | None = None,
    ) -> Outcome:
        """Return the solution by Ipopt from x, within bounds of the variables.

        Args:
            x: (size,).
            bounds: lower and upper (size,).
            options: options of Ipopt.
            multipliers: guesses of those of the bounds (size,) and of the constraint functions
                (size_g,), for a warm start.
            p: values of the parameters.
            relay: called in every iteration.
        """
        lower, upper = bounds
        lower_g, upper_g = self.bounds
        known = dict(zip(("lam_x0", "lam_g0"), multipliers or (), strict=False))
        return self.solver(options, relay)(
            **known,
            x0=np.clip(x, lower, upper),
            p=np.asarray(p, dtype=float),
            lbx=lower,
            ubx=upper,
            lbg=lower_g,
            ubg=upper_g,
        )

    def solver(self, options: Mapping[str, Any], relay: Relay | None = None) -> Ipopt:
        """Return Ipopt for this program; the relay is called in every iteration."""
        derivatives = {name: self.functions[name] for name in ("grad_f", "jac_g", "hess_lag")}
        every = {part.terms for each in self.blocks for part in (each, each.inner) if part}

        def solved(seconds: float) -> None:
            libraries = {each for terms in every for each in terms.in_use.values()}
            for library in libraries:
                library.used(seconds / len(libraries))

        return Ipopt(self.functions["nlp"], derivatives, options, relay, solved)

    @cached_property
    def functions(self) -> dict[str, ca.Function]:
        """nlp, grad_f, jac_g, hess_lag: the program and its derivatives, as nlpsol takes them."""
        x = ca.MX.sym("x", self.size)
        p = ca.MX.sym("p", 0) if self.parameters is None else self.parameters
        lam_f = ca.MX.sym("lam_f")
        lam_g = ca.MX.sym("lam_g", self.size_g)
        inner = list(dict.fromkeys(each.inner for each in self.blocks if each.inner is not None))
        before = [(block, block.arguments(x)) for block in inner]
        points: dict[Block | None, ca.MX] = {None: x}
        value = "interpreted" if self.differentiable else "value"
        for block, arguments in before:
            points[block] = ca.vec(block.terms.mapped(value, block.count, arguments)[1])
        pairs = [(block, block.arguments(points[block.inner])) for block in self.blocks]
        f = ca.MX(0)
        g = []
        for block, (z, values) in pairs:
            of_each, constraints = block.terms.mapped(value, block.count, [z, values])
            f += _weighted(block, of_each) if block.terms.has_objective else 0
            g.append(block.constraints(constraints))
        again, gradient = self._gradient(pairs)
        if self.quadratic is not None:
            bent = as_dm(self.quadratic[0]) @ x
            linear = ca.DM(self.quadratic[1])
            more = ca.dot(x, bent) / 2 - ca.dot(linear, x)
            f = f + more
            again = again + more
            gradient = ca.densify(gradient + bent - linear)
        names = ["x", "p"]
        constraints = ca.vertcat(ca.MX(0, 1), *g)
        slopes = self._jacobian(pairs, before)
        lam_of_blocks = lam_g
        if self.scales is not None:
            p = ca.vertcat(p, self.scales)
            constraints = constraints / self.scales
            slopes = ca.diag(1.0 / self.scales) @ slopes
            lam_of_blocks = lam_g / self.scales
        functions = {
            "nlp": ([x, p], [f, constraints], names, ["f", "g"]),
            "grad_f": ([x, p], [again, gradient], names, ["f", "grad_f_x"]),
            "jac_g": ([x, p], [constraints, slopes], names, ["g", "jac_g_x"]),
            "hess_lag": (
                *([x, p, lam_f, lam_g], [self._hessian(pairs, before, lam_f, lam_of_blocks)]),
                *([*names, "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]),
            ),
        }
        return {name: ca.Function(name, *each) for name, each in functions.items()}

    def _gradient(self, pairs: _Pairs) -> tuple[ca.MX, ca.MX]:
        f = ca.MX(0)
        parts = []
        for block, (z, values) in pairs:
            if block.terms.has_objective:
                of_each, slopes = block.terms.mapped("gradient", block.count, [z, values])
                f += _weighted(block, of_each)
                if block.weights is not None:
                    slopes = slopes * (ca.DM.ones(block.terms.size, 1) @ _columns(block.weights))
                source, at, factors, entries = block.spread(np.arange(block.terms.size), slopes)
                parts.append(_Entries(at, np.zeros_like(at), entries, source, factors))
        return f, ca.densify(_assembled((self.size, 1), parts))

    def _jacobian(self, pairs: _Pairs, before: _Pairs) -> ca.MX:
        total = self._slopes(pairs, None, self.size)
        for block, arguments in before:
            total += self._slopes(pairs, block, block.size_g) @ self._inner_slopes(block, arguments)
        return total

    def _inner_slopes(self, block: Block, arguments: list[Any]) -> ca.MX:
        return BlockProgram(self.size, [block])._slopes([(block, arguments)], None, self.size)

    def _slopes(self, pairs: _Pairs, inner: Block | None, size: int) -> ca.MX:
        """Return the Jacobian of all constraint functions (size_g, size) by x, or by those of an
        inner block, of the blocks in these variables.
        """
        first = 0
        parts = []
        for block, (z, values) in pairs:
            if block.size_g and block.inner is inner:
                _, slopes = block.terms.mapped("jacobian", block.count, [z, values])
                rows, columns = block.terms.jacobian_entries
                if block.sums is not None:
                    total = block.summed_jacobian(slopes)
                    row, at = _triplets(total.sparsity())
                    parts.append(_Entries(first + row, at, total.nz[:]))
                else:
                    source, at, factors, entries = block.spread(columns, slopes)
                    instance, entry = np.divmod(source, max(columns.size, 1))
                    row = first + block.terms.size_g * instance + rows[entry]
                    parts.append(_Entries(row, at, entries, source, factors))
            first += block.size_g
        return _assembled((self.size_g, size), parts)

    def _hessian(self, pairs: _Pairs, before: _Pairs, lam_f: ca.MX, lam_g: ca.MX) -> ca.MX:
        total = self._curvature(pairs, None, self.size, lam_f, lam_g)
        for block, arguments in before:
            # With y(x): y_x' L_yy y_x + sum_k L_y_k (y_k)_xx.
            slopes = self._inner_slopes(block, arguments)
            by_points = ca.triu2symm(self._curvature(pairs, block, block.size_g, lam_f, lam_g))
            total += ca.triu(slopes.T @ (by_points @ slopes))
            lam = self._slopes(pairs, block, block.size_g).T @ lam_g
            alone = BlockProgram(self.size, [block])
            total += alone._curvature([(block, arguments)], None, self.size, ca.MX(0), lam)
        if self.quadratic is not None:
            upper = scipy.sparse.triu(self.quadratic[0]).tocoo()
            part = _Entries(upper.row, upper.col, lam_f * ca.DM(upper.data))
            total += _assembled((self.size, self.size), [part])
        return total

    def _curvature(
        self, pairs: _Pairs, inner: Block | None, size: int, lam_f: ca.MX, lam_g: ca.MX
    ) -> ca.MX:
        """Return the upper triangle of the Hessian (size, size) of the blocks in x, or in the
        constraint functions of an inner block.
        """
        first = 0
        parts = []
        for block, (z, values) in pairs:
            own = lam_g[first : first + block.size_g]
            first += block.size_g
            if block.terms.hessian_entries[0].size and block.inner is inner:
                weights: ca.MX | ca.DM = ca.DM.ones(1, block.count)
                if block.weights is not None:
                    weights = _columns(block.weights)
                inputs = [z, values, lam_f * weights, block.of_instances(own)]
                parts.append(block.curvature(*block.terms.mapped("hessian", block.count, inputs)))
        return _assembled((size, size), parts)


def single_block(terms: Terms, options: Mapping[str, Any] | None = None) -> Ipopt:
    """Return Ipopt for a program of one instance, whose variables and parameters are its own."""
    p = ca.MX.sym("p", terms.size_p)
    block = Block(terms, np.arange(terms.size)[None, :], p.T)
    return BlockProgram(terms.size, [block], p).solver(options or {})


def _columns(values: Array | ca.MX | ca.DM) -> ca.MX | ca.DM:
    """Return numbers of instances (instances, m), one column each."""
    if isinstance(values, (ca.MX, ca.DM)):
        return values.T
    return ca.DM(np.atleast_2d(np.transpose(values)))


def _weighted(block: Block, values: ca.MX) -> ca.MX:
    return ca.sum2(values if block.weights is None else values * _columns(block.weights))


def _joined(parts: Sequence[Any]) -> Array:
    return np.concatenate([np.zeros(0), *(np.ravel(part) for part in parts)])


def _triplets(pattern: ca.Sparsity) -> tuple[Indices, Indices]:
    rows, columns = pattern.get_triplet()
    return np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)


def _assembled(shape: tuple[int, int], parts: Sequence[_Entries]) -> ca.MX:
    """Return sparse matrix with the entries added up in their places."""
    if not parts:
        return ca.MX(*shape)
    rows = np.concatenate([part.row for part in parts], dtype=np.int64)
    columns = np.concatenate([part.column for part in parts], dtype=np.int64)
    entries = []
    sources = []
    factors = []
    first = 0
    for part in parts:
        entries.append(ca.densify(part.values))
        count = int(part.values.numel())
        own = np.arange(count) if part.source is None else part.source
        sources.append(first + own)
        factors.append(np.ones(own.size) if part.factors is None else part.factors)
        first += count
    # CasADi's order is by columns.
    unique, places = np.unique(columns * shape[0] + rows, return_inverse=True)
    pattern = ca.Sparsity.triplet(
        *shape, (unique % shape[0]).tolist(), (unique // shape[0]).tolist()
    )
    source = np.concatenate(sources)
    factor = np.concatenate(factors)
    every = ca.vertcat(*entries)
    places = places.ravel()
    # Most entries are alone in their places; the others are added up first.
    alone = (np.bincount(places) == 1)[places] & (factor == 1.0)
    order = np.empty(unique.size, dtype=np.int64)
    order[places[alone]] = source[alone]
    if not np.all(alone):
        shared, row = np.unique(places[~alone], return_inverse=True)
        used, column = np.unique(source[~alone], return_inverse=True)
        adder = scipy.sparse.csc_array((factor[~alone], (row.ravel(), column.ravel())))
        every = ca.vertcat(every, ca.densify(as_dm(adder) @ every[used.tolist()]))
        order[shared] = first + np.arange(shared.size)
    return ca.MX(pattern, every[order.tolist()])


def in_rounds(
    start: Start,
    solve: Callable[[Start], Found],
    examine: Callable[[int, Found], tuple[Found, Start | None]],
    most: int,
) -> Found:
    """Solve, look between the instants, add rows or nodes where that is needed, solve again.

    Args:
        start: from which the first round begins, whatever `solve` takes.
        solve: the solution from a start, or the last iterate.
        examine: number of the round and what it found -> the result, which it may declare failed,
            and the start of the next round; None: this was the last one.
        most: number of rounds.
    """
    for number in range(most):
        found, following = examine(number, solve(start))
        if following is None:
            break
        start = following
    return found
