"""The C text of a library: a metric's functions as CasADi generates them, and the core."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.compiled import dop853

# In the order in which they use each other.
_CORE = (
    "dop853",
    "dense",
    "energy",
    "newton",
    "logarithm",
    "log_map",
    "tensor",
    "exp_map",
    "transport",
)


@lru_cache(maxsize=1)
def core_text() -> str:
    """The core, with the coefficients of its integrator."""
    tables = {
        "RK_A": dop853.A,
        "RK_B": dop853.B,
        "RK_E5": dop853.E5,
        "RK_E3": dop853.E3,
    }
    return "\n".join([*(_constant(*item) for item in tables.items()), *map(_read, _CORE)])


def source_text(functions: Mapping[str, ca.Function], dim: int) -> str:
    """C text of CasADi functions on R^dim, and of the core that calls them by these names."""
    generator = ca.CodeGenerator("functions.c", {"with_header": False})
    for name, function in functions.items():
        assert function.name() == name
        assert function.sz_iw() == 0
        generator.add(function)
    generated = generator.dump().replace("#include <math.h>", "")
    size = max(function.sz_w() for function in functions.values()) + 1
    sizes = f"#define N {dim}\n#define WORK_SIZE {size}\n"
    return "\n".join([_read("prelude"), generated, sizes, core_text()])


def _read(name: str) -> str:
    return (files("geodesic_ocp") / "compiled" / "core" / f"{name}.h").read_text()


def _constant(name: str, values: ArrayLike) -> str:
    array = np.asarray(values, dtype=float)
    sizes = "".join(f"[{size}]" for size in array.shape)
    return f"static const double {name}{sizes} = {_initializer(array)};"


def _initializer(array: np.ndarray) -> str:
    if array.ndim == 0:
        return repr(float(array))
    return "{" + ", ".join(map(_initializer, array)) + "}"
