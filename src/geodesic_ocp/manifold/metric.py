"""Riemannian metrics: all quantities are derived from the metric tensor G(q).

The equations follow the convention of Klein, Jaquier, Meixner, Asfour, "A Riemannian Take on Human
Motion Analysis and Retargeting" (IROS 2022), section III, with Christoffel symbols of the first
kind,

    Gamma_ijk = 1/2 (d g_ij / d q_k + d g_ik / d q_j - d g_jk / d q_i).

Functions of a metric and two points or vectors are vectorized over rows of arrays by `over_rows`.
"""

from __future__ import annotations

import functools
import inspect
import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar, cast

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array, as_vector, evaluate, is_symbolic
from geodesic_ocp.errors import GeodesicOcpError
from geodesic_ocp.manifold.metric_functions import MetricFunctions
from geodesic_ocp.model.model import Model

Function = TypeVar("Function", bound=Callable[..., Any])
_FEW = 8  # rows; fewer are not worth starting threads
# Eigenvalues of the normalized tensor below the first are zero up to rounding, as are entries of
# the diagonal below the second relative to the largest, such as the square of sin(pi).
_SINGULAR = 1e-14
_VANISHING = 1e-28
# Eigenvalues below this make geodesics hard to compute.
_NEARLY_SINGULAR = 1e-4
# Coordinates are named if their component of the singular direction exceeds this fraction.
_FRACTION = 0.1


def as_metric(metric: Any) -> Metric:
    """Return the argument, if it is a metric with a dimension; ValueError otherwise."""
    if not isinstance(metric, Metric):
        hint = "; use go.KineticEnergy(model)" if isinstance(metric, Model) else ""
        raise ValueError(f"metric must be an instance of a Metric class, got {metric!r}{hint}")
    dim = getattr(metric, "dim", None)
    if not isinstance(dim, int) or dim < 1:
        raise ValueError(f"{type(metric).__name__}.dim must be a positive integer, is {dim!r}")
    return metric


def has_compiled_code(metric: Any) -> bool:
    """Return whether the functions of this metric are compiled, or can be now."""
    return (
        isinstance(metric, Metric) and not metric.has_constant_tensor and metric.kernels.available()
    )


def speeds_at(metric: Metric, q: Array, velocity: Array) -> Array:
    """Return speeds |v|_q (k,) of velocities (k, n) at positions (k, n); NaN where there is no
    metric.
    """
    if metric.has_constant_tensor:
        squares = np.sum(velocity @ metric.matrix(q[0]) * velocity, axis=1)
        return np.asarray(np.sqrt(squares))
    if metric.kernels.available(at_once=False):
        return metric.kernels.speeds(q, velocity)
    energies = metric.energy_density.map(len(q))(q.T, velocity.T)
    return np.asarray(ca.sqrt(2 * energies).full()[0])


