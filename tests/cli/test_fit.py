"""`geodesic-ocp fit`, and the analysis with what it wrote."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fitting.synthetic import synthetic_recording

import geodesic_ocp as go
from geodesic_ocp.cli import main as cli

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
    files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "fitted"
    assert cli.main(["fit", *map(str, files), "--leave-one-out", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "2 recordings of 2 people" in text
    assert "bootstrap" not in text  # of two there is none
    assert "Ann" in text
    names = {file.name for file in out.iterdir()}
    assert {"metric.json", "figure.png", "table.csv", "by_recording.md", "profile.csv"} <= names
    metric = go.fitting.load_metric(out / "metric.json", go.human_arm("right", 1.65, 60.0))
    # The cuts are found, not given, and the filter rounds the corners of the motion.
    assert metric.joint_inertia[0] == pytest.approx(TRUE, rel=0.5)
    assert cli.main(["analyse", str(files[0]), "--metric", str(out / "metric.json")]) == 0
    assert "joint inertia" in capsys.readouterr().out


@pytest.mark.slow
def test_groups_of_joints_and_wrong_parameters(
    files: list[Path], capsys: pytest.CaptureFixture[str]
) -> None:
    groups = ["--parameter", "armature:?S?_joint", "--parameter", "armature:?E?_joint,?W?_joint"]
    assert cli.main(["fit", str(files[0]), *groups, "--bootstrap", "0"]) == 0
    text = capsys.readouterr().out
    assert "armature:?S?_joint" in text
    assert "kg m^2" in text
    assert cli.main(["fit", str(files[0]), "--parameter", "colour"]) == 2
    assert "--parameter must be one of joint_inertia, armature" in capsys.readouterr().err
    assert cli.main(["fit", str(files[0]), "--parameter", "armature:Knee"]) == 2
    assert "no joint matches 'Knee'" in capsys.readouterr().err
