"""The compiled functions of a metric, and SciPy's integration where nothing is compiled.

The method is that of the compiled core, of order 8 by Dormand and Prince with error estimates of
orders 5 and 3 (DOP853: Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*,
2nd ed., section II.5). The core calls SciPy's BLAS and LAPACK, in one thread.
"""

from __future__ import annotations

import ctypes
import threading
import time
from collections.abc import Callable
from ctypes import byref, c_double, c_int, c_long, c_void_p
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853

from geodesic_ocp.arrays import Array
from geodesic_ocp.compiled.library import Library
from geodesic_ocp.errors import IntegrationFailed

_SMALLEST_STEP = 1e-13  # relative to the interval
_FINEST = 2.3e-14  # the smallest tolerance that SciPy takes


class _IntegrationRecord(ctypes.Structure):
    _fields_ = [("time", c_double), ("step", c_double), ("steps", c_long)]


def _failure(
    too_many: bool, record: _IntegrationRecord, times: Array, tolerance: float, y: Array
) -> IntegrationFailed:
    """Return the exception for an integration over `times` that stopped early, at state y.

    Either there were too many steps, or the last step was too small.
    """
    why = (
        f"{record.steps} steps were not enough, the last of {record.step:.1e}; the motion is too "
        "fast or the tolerance too small"
        if too_many
        else f"the step fell to {record.step:.1e}; the metric is singular there, or the tolerance "
        "cannot be reached"
    )
    return IntegrationFailed(
        f"the integration stopped at t = {record.time:.6g} in [{times[0]:.6g}, {times[-1]:.6g}], "
        f"with a tolerance of {tolerance:.1e} per step: {why}",
        record.time,
        y,
    )


def integrate_by_scipy(
    rate: ca.Function,
    start: Array,
    times: Array,
    tolerance: float,
    parameters: Callable[[float], Array] | None = None,
    max_steps: int = 20_000,
) -> Array:
    """Return the solution of y' = f(y) or y' = f(y, p(t)) from y(times[0]) = start.

    The estimated error of every step is at most `tolerance`, absolute for components below one and
    relative above.

    Args:
        rate: y -> y' or (y, p) -> y', where p is a known function of time, such as the position and
            velocity of the curve in parallel transport.
        start: (n,).
        times: increasing (k,).
        tolerance: tolerance of a step.
        parameters: p at a time.
        max_steps: largest number of steps.

    Returns:
        States at the times, (k, n).

    Raises:
        IntegrationFailed: the step became too small, or more than `max_steps` were needed.
    """

    def slope(t: float, y: Array) -> Array:
        p = [] if parameters is None else [parameters(t)]
        return np.asarray(rate(y, *p).full()[:, 0])

    interval = float(times[-1] - times[0])
    states = [np.array(start, dtype=float)]
    taken = 0
    size = interval / 8.0
    error = max(tolerance, _FINEST)
    for begin, stop in pairwise(times.tolist()):
        first = min(size, stop - begin)
        solver = DOP853(slope, begin, states[-1], stop, rtol=error, atol=error, first_step=first)
        while solver.status == "running":
            solver.step()
            taken = taken + 1
            size = solver.h_abs
            is_short = solver.status == "failed" or size < _SMALLEST_STEP * interval
            if solver.status != "finished" and (is_short or taken >= max_steps):
                record = _IntegrationRecord(solver.t, size, taken)
                raise _failure(not is_short, record, times, error, solver.y)
        states.append(solver.y)
    return np.array(states)


class Level(ctypes.Structure):
    """The struct `level` of core/energy.h."""

    _fields_ = [
        *((name, c_int) for name in ("segments", "degree", "points")),
        *((name, c_void_p) for name in ("weights", "values", "slopes", "products", "refine")),
        ("decrease", c_double),
        ("max_steps", c_long),
    ]


class LogMaps(NamedTuple):
    """Initial velocities (k, n) of geodesics, NaN where none was found, and whether a start was
    given up (k,), as it led to the geodesic of another start or to a longer one.
    """

    velocities: Array
    given_up: NDArray[np.bool_]


class Tolerances(ctypes.Structure):
    """The struct `tolerances` of core/logarithm.h."""

    _fields_ = [(name, c_double) for name in ("step", "wanted", "accepted")]


class Statistics(ctypes.Structure):
    """The struct `statistics` of core/newton.h."""

    _fields_ = [
        *((name, c_long) for name in ("newton_steps", "integrations", "steps", "level")),
        *((name, c_double) for name in ("energy", "first_error", "error")),
    ]


class Blas(ctypes.Structure):
    """The struct `blas` of core/dense.h."""

    _fields_ = [(name, ctypes.c_void_p) for name in ("potrf", "trsv", "gemm", "pbtrf", "pbtrs")]


