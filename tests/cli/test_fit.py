"""`geodesic-ocp fit`, and the analysis with what it wrote."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from commands import Output
from fitting.synthetic import synthetic_recording

import geodesic_ocp as go

TRUE = 0.05  # [m r^2]


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    """Synthetic recordings of two people of different size, with the same relative inertia."""
    rng, written = np.random.default_rng(5), []
    for subject, height, mass in (("Ann", 1.65, 60.0), ("Bob", 1.9, 90.0)):
        arm = go.human_arm("right", height, mass)
        metric = go.manifold.AdjustableKineticEnergy(arm, joint_inertia=TRUE)
        recording, _ = synthetic_recording(metric, arm, rng, count=3, noise=0.001)
        motion = recording.motion
        file = tmp_path / f"{subject}.csv"
        header = [f"# {line}" for line in ("unit: rad", f"height: {height}", f"mass: {mass}")] + [
            f"# subject: {subject}",
            ",".join(["time", *motion.joint_names]),
        ]
        rows = [
            ",".join(map(repr, row)) for row in np.column_stack([motion.time, motion.q]).tolist()
        ]
        file.write_text("\n".join([*header, *rows]) + "\n")
        written.append(file)
    return written


@pytest.mark.slow
def test_fit_writes_a_metric_that_analyse_takes(
    files: list[Path], tmp_path: Path, printed: Output
) -> None:
    out = tmp_path / "fitted"
    text = printed("fit", *map(str, files), "--leave-one-out", "--out", out)
    assert "2 recordings of 2 people" in text
    assert "bootstrap" not in text  # of two there is none
    assert "Ann" in text
    names = {file.name for file in out.iterdir()}
    assert {"metric.json", "figure.png", "table.csv", "by_recording.md", "profile.csv"} <= names
    metric = go.fitting.load_metric(out / "metric.json", go.human_arm("right", 1.65, 60.0))
    # The cuts are found, not given, and the filter rounds the corners of the motion.
    assert metric.joint_inertia[0] == pytest.approx(TRUE, rel=0.5)
    assert "joint inertia" in printed("analyse", files[0], "--metric", out / "metric.json")


@pytest.mark.slow
def test_groups_of_joints_and_wrong_parameters(
    files: list[Path], printed: Output, refused: Output
) -> None:
    groups = ["--parameter", "armature:?S?_joint", "--parameter", "armature:?E?_joint,?W?_joint"]
    text = printed("fit", files[0], *groups, "--bootstrap", "0")
    assert "armature:?S?_joint" in text
    assert "kg m^2" in text
    assert "--parameter must be one of joint_inertia, armature" in refused(
        "fit", files[0], "--parameter", "colour"
    )
    assert "no joint matches 'Knee'" in refused("fit", files[0], "--parameter", "armature:Knee")
