"""Fixtures that several tests share."""

from __future__ import annotations

import gc
import json
import os
import warnings
from collections.abc import Generator
from pathlib import Path
from typing import Any

import hypothesis
import numpy as np
import pytest
from motion_files import motion_in

import geodesic_ocp as go
from geodesic_ocp.compiled.library import ENVIRONMENT_VARIABLE as COMPILER_VARIABLE
from geodesic_ocp.model.dynamics import (
    BACKENDS,
    ENVIRONMENT_VARIABLE,
    choose_backend,
    why_unavailable,
)

# One numerical example can take tens of milliseconds on a busy machine: no deadline, few examples.
# CI tries more examples of every property.
EXAMPLES = int(os.environ.get("EXAMPLES", "10"))
hypothesis.settings.register_profile(
    "package", deadline=None, max_examples=EXAMPLES, derandomize=True
)
hypothesis.settings.load_profile("package")

# Dozens of metrics are compiled in the tests: quickly, without optimization in the background.
os.environ.setdefault(COMPILER_VARIABLE, "tcc")

ROOT = Path(__file__).resolve().parents[1]


def pytest_configure() -> None:
    """A back end skipped with a warning would fail every test; report it once instead."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        try:
            choose_backend()
        except (RuntimeWarning, ValueError) as reason:
            raise pytest.UsageError(
                f"{reason}; {ENVIRONMENT_VARIABLE}=built-in tests without it"
            ) from None


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Imports and collected tests are not searched for garbage: that took a tenth of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()
        gc.set_threshold(20_000, 20, 20)


def pytest_report_header() -> str:
    return f"back end of the symbolic mass matrix: {choose_backend()}"


@pytest.fixture(scope="session", params=BACKENDS)
def backend(request: pytest.FixtureRequest) -> str:
    """Each of the back ends in turn; all other tests use the default one."""
    if missing := why_unavailable(request.param):
        pytest.skip(f"{request.param} cannot be used here: {missing}")
    return request.param


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of recordings and reference values from outside the project."""
    folder = ROOT.parent / "shared"
    if not (folder / "data").is_dir():
        pytest.skip(f"needs the recordings and reference values beside the project, in {folder}")
    return folder


@pytest.fixture(scope="session")
def known_geodesics(shared: Path) -> dict[str, Any]:
    """Reference geodesics of an independent implementation."""
    return json.loads((shared / "known_geodesics.json").read_text())


@pytest.fixture(scope="session")
def arm() -> go.Model:
    return go.human_arm("right", 1.75, 70.0)


@pytest.fixture(scope="session")
def arm_metric(arm: go.Model) -> go.KineticEnergy:
    return go.KineticEnergy(arm)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20221)


@pytest.fixture(scope="session")
def bundled_file() -> Path:
    """The bundled recording."""
    return ROOT / "src" / "geodesic_ocp" / "data" / "climb.csv"


@pytest.fixture(scope="session")
def bundled_analysis(bundled_file: Path) -> go.synergies.Analysis:
    """The analysis of the bundled recording, with the default settings."""
    return go.analyse(go.human_arm("left", 1.78), motion_in(bundled_file))
