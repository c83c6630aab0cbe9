"""The compiled functions of a metric, and SciPy's integration where nothing is compiled.

The method is that of the compiled core, of order 8 by Dormand and Prince with error estimates of
orders 5 and 3 (DOP853: Hairer, Norsett, Wanner, *Solving Ordinary Differential Equations I*,
2nd ed., section II.5).
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from ctypes import byref, c_double, c_int, c_long, c_void_p
from dataclasses import dataclass
from itertools import pairwise
from threading import local
from typing import Any

import casadi as ca
import numpy as np
from scipy.integrate import DOP853

from geodesic_ocp.arrays import Array
from geodesic_ocp.compiled.library import Library, blas, one_blas_thread
from geodesic_ocp.errors import IntegrationFailed

_SMALLEST_STEP = 1e-13  # relative to the interval
_FINEST = 2.3e-14  # the smallest tolerance that SciPy takes


@dataclass(frozen=True)
class IntegrationEnd:
    """Where an integration stopped early.

    Attributes:
        too_many_steps: whether it stopped at the largest number of steps, or the step at the
            smallest size.
        time: reached.
        step: size of the last step.
        steps: number of steps.
    """

    too_many_steps: bool
    time: float
    step: float
    steps: int


def integration_failure(
    end: IntegrationEnd, times: Array, tolerance: float, state: Array
) -> IntegrationFailed:
    """The exception for an integration over these times that stopped at this state."""
    why = (
        f"{end.steps} steps were not enough, the last of {end.step:.1e}; the motion is too fast or "
        "the tolerance too small"
        if end.too_many_steps
        else f"the step fell to {end.step:.1e}; the metric is singular there, or the tolerance "
        "cannot be reached"
    )
    return IntegrationFailed(
        f"the integration stopped at t = {end.time:.6g} in [{times[0]:.6g}, {times[-1]:.6g}], with "
        f"a tolerance of {tolerance:.1e} per step: {why}",
        end.time,
        state,
    )


class Integrator:
    """Integrates y' = f(y) or y' = f(y, p(t)).

    Args:
        rate: CasADi function y -> y' or (y, p) -> y', where p is a known function of time, such as
            the position and velocity of the curve in parallel transport.
    """

    def __init__(self, rate: ca.Function) -> None:
        self._rate = rate

    def __call__(
        self,
        start: Array,
        times: Array,
        tolerance: float,
        parameters: Callable[[Array], Array] | None = None,
        max_steps: int = 20_000,
    ) -> Array:
        """The solution at the given times, (len(times), len(start)), from y(times[0]) = start.

        The estimated error of every step is at most `tolerance`, absolute for components below one
        and relative above. `parameters` returns p, (size, len(t)), at an array of times t.

        Raises:
            IntegrationFailed: the step became too small, or more than `max_steps` were needed.
        """

        def slope(t: float, y: Array) -> Array:
            p = [] if parameters is None else [parameters(np.array([t]))]
            return np.asarray(self._rate(y, *p).full()[:, 0])

        interval = float(times[-1] - times[0])
        states, taken, size = [np.array(start, dtype=float)], 0, interval / 8.0
        tolerance = max(tolerance, _FINEST)
        for begin, stop in pairwise(times.tolist()):
            first = min(size, stop - begin)
            solver = DOP853(
                slope, begin, states[-1], stop, rtol=tolerance, atol=tolerance, first_step=first
            )
            while solver.status == "running":
                solver.step()
                taken, size = taken + 1, solver.h_abs
                is_short = solver.status == "failed" or size < _SMALLEST_STEP * interval
                if solver.status != "finished" and (is_short or taken >= max_steps):
                    end = IntegrationEnd(not is_short, solver.t, size, taken)
                    raise integration_failure(end, times, tolerance, solver.y)
            states.append(solver.y)
        return np.array(states)


class _IntegrationRecord(ctypes.Structure):
    _fields_ = [("time", c_double), ("step", c_double), ("steps", c_long)]


class Level(ctypes.Structure):
    """The struct `level` of core/energy.h."""

    _fields_ = [
        *((name, c_int) for name in ("segments", "degree", "points")),
        *((name, c_void_p) for name in ("weights", "values", "slopes", "products", "refine")),
        ("decrease", c_double),
        ("max_steps", c_long),
    ]


class Tolerances(ctypes.Structure):
    """The struct `tolerances` of core/logarithm.h."""

    _fields_ = [(name, c_double) for name in ("step", "wanted", "accepted")]


class Statistics(ctypes.Structure):
    """The struct `statistics` of core/newton.h."""

    _fields_ = [
        *((name, c_long) for name in ("newton_steps", "integrations", "steps", "level")),
        *((name, c_double) for name in ("energy", "first_error", "error")),
    ]


class Kernels:
    """Compiled functions of one metric on R^n. Calls release Python's lock."""

    def __init__(self, library: Library, dim: int) -> None:
        self._library, self._dim = library, dim
        self._local = local()

    def available(self, at_once: bool = True) -> bool:
        """Whether there is a compiled library.

        Args:
            at_once: compile if none is stored; otherwise only after some use of the interpreted
                functions (`interpreted`).
        """
        return self._library.handle(at_once) is not None

    @property
    def loaded(self) -> bool:
        """Whether the compiled library is in use."""
        return self._library.compiler is not None

    def interpreted(self, seconds: float) -> None:
        """Report for how long the interpreted functions have been used instead."""
        self._library.used(seconds)

    @property
    def compiler_name(self) -> str:
        """Name of the compiler whose code is used; empty if there is none."""
        compiler = self._library.compiler
        return "" if compiler is None else compiler.name

    @property
    def file(self) -> str:
        """Path of the compiled library, which also has CasADi's functions; empty if none."""
        handle = self._library.handle(True)
        return "" if handle is None else handle._name

    def _call(self, name: str, *arguments: Any) -> Any:
        handle = self._library.handle(True)
        assert handle is not None
        start = time.perf_counter()
        result = getattr(handle, name)(*arguments)
        self._library.used(time.perf_counter() - start)
        return result

    def _memory(self, size: int) -> Array:
        """A work vector of this thread."""
        memory: Array | None = getattr(self._local, "memory", None)
        if memory is None or memory.size < size:
            memory = self._local.memory = np.empty(size)
        return memory

    def integrate(self, start: Array, times: Array, tolerance: float, max_steps: int) -> Array:
        """States (len(times), 2 n) of the geodesic equation, like `Integrator`."""
        states = np.empty((times.size, start.size))
        record = _IntegrationRecord(0.0, 0.0, 0)
        status = self._call(
            "integrate_geodesic",
            _pointer(start),
            c_int(times.size),
            _pointer(times),
            c_double(tolerance),
            c_long(max_steps),
            _pointer(states),
            byref(record),
        )
        if status:
            end = IntegrationEnd(status == 1, record.time, record.step, record.steps)
            raise integration_failure(end, times, tolerance, states[0])
        return states

    def matrix(self, q: Array) -> Array:
        """The metric tensor (n, n) at q (n,)."""
        tensor = np.empty((self._dim, self._dim))
        self._call("tensor_at", _pointer(q), _pointer(tensor))
        return tensor

    def is_regular(self, q: Array) -> bool:
        """Whether G(q) is certainly finite, symmetric and positive definite."""
        return bool(self._call("is_regular", _pointer(q)))

    def exp(self, q: Array, v: Array, step_tolerance: float, tolerance: float) -> Array | None:
        """Exp_q(v); None where it needs a closer look, see core/exp_map.h."""
        state = np.empty(2 * self._dim)
        doubtful = self._call(
            "exp_map",
            _pointer(q),
            _pointer(v),
            c_double(step_tolerance),
            c_double(tolerance),
            _pointer(state),
        )
        return None if doubtful else state[: self._dim]

    def speeds(self, q: Array, velocity: Array) -> Array:
        """Speeds (k,) of velocities (k, n) at positions (k, n)."""
        result = np.empty(len(q))
        rows = [np.ascontiguousarray(each, dtype=float) for each in (q, velocity)]
        self._call("speeds_at", c_long(len(q)), *map(_pointer, rows), _pointer(result))
        return result

    def transport(
        self, sizes: Array, curve: Array, vector: Array, tolerance: float
    ) -> tuple[Array, Array]:
        """Transport w (n,) by steps of the given sizes (k,) along curve (k, 13, 2 n).

        Returns w after every step (k, n) and the errors of the steps relative to the tolerance.
        """
        states, errors = np.empty((sizes.size, vector.size)), np.empty(sizes.size)
        self._call(
            "transport",
            c_long(sizes.size),
            _pointer(sizes),
            _pointer(curve),
            _pointer(vector),
            c_double(tolerance),
            _pointer(states),
            _pointer(errors),
        )
        return states, errors

    def transport_matrices(self, curve: Array) -> Array:
        """A (k, n, n) of parallel transport, w' = A w, along positions and velocities (k, 2 n)."""
        result = np.empty((len(curve), self._dim, self._dim))
        rows = np.ascontiguousarray(curve)
        self._call("transport_matrices", c_long(len(curve)), _pointer(rows), _pointer(result))
        return np.ascontiguousarray(result.swapaxes(1, 2))  # CasADi has columns first

    def log_map(
        self,
        q0: Array,
        q1: Array,
        path: Array,
        levels: ctypes.Array[Level],
        first: int,
        largest: int,
        added: Array,
        tolerances: Tolerances,
    ) -> tuple[Array, Array, int, Statistics]:
        """Minimize the discrete energy from coarse to fine levels, and correct by integration.

        Args:
            q0, q1: the ends (n,).
            path: (k, n), nodes on the first level.
            levels: their tables.
            first: the level from which on results are corrected.
            largest: largest number of nodes of a level.
            added: (m, n), diagonals added to G for a continuation on the first level.
            tolerances: of the result.

        Returns:
            Initial velocity, nodes on the last level used, status and statistics.
        """
        n = self._dim
        handle = self._library.handle(True)
        assert handle is not None
        nodes, velocity = np.empty((largest, n)), np.empty(n)
        nodes[: len(path)] = path
        handle.log_workspace.restype = c_long
        memory = self._memory(handle.log_workspace(levels, c_int(len(levels))))
        statistics = Statistics()
        with one_blas_thread:
            status = self._call(
                "log_map",
                _pointer(q0),
                _pointer(q1),
                levels,
                c_int(len(levels)),
                c_int(first),
                _pointer(added),
                c_int(len(added)),
                byref(tolerances),
                byref(blas()),
                _pointer(nodes),
                _pointer(memory),
                _pointer(velocity),
                byref(statistics),
            )
        last = levels[statistics.level]
        return velocity, nodes[: last.segments * last.degree + 1], status, statistics


def _pointer(array: Array) -> c_void_p:
    assert array.flags.c_contiguous
    assert array.dtype == np.float64
    return c_void_p(array.ctypes.data)