def _also_numeric(matrix: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """Return the symbolic matrix(q) of a subclass, extended to take and return NumPy arrays."""

    @functools.wraps(matrix)
    def wrapped(self: Metric, q: Any) -> Any:
        if is_symbolic(q):
            return matrix(self, q)
        point = as_vector("q", q, self.dim)
        kernels = self.__dict__.get("kernels")
        if kernels is not None and kernels.loaded:
            return self._defined(kernels.matrix(point), point)
        return self._defined(evaluate(self._matrix_function, point), point)

    return wrapped


class Metric(MetricFunctions):
    """A Riemannian metric on R^n given by its tensor G(q).

    A subclass defines `dim` and `matrix(q)` in CasADi operations. Everything else follows, and
    `matrix` then also takes and returns NumPy arrays. Metrics are immutable values.

    >>> import casadi as ca
    >>> class HalfPlane(go.Metric):  # hyperbolic: ds^2 = (dx^2 + dy^2) / y^2, y > 0
    ...     dim = 2
    ...     def matrix(self, q):
    ...         return ca.SX.eye(2) / q[1] ** 2
    >>> HalfPlane().matrix([0.0, 2.0])
    array([[0.25, 0.  ],
           [0.  , 0.25]])
    """

    dim: int
    # Names of the coordinates, if any; motions and files are compared with them.
    joint_names: tuple[str, ...] | None = None
    # What tables call it; by default the name of its class.
    label: str = ""
    # Period of every coordinate, such as 2 pi for an angle; inf if it is not periodic.
    periods: tuple[float, ...] | None = None

    @property
    def coordinate_names(self) -> tuple[str, ...]:
        """Names of the coordinates: those of the joints, or q[0], q[1] and so on."""
        return self.joint_names or tuple(f"q[{index}]" for index in range(self.dim))

    def __repr__(self) -> str:
        return f"{type(self).__name__}(dim={self.dim})"

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        if "matrix" in cls.__dict__:
            cls.matrix = _also_numeric(cls.__dict__["matrix"])  # type: ignore[method-assign,assignment]

    def _checked(self, **vectors: Any) -> list[Any]:
        if is_symbolic(*vectors.values()):
            return list(vectors.values())
        return [as_vector(name, value, self.dim) for name, value in vectors.items()]

    def point(self, name: str, q: Any) -> Array:
        """Return the argument `name` as a point (n,) at which the metric is valid.

        Raises:
            ValueError: not n finite numbers, or G(q) is not finite, symmetric or positive definite,
                or `check_units` or `check_domain` fails.
        """
        point = as_vector(name, q, self.dim)
        self.check_units(name, point)
        self.check_domain(name, point)
        kernels = self.__dict__.get("kernels")
        if kernels is not None and kernels.loaded and kernels.is_regular(point):
            return point
        tensor = self.matrix(point)
        if not np.all(np.isfinite(tensor)):
            raise ValueError(f"{name}: the metric is not finite at {point}")
        if not np.abs(tensor - tensor.T).max() <= 1e-9 * np.abs(tensor).max():
            raise ValueError(f"{name}: the metric tensor is not symmetric at {point}")
        diagonal = np.diag(tensor)
        is_singular = np.any(diagonal <= _VANISHING * diagonal.max())
        if not is_singular:  # neither in other units, nor where lengths grow near a boundary
            normalized = tensor / np.sqrt(np.outer(diagonal, diagonal))
            is_singular = np.linalg.eigvalsh(normalized)[0] <= _SINGULAR
        if is_singular:
            smallest, largest = np.linalg.eigvalsh(tensor)[[0, -1]]
            why = self.near_singularity(point)
            raise ValueError(
                f"{name}: the metric is not positive definite at {point}: the eigenvalues of G "
                f"range from {smallest:.1e} to {largest:.1e}{why and f'; {why}'}"
            )
        return point

    def check_units(self, name: str, q: Array) -> None:
        """Raise ValueError if q (n,) must be in other units; by default all values may occur."""

    def check_domain(self, name: str, q: Array) -> None:
        """Raise ValueError if the metric is not defined at q (n,); by default it is everywhere."""

    @property
    def relaxed(self) -> Metric | None:
        """A metric near this one whose geodesics are found more easily, as guesses; None: no."""
        return None

    def check_domain_along(self, name: str, times: Array, points: Array) -> None:
        """Raise ValueError for the first of the times (k,) at which points (k, n) are outside."""
        for t, q in zip(times, points, strict=True):
            self.check_domain(f"{name} at {t:.6g}", q)

    def _defined(self, values: Any, q: Array) -> Any:
        """Get the values of a function at q (n,); ValueError if they are NaN outside the domain."""
        if np.isnan(values).any():
            self.check_domain("q", q)
        return values

    def near_singularity(self, q: Array) -> str:
        """Return why the metric is nearly singular or not defined at q (n,); empty if it is
        neither.

        Based on the eigenvalues of g_ij / sqrt(g_ii g_jj), which do not depend on units.
        """
        try:
            tensor = self.matrix(q)
        except ValueError as outside:
            return str(outside)
        diagonal = np.diag(tensor)
        if not (np.all(np.isfinite(tensor)) and np.all(diagonal > 0.0)):
            return f"the metric is not positive definite at {q}"
        eigenvalues, vectors = np.linalg.eigh(tensor / np.sqrt(np.outer(diagonal, diagonal)))
        if eigenvalues[0] > _NEARLY_SINGULAR:
            return ""
        components = np.abs(vectors[:, 0])
        moved = np.flatnonzero(components > _FRACTION * components.max()).tolist()
        names = " and ".join(self.coordinate_names[k] for k in moved)
        if eigenvalues[0] < -_SINGULAR:
            return (
                f"the metric is indefinite at {q}: some velocities of {names} have negative "
                "squared lengths, which is no singularity but an error of matrix(q), or of the "
                "model's inertias"
            )
        kind = " (kinematic singularity)" if self.joint_names else ""
        return f"the metric is nearly singular at {q}, where {names} are linearly dependent{kind}"

    # -- the geometry --------------------------------------------------------------------------

    def inner(self, q: Any, u: Any, v: Any) -> Any:
        """Return inner product <u, v>_q = u' G(q) v of two tangent vectors (n,) at q."""
        q, u, v = self._checked(q=q, u=u, v=v)
        if is_symbolic(q, u, v):
            return ca.dot(u, self._matrix_function(q) @ v)
        return float(u @ self.matrix(q) @ v)

    def norm(self, q: Any, v: Any) -> Any:
        """Return norm |v|_q = sqrt(<v, v>_q).

        Raises:
            ValueError: the metric is not defined or not positive definite at q.
        """
        squared = self.inner(q, v, v)
        if is_symbolic(squared):
            return ca.sqrt(squared)
        if not squared >= 0.0:
            raise ValueError(f"<v, v> is {squared:.3g} at q = {q}: the metric is indefinite")
        return float(np.sqrt(squared))

    def angle(self, q: Any, u: Any, v: Any) -> Any:
        """Return angle between two tangent vectors (n,) at q, in [0, pi] [rad].

        Computed from the sum and difference of the unit vectors, which is accurate also for small
        angles (Kahan, "How Futile are Mindless Assessments of Roundoff", 2006).

        Raises:
            ValueError: one of the vectors is zero.
        """
        q, u, v = self._checked(q=q, u=u, v=v)
        if is_symbolic(q, u, v):
            unit_u = u / self.norm(q, u)
            unit_v = v / self.norm(q, v)
            return 2 * ca.atan2(self.norm(q, unit_u - unit_v), self.norm(q, unit_u + unit_v))
        tensor = self.matrix(q)

        def norm(w: Array) -> float:
            return float(np.sqrt(max(w @ tensor @ w, 0.0)))

        lengths = norm(u), norm(v)
        if min(lengths) == 0.0:
            raise ValueError("the angle to a zero vector is undefined")
        unit_u = u / lengths[0]
        unit_v = v / lengths[1]
        return float(2.0 * np.arctan2(norm(unit_u - unit_v), norm(unit_u + unit_v)))

    def christoffel(self, q: Any) -> Any:
        """Return Christoffel symbols of the first kind, (n, n, n): entry [i, j, k] is Gamma_ijk.

        For symbolic q, a list of n CasADi matrices, the i-th with entries [j, k].
        """
        (q,) = self._checked(q=q)
        derivative = evaluate(self._matrix_derivative, q)
        if is_symbolic(q):
            columns = ca.horzsplit(derivative)
            slopes: list[Any] = [ca.reshape(column, self.dim, self.dim) for column in columns]
            rows = [ca.horzcat(*(slope[:, i] for slope in slopes)) for i in range(self.dim)]
            return [(row + row.T - slope) / 2 for row, slope in zip(rows, slopes, strict=True)]
        self.matrix(q)  # raises outside the domain, where the derivative may be finite
        slope = np.asarray(derivative).reshape(self.dim, self.dim, self.dim)  # [j, i, k]: G' = G
        return 0.5 * (slope + slope.transpose(0, 2, 1) - slope.transpose(2, 0, 1))

    def acceleration(self, q: Any, v: Any) -> Any:
        """Return acceleration q'' (n,) of the geodesic through q with velocity v (n,).

        sum_j g_ij q''_j + sum_jk Gamma_ijk v_j v_k = 0.
        """
        q, v = self._checked(q=q, v=v)
        if is_symbolic(q, v):
            return self.geodesic_equation(ca.vertcat(q, v))[self.dim :]
        rates = evaluate(self.geodesic_equation, np.concatenate([q, v]))[self.dim :, 0]
        return self._defined(rates, q)


def over_rows(function: Function, many: Callable[..., Mapping[int, Any]] | None = None) -> Function:
    """Let a function of (metric, a, b), each (n,), also take (k, n) for one or both of them.

    The results are stacked along a first axis of length k. An exception names the first row that
    fails; if the function has an argument `throw` and it is False, vectors that are not found are
    NaN, and a warning names their rows. Where the metric has compiled code, which releases Python's
    lock, rows are computed by as many threads as there are processors. Before that, `many`, called
    with k and the arguments, may return the results of some rows.
    """
    signature = inspect.signature(function)
    of_metric, *names = list(signature.parameters)[:3]

    @functools.wraps(function)
    def wrapped(*positional: Any, **named: Any) -> Any:
        throw = named.get("throw", True)
        if (
            throw
            and len(positional) > 2
            and all(getattr(a, "ndim", 0) == 1 for a in positional[1:3])
        ):
            return function(*positional, **named)  # the usual case, without detours
        arguments = signature.bind(*positional, **named).arguments
        try:
            counts = {name: len(arguments[name]) for name in names if np.ndim(arguments[name]) == 2}
        except ValueError:  # ragged rows: the function itself names the argument
            counts = {}
        if not counts:
            return function(**arguments) if throw else _or_nan(function, arguments, names[0])
        count = max(counts.values())
        if len(set(counts.values())) > 1:
            raise ValueError(
                f"{' and '.join(counts)} have {' and '.join(map(str, counts.values()))} rows"
            )
        if count == 0:
            raise ValueError(f"{next(iter(counts))} has no rows")

        threaded = count >= _FEW and has_compiled_code(arguments[of_metric])
        known: Mapping[int, Any] = {}
        if threaded and many is not None:
            known = many(count, **arguments)

        def of_row(row: int) -> Any:
            if row in known:
                return known[row]
            of_this = arguments | {name: arguments[name][row] for name in counts}
            try:
                return _of_row(function, of_this, row)
            except GeodesicOcpError as failure:
                if throw:
                    raise
                failures[row] = str(failure)
                return np.full(np.shape(of_this[names[0]]), np.nan)

        failures: dict[int, str] = {}
        results = list(in_threads(of_row, count) if threaded else map(of_row, range(count)))
        if failures:
            first = min(failures)
            rows = ", ".join(map(str, sorted(failures)[:20])) + ", ..." * (len(failures) > 20)
            warnings.warn(
                f"{function.__name__}: {len(failures)} of {count} rows are nan (rows {rows}); "
                f"{failures[first]}",
                RuntimeWarning,
                stacklevel=2,
            )
        return np.array(results)

    return cast(Function, wrapped)


def _or_nan(function: Callable[..., Any], arguments: dict[str, Any], like: str) -> Any:
    """Return the vector, or NaN with a warning if it is not found."""
    try:
        return function(**arguments)
    except GeodesicOcpError as failure:
        warnings.warn(f"{function.__name__} is nan: {failure}", RuntimeWarning, stacklevel=3)
        return np.full(np.shape(arguments[like]), np.nan)


def _of_row(function: Callable[..., Any], arguments: dict[str, Any], row: int) -> Any:
    try:
        return function(**arguments)
    except (GeodesicOcpError, ValueError) as error:
        error.args = (f"row {row}: {error}",)
        raise


def in_threads(of_row: Callable[[int], Any], count: int) -> Iterator[Any]:
    """Yield results of calls with 0 to count - 1, in order, up to one that raises."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else None
    with ThreadPoolExecutor(usable) as threads:
        yield from threads.map(of_row, range(count))
