"""geomstats and pygeodex on the problems that they can take, where an interpreter has them."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

import geodesic_ocp as go
from comparison import our_routes
from comparison.measurement import FOUND, Measurement, Route, compare
from comparison.models import is_installed, planar_chain, random_pairs, robot
from comparison.pinocchio_aba import ForwardDynamics

FRACTION = 0.5
_ABSENT = "no interpreter given by --python has {}"
_FINE = 21  # points on every piece of a path, for its length


def geomstats(interpreters: Sequence[str], count: int) -> list[Measurement] | str:
    """Logs of two uniform rods; a text says why there are none."""
    interpreter = _interpreter(interpreters, "geomstats")
    if interpreter is None:
        return _ABSENT.format("geomstats")
    rods = planar_chain(2)  # of another size and mass: the same geodesics
    dynamics, pairs = ForwardDynamics(rods), random_pairs(rods, FRACTION, count)
    result = _run(interpreter, "geomstats_worker.py", pairs)
    ours = _our_logs(rods, dynamics, pairs)
    errors = [
        dynamics.endpoint_error(q0, np.array(velocity), q1)
        for velocity, (q0, q1) in zip(result["velocities"], pairs, strict=True)
    ]
    found = np.where(np.array(errors) <= FOUND, errors, np.nan)
    seconds, name = np.array(result["seconds"]), f"geomstats log ({result['version']})"
    return [ours, Measurement(name, seconds, found, ours.error, baseline=ours)]


def pygeodex(interpreters: Sequence[str], count: int) -> list[Measurement] | str:
    """Paths of a Panda: times, and how much longer they are than the geodesics of `go.log`."""
    interpreter = _interpreter(interpreters, "geodex")
    if interpreter is None:
        return _ABSENT.format("pygeodex")
    if not is_installed("panda"):
        return "the description of the Panda is not installed (make robots)"
    panda = robot("panda")
    metric, dynamics = go.KineticEnergy(panda), ForwardDynamics(panda)
    pairs, lengths = _within_limits(panda, metric, count)
    result = _run(interpreter, "pygeodex_worker.py", pairs)
    ours = _our_logs(panda, dynamics, pairs)
    rows = [ours]
    for name, records in result["results"].items():
        excess = [
            _length(metric, [*record["path"], q1]) / length - 1.0 if record["solved"] else np.nan
            for record, (_, q1), length in zip(records, pairs, lengths, strict=True)
        ]
        seconds = np.array([record["seconds"] for record in records])
        title = f"{name} ({result['version']})"
        rows.append(Measurement(title, seconds, np.array(excess), "excess length", baseline=ours))
    return rows


def _our_logs(model: go.Model, dynamics: ForwardDynamics, pairs: np.ndarray) -> Measurement:
    def error(velocity: np.ndarray, q0: np.ndarray, q1: np.ndarray) -> float:
        return dynamics.endpoint_error(q0, velocity, q1)

    name, variables = next(iter(our_routes.available().items()))
    route = Route(f"go.log, {name}", our_routes.log(model, variables), error)
    return compare([route], list(pairs), "endpoint error")[0]


def _within_limits(model: go.Model, metric: go.Metric, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Pairs whose geodesic is within the joint limits, as planned paths are, and its length."""
    pairs, lengths = [], []
    for q0, q1 in random_pairs(model, FRACTION, 10 * count):
        try:
            path = go.geodesic(metric, q0, q1)
        except go.NotConverged:
            continue
        q = path(np.linspace(0.0, 1.0, 101))
        if np.all((model.lower <= q) & (q <= model.upper)):
            pairs.append((q0, q1))
            lengths.append(path.length)
        if len(pairs) == count:
            break
    return np.array(pairs), np.array(lengths)


def _length(metric: go.Metric, path: Sequence[Any]) -> float:
    """Length of the straight pieces between the points of a path."""
    points, s, total = np.array(path), (np.arange(_FINE) + 0.5) / _FINE, 0.0
    for start, stop in pairwise(points):
        step = stop - start
        total += sum(metric.norm(start + each * step, step) for each in s) / _FINE
    return total


def _interpreter(interpreters: Sequence[str], module: str) -> str | None:
    """The first interpreter that can import the module."""
    for interpreter in (sys.executable, *interpreters):
        probe = subprocess.run([interpreter, "-c", f"import {module}"], capture_output=True)
        if probe.returncode == 0:
            return interpreter
    return None


def _run(interpreter: str, worker: str, pairs: np.ndarray) -> dict[str, Any]:
    completed = subprocess.run(
        [interpreter, str(Path(__file__).with_name(worker))],
        input=json.dumps(pairs.tolist()),
        text=True,
        stdout=subprocess.PIPE,
        check=True,
    )
    result: dict[str, Any] = json.loads(completed.stdout)
    return result
