"""The compiled functions of a metric, called with NumPy arrays."""

from __future__ import annotations

import ctypes
import time
from ctypes import byref, c_double, c_int, c_long, c_void_p
from threading import local
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.compiled.lapack import blas, one_blas_thread
from geodesic_ocp.compiled.library import Library
from geodesic_ocp.manifold.integrator import IntegrationEnd, integration_failure


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
