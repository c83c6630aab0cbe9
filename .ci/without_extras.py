"""What holds where no extra is installed: all modules load, and what needs an extra names it."""

from __future__ import annotations

import contextlib
import importlib
import importlib.util
import io
import pkgutil
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import numpy as np

import geodesic_ocp as go
from geodesic_ocp.cli.main import main

for package in ("daqp", "distributed", "mujoco", "pink", "playwright", "pyarrow", "yaml"):
    assert importlib.util.find_spec(package) is None, f"{package} is installed"
modules = [each.name for each in pkgutil.walk_packages(go.__path__, f"{go.__name__}.")]
for module in modules:
    importlib.import_module(module)

arm = go.human_arm("right")
limits = go.execution.joint_limits(arm, velocity=4.0, acceleration=20.0, jerk=200.0)
grid = go.Grid(1, 3)
begin = (arm.lower + arm.upper) / 2.0
line = go.Path(go.Euclidean(arm.dof), grid, begin + np.outer(grid.nodes, np.full(arm.dof, 0.1)))
paths = go.execution.ArmPaths(arm, limits, np.array([0.0, 1.0]), [line])
planned = go.execution.plan_trajectory([paths])
trajectory = planned.sampled(100.0)
assert go.execution.check_trajectory(trajectory, arm, limits).passed
poses = arm.hand_pose(trajectory.positions)


def command(*words: str) -> None:
    """Run the command line; its error is one of this program."""
    errors = io.StringIO()
    with contextlib.redirect_stderr(errors):
        code = main(words)
    if code:
        raise ValueError(errors.getvalue())


folder = str(files("geodesic_ocp") / "data")
many = ("analyse", folder, "--side", "left", "--out", "plain")
assert list(Path("plain").glob("*.csv"))  # of `geodesic-ocp analyse`; CSV needs no extra
assert not list(Path("plain").glob("*.parquet"))
Path("recordings.parquet").write_bytes(b"PAR1")

NEEDED: list[tuple[str, Callable[[], object]]] = [
    ("robots", lambda: go.execution.replay(trajectory, arm)),
    ("robots", lambda: go.load_model("menagerie/franka_emika_panda", hand="hand")),
    (
        "robots",
        lambda: go.execution.track_within_limits(arm, begin, trajectory.time, poses, limits),
    ),
    ("show", lambda: go.show(line, arm, file="line.png")),
    ("cluster", lambda: command(*many, "--scheduler", "tcp://127.0.0.1:8786")),
    ("people", lambda: go.study("recordings.parquet")),
]
for extra, use in NEEDED:
    try:
        use()
    except (ImportError, ValueError) as error:
        message = str(error)
    else:
        message = "nothing is missing"
    print(f"without {extra}: {message}")
    assert f"pip install 'geodesic_ocp[{extra}]'" in message
print(f"{len(modules)} modules without an extra")
