"""Robots by name, where their packages are installed."""

from __future__ import annotations

import warnings

import pytest

import geodesic_ocp as go
from geodesic_ocp.model.formats.robots import ROBOTS, folder

needs_robots = pytest.mark.skipif(
    folder("example-robot-data") is None, reason="needs robots: make robots"
)


def known_robot(name: str) -> go.Model:
    """The robot, whatever is wrong with its file; the test is skipped where it is not installed."""
    package = ROBOTS[name].package if name in ROBOTS else "example-robot-data"
    if folder(package) is None:
        pytest.skip(f"{package} is not installed (make robots)")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return go.load_model(name, hand="arm_7_link" if name == "tiago" else None)
