"""The C text of a library: a metric's functions as CasADi generates them, and the core.

The core integrates with the method of order 8 of Dormand and Prince: Hairer, Norsett, Wanner,
*Solving Ordinary Differential Equations I*, 2nd ed., section II.5.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import DOP853

# What a library computes: its entry point, and the files in the order in which they use each other.
CORES = {
    "log_map": (
        "dop853",
        "integrate_many",
        "dense",
        "energy",
        "newton",
        "logarithm",
        "log_map",
        "log_maps",
        "tensor",
        "exp_map",
        "transport",
    ),
    "find_motion": ("dop853", "dense", "motion"),
}


# Functions of which there is also one of vectors, and what makes it of CasADi's text.
IN_LANES = ("geodesic_rate", "energy_gradient", "energy_hessian")
_OF_LANES = (
    ("casadi_real", "lanes"),
    (r"=arg\[\d+\]\? (.*) : 0;", r"=\1;"),
    (r"if \(res\[\d+\]!=0\) ", ""),
    (r"=(-?(?:\d|\.\d|casadi_(?:nan|inf))[\w.+-]*);", r"=zero+\1;"),
    (r"=(-casadi_inf);", r"=zero+\1;"),
    (r"\((a\d+)([<>=!]=|[<>])(a\d+)\)", r"lanes_true(\1\2\3)"),
    (r"\((a\d+)(&|\|)\2(a\d+)\)", r"lanes_true((\1!=0)\2(\3!=0))"),
    (r"\(!(a\d+)\)", r"lanes_true(\1==0)"),
    (r"\((a\d+)\?(a\d+):0\)", r"lanes_where(\1!=0,\2)"),
    (r"\b(?!lanes_)(?:casadi_)?([a-z]\w*)\(", r"lanes_\1("),
)

STAGES: int = DOP853.n_stages
RK_A = np.array(DOP853.A, dtype=float)
RK_B = np.array(DOP853.B, dtype=float)
# Times of the stages within a step; the last is the end of the step.
STAGE_TIMES = np.append(DOP853.C[:STAGES], 1.0)


@lru_cache
def core_text(entry: str = "log_map") -> str:
    """Return the core with this entry point, with the coefficients of its integrator."""
    tables = {"RK_A": RK_A, "RK_B": RK_B, "RK_E5": DOP853.E5, "RK_E3": DOP853.E3}
    return "\n".join([*(_constant(*item) for item in tables.items()), *map(_read, CORES[entry])])


def source_text(functions: Mapping[str, ca.Function], dim: int, entry: str = "log_map") -> str:
    """Get C text of CasADi functions, and of the core that calls them on R^dim, or many times if
    dim is 0.
    """
    generator = ca.CodeGenerator("functions.c", {"with_header": False})
    for name, function in functions.items():
        assert function.name() == name
        assert function.sz_iw() == 0
        generator.add(function)
    generated = generator.dump().replace("#include <math.h>", "")
    parts = [_read("prelude"), generated]
    if not dim:
        parts.append(_read("many"))
    else:
        size = max(function.sz_w() for function in functions.values()) + 1
        if set(IN_LANES) <= functions.keys():
            parts += _in_lanes(generated)
        parts += [f"#define N {dim}\n#define WORK_SIZE {size}\n", core_text(entry)]
    return "\n".join(parts)


def _in_lanes(generated: str) -> list[str]:
    """Return functions of vectors; none where one has an operation that lanes.h lacks."""
    lanes = _read("lanes")
    parts = [lanes, "#ifdef LANES"]
    for name in IN_LANES:
        inner = re.search(rf"int {name}\(.*\{{\s*return (\w+)\(", generated)
        assert inner
        start = generated.index(f"static int {inner[1]}(")
        stop = generated.index("\n}\n", start) + 3
        head, body = generated[start:stop].split("\n", 1)
        for pattern, replacement in _OF_LANES:
            body = re.sub(pattern, replacement, body)
        used = set(re.findall(r"lanes_(\w+)\(", body)) - {"sq", "true", "where"}
        if not used <= set(re.findall(r"(?:EACH_LANE|EACH_LANE_OF_TWO|AT_ONCE)\((\w+)\)", lanes)):
            return []
        head = head.replace(inner[1], f"lanes_{name}").replace("casadi_real", "lanes")
        parts += [head, body]
    return [*parts, "#endif"]


def _read(name: str) -> str:
    return (files("geodesic_ocp") / "compiled" / "core" / f"{name}.h").read_text()


def _constant(name: str, values: ArrayLike) -> str:
    array = np.asarray(values, dtype=float)
    sizes = "".join(f"[{size}]" for size in array.shape)
    braces = str.maketrans("[]", "{}")
    return f"static const double {name}{sizes} = {str(array.tolist()).translate(braces)};"
