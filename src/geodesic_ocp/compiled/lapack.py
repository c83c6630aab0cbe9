"""SciPy's LAPACK and BLAS: pointers for compiled code, and their threads."""

from __future__ import annotations

import ctypes
import threading
from functools import lru_cache
from typing import Any


class Blas(ctypes.Structure):
    """The struct `blas` of core/dense.h."""

    _fields_ = [(name, ctypes.c_void_p) for name in ("potrf", "trsv", "gemm")]


@lru_cache(maxsize=1)
def blas() -> Blas:
    """dpotrf, dtrsv and dgemm as SciPy exports them for Cython."""
    from scipy.linalg import cython_blas, cython_lapack

    return Blas(
        _pointer(cython_lapack, "dpotrf"),
        _pointer(cython_blas, "dtrsv"),
        _pointer(cython_blas, "dgemm"),
    )


def _pointer(module: Any, name: str) -> int | None:
    capsule = module.__pyx_capi__[name]
    get_name = ctypes.pythonapi.PyCapsule_GetName
    get_name.restype, get_name.argtypes = ctypes.c_char_p, [ctypes.py_object]
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
        self._lock, self._users, self._before = threading.Lock(), 0, 0

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
