"""The two readers of MJCF."""

from __future__ import annotations

import sys

import pytest


@pytest.fixture
def without_mujoco(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if mujoco were not installed: Pinocchio reads MJCF."""
    monkeypatch.setitem(sys.modules, "mujoco", None)


@pytest.fixture(params=["MuJoCo", "Pinocchio"])
def reader(request: pytest.FixtureRequest) -> str:
    """Each of the readers of MJCF in turn."""
    if request.param == "MuJoCo":
        pytest.importorskip("mujoco")
    else:
        request.getfixturevalue("without_mujoco")
    return request.param
