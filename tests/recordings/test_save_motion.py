"""Motions that are saved are read again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import geodesic_ocp as go


def test_a_saved_motion_is_read_unchanged(tmp_path: Path, bundled_file: Path) -> None:
    motion = go.read_motion(bundled_file)
    again = go.read_motion(go.trajectory.save_motion(tmp_path / "again.csv", motion))
    assert np.array_equal(again.time, motion.time)
    assert np.array_equal(again.q, motion.q)
    assert (again.joint_names, again.subject) == (motion.joint_names, motion.subject)


def test_names_are_kept_on_one_line(tmp_path: Path) -> None:
    person = go.trajectory.Subject(name="Ann\n# unit: deg")
    motion = go.Motion([0.0, 1.0], [[0.5], [1.0]], ('elbow, "left"',), subject=person)
    again = go.read_motion(go.trajectory.save_motion(tmp_path / "ann.csv", motion))
    assert again.joint_names == motion.joint_names
    assert again.subject.name == "Ann # unit: deg"
    assert again.q[:, 0] == pytest.approx([0.5, 1.0])


def test_doubts_are_kept(tmp_path: Path) -> None:
    doubts = ("RFIN is lost\nfor 100%", "the height would be 2.1 m")
    motion = go.Motion([0.0, 1.0], [[0.5], [1.0]], ("elbow",), doubts=doubts)
    again = go.read_motion(go.trajectory.save_motion(tmp_path / "motion.csv", motion))
    assert again.doubts == ("RFIN is lost for 100%", "the height would be 2.1 m")


def test_another_suffix_is_refused(tmp_path: Path) -> None:
    motion = go.Motion([0.0, 1.0], [[0.5], [1.0]], ("elbow",))
    with pytest.raises(ValueError, match=r"must end in \.csv, got 'motion\.xml'"):
        go.trajectory.save_motion(tmp_path / "motion.xml", motion)