@lru_cache(maxsize=1)
def blas() -> Blas:
    """Return LAPACK's and BLAS' functions as SciPy exports them for Cython."""
    from scipy.linalg import cython_blas, cython_lapack

    def pointer(name: str) -> int | None:
        return _pointer(cython_lapack if name.startswith("p") else cython_blas, f"d{name}")

    return Blas(*(pointer(field[0]) for field in Blas._fields_))


def _pointer(module: Any, name: str) -> int | None:
    capsule = module.__pyx_capi__[name]
    get_name = ctypes.pythonapi.PyCapsule_GetName
    get_name.restype = ctypes.c_char_p
    get_name.argtypes = [ctypes.py_object]
    get_pointer = ctypes.pythonapi.PyCapsule_GetPointer
    get_pointer.restype = ctypes.c_void_p
    get_pointer.argtypes = [ctypes.py_object, ctypes.c_char_p]
    pointer: int | None = get_pointer(capsule, get_name(capsule))
    return pointer


class _OneThread:
    """Keeps SciPy's OpenBLAS from starting threads, which cost more than matrices of this size.

    A context manager that may be entered by several threads at once; the last one to leave restores
    the number of threads. Without OpenBLAS it does nothing.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._users = 0
        self._before = 0

    def __enter__(self) -> None:
        with self._lock:
            if self._users == 0 and (library := _openblas()) is not None:
                self._before = library.scipy_openblas_get_num_threads()
                library.scipy_openblas_set_num_threads(1)
            self._users += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._users -= 1
            if self._users == 0 and (library := _openblas()) is not None:
                library.scipy_openblas_set_num_threads(self._before)


one_blas_thread = _OneThread()


@lru_cache(maxsize=1)
def _openblas() -> ctypes.CDLL | None:
    from scipy.linalg import cython_blas

    library = ctypes.CDLL(cython_blas.__file__)
    return library if hasattr(library, "scipy_openblas_set_num_threads") else None


class Kernels(Library):
    """Compiled functions of one metric on R^n. Calls release Python's lock."""

    _scratch = threading.local()  # work vectors of threads

    def _call(self, name: str, *arguments: Any) -> Any:
        handle = self.handle(True)
        assert handle is not None
        values = [_c_value(each) for each in arguments]
        start = time.perf_counter()
        result = getattr(handle, name)(*values)
        self.used(time.perf_counter() - start)
        return result

    def _memory(self, size: int) -> Array:
        """Return a work vector of this thread."""
        memory: Array = getattr(self._scratch, "memory", np.empty(0))
        if memory.size < size:
            memory = self._scratch.memory = np.empty(size)
        return memory

    def integrate(self, start: Array, times: Array, tolerance: float, max_steps: int) -> Array:
        """Return states (len(times), 2 n) of the geodesic equation, like `integrate_by_scipy`."""
        return self._integrate("integrate_geodesic", (start,), times, tolerance, max_steps)

    def _integrate(
        self,
        equation: str,
        given: tuple[Array] | tuple[Array, float],
        times: Array,
        tolerance: float,
        max_steps: int,
    ) -> Array:
        """Integrate from the given state, with the given parameter if there is one."""
        states = np.empty((times.size, given[0].size))
        record = _IntegrationRecord()
        arguments = c_int(times.size), times, tolerance, c_long(max_steps), states
        status = self._call(equation, *given, *arguments, byref(record))
        if status:
            raise _failure(status == 1, record, times, tolerance, states[0])
        return states

    def matrix(self, q: Array) -> Array:
        """Return the metric tensor (n, n) at q (n,)."""
        tensor = np.empty((self._dim, self._dim))
        self._call("tensor_at", q, tensor)
        return tensor

    def is_regular(self, q: Array) -> bool:
        """Return whether G(q) is certainly finite, symmetric and positive definite."""
        return bool(self._call("is_regular", q))

    def exp(self, q: Array, v: Array, step_tolerance: float, tolerance: float) -> Array | None:
        """Return Exp_q(v); None where it needs a closer look, see core/exp_map.h."""
        state = np.empty(2 * self._dim)
        doubtful = self._call("exp_map", q, v, step_tolerance, tolerance, state)
        return None if doubtful else state[: self._dim]

    def speeds(self, q: Array, velocity: Array) -> Array:
        """Return speeds (k,) of velocities (k, n) at positions (k, n)."""
        result = np.empty(len(q))
        rows = [np.ascontiguousarray(each, dtype=float) for each in (q, velocity)]
        self._call("speeds_at", c_long(len(q)), *rows, result)
        return result

    def transport(
        self, sizes: Array, curve: Array, vector: Array, tolerance: float
    ) -> tuple[Array, Array]:
        """Transport w (n,) by steps of the given sizes (k,) along curve (k, 13, 2 n).

        Returns w after every step (k, n) and the errors of the steps relative to the tolerance.
        """
        states = np.empty((sizes.size, vector.size))
        errors = np.empty(sizes.size)
        steps = c_long(sizes.size), sizes, curve
        self._call("transport", *steps, vector, tolerance, states, errors)
        return states, errors

    def transport_matrices(self, curve: Array) -> Array:
        """Return a (k, n, n) of parallel transport, w' = A w, along positions and velocities (k, 2
        n).
        """
        result = np.empty((len(curve), self._dim, self._dim))
        rows = np.ascontiguousarray(curve)
        self._call("transport_matrices", c_long(len(curve)), rows, result)
        return np.ascontiguousarray(result.swapaxes(1, 2))  # CasADi has columns first

    def log_map(
        self,
        q0: Array,
        q1: Array,
        path: Array,
        levels: ctypes.Array[Level],
        first: int,
        tolerances: Tolerances,
        added: Array | None = None,
    ) -> tuple[Array, Array, int, Statistics]:
        """Minimize the discrete energy from coarse to fine levels, and correct by integration.

        Args:
            q0, q1: the ends (n,).
            path: (k, n), nodes on the first level.
            levels: their tables.
            first: the level from which on results are corrected.
            tolerances: tolerances of the result.
            added: (m, n), diagonals added to G for a continuation on the first level, if any.

        Returns:
            Initial velocity, nodes on the last level used, status and statistics.
        """
        handle = self.handle(True)
        assert handle is not None
        sizes = [level.segments * level.degree + 1 for level in levels]
        nodes = np.empty((max(sizes), self._dim))
        velocity = np.empty(self._dim)
        nodes[: len(path)] = path
        added = np.zeros((0, self._dim)) if added is None else np.ascontiguousarray(added)
        handle.log_workspace.restype = c_long
        memory = self._memory(handle.log_workspace(levels, c_int(len(levels))))
        statistics = Statistics()
        numbers = c_int(len(levels)), c_int(first)
        continued = added, c_int(len(added))
        given = byref(tolerances), byref(blas())
        results = nodes, memory, velocity, byref(statistics)
        with one_blas_thread:
            status = self._call("log_map", q0, q1, levels, *numbers, *continued, *given, *results)
        return velocity, nodes[: sizes[statistics.level]], status, statistics

    def log_maps(
        self,
        q0: Array,
        q1: Array,
        paths: Array,
        levels: ctypes.Array[Level],
        first: int,
        tolerances: Tolerances,
        wanted: Array,
        are_starts: bool,
    ) -> LogMaps | None:
        """Return results of `log_map` for k pairs at once; None where the library cannot.

        Args:
            q0, q1: the ends (k, n).
            paths: (k, nodes, n), nodes on the first level.
            levels, first, tolerances: see `log_map`.
            wanted: errors (k,) at which corrections end, in place of the tolerances' one.
            are_starts: all are paths between the same two points, of which the shortest geodesic is
                sought: paths that do not lead to it are given up.
        """
        handle = self.handle(True)
        if handle is None or not hasattr(
            handle, "log_maps"
        ):  # not from a compiler that has vectors of numbers
            return None
        count = len(q0)
        nodes = max(level.segments * level.degree + 1 for level in levels)
        x = np.empty((count, nodes, self._dim))
        x[:, : paths.shape[1]] = paths
        velocities = np.empty((count, self._dim))
        status = np.empty(count, dtype=np.intc)
        handle.log_maps_workspace.restype = c_long
        numbers = c_int(len(levels)), c_int(first)
        memory = self._memory(handle.log_maps_workspace(levels, numbers[0], c_long(count)))
        given = byref(tolerances), wanted, c_int(are_starts), byref(blas())
        results = x, c_long(x[0].size), memory, velocities, c_void_p(status.ctypes.data)
        with one_blas_thread:
            self._call("log_maps", c_long(count), q0, q1, levels, *numbers, *given, *results)
        velocities[status != 0] = np.nan
        return LogMaps(velocities, status == 30)  # NEEDLESS of core/log_maps.h


def _c_value(argument: Any) -> Any:
    """Return arrays as pointers and floats as doubles; what is of a type of C already, as it is."""
    if isinstance(argument, np.ndarray):
        assert argument.flags.c_contiguous
        assert argument.dtype == np.float64
        return c_void_p(argument.ctypes.data)
    return c_double(argument) if isinstance(argument, float) else argument
