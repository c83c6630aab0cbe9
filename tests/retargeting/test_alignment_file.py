"""Files of alignments: written, edited, and read again."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.retargeting.arm_alignment import read_alignment


def saved(folder: Path, **changes: Any) -> Path:
    """The file of a human arm's alignment, with some fields changed; None removes one."""
    file = go.retargeting.align(go.human_arm()).save(folder / "arm.json", ["for a test"])
    record = json.loads(file.read_text())
    for name, value in changes.items():
        if value is None:
            del record[name]
        else:
            record[name] = value
    file.write_text(json.dumps(record))
    return file


def test_what_is_read_is_what_was_written(tmp_path: Path) -> None:
    base, hand = Rotation.random(2, random_state=5).as_matrix()
    for side, elbow in (("right", "bend"), (None, None)):
        written = go.retargeting.Alignment(
            (0.1, -0.2, 1 / 3), base, hand, 0.7, side, elbow, "pitch", elbow is None
        )
        read = read_alignment(written.save(tmp_path / "file.json"))
        for name in ("shoulder", "base", "hand"):
            assert_allclose(getattr(read, name), getattr(written, name), atol=1e-12)
        assert (read.length, read.side, read.elbow, read.wrist) == (0.7, side, elbow, "pitch")
        assert read.parallel_gripper is (elbow is None)


def test_axes_are_written_and_read_as_words(tmp_path: Path) -> None:
    file = saved(tmp_path)
    assert json.loads(file.read_text())["base"] == {"right": "+x", "forward": "+y"}
    assert json.loads(file.read_text())["notes"] == ["for a test"]
    file = saved(tmp_path, base={"right": "-y", "forward": [3, 0, 0]})
    assert_allclose(read_alignment(file).base, [[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    # Numbers that an editor rounded.
    file = saved(tmp_path, hand={"right": [0.71, 0.7, 0.0], "fingers": "+z"})
    assert np.linalg.det(np.asarray(read_alignment(file).hand)) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "geodesic_ocp metric"}, "is not a file of an alignment"),
        ({"version": 7}, "has version 7, expected 1"),
        ({"length": None}, "length is missing"),
        ({"length": "long"}, "length must be a number"),
        ({"shoulder": [0, 0]}, "shoulder must have shape"),
        ({"side": "up"}, "side must be"),
        ({"elbow": 4}, "elbow must be the name of a joint"),
        ({"parallel_gripper": "yes"}, "parallel_gripper must be"),
        ({"colour": "red"}, "'colour' is not one of the fields shoulder, base"),
        ({"base": "+x"}, "base must have the entries right and forward"),
        ({"base": {"right": "+w", "forward": "+y"}}, r"base: right must be one of \+x"),
        ({"base": {"right": "+x", "forward": [0, 0, 0]}}, "base: forward must be one of"),
        ({"hand": {"right": "+x", "fingers": "-x"}}, "hand: right and fingers must be at right"),
    ],
)
def test_malformed_files_are_named_with_the_field(
    changes: dict[str, Any], message: str, tmp_path: Path
) -> None:
    file = saved(tmp_path, **changes)
    with pytest.raises(ValueError, match=message) as caught:
        read_alignment(file)
    assert str(file) in str(caught.value)


def test_missing_and_broken_files(tmp_path: Path) -> None:
    with pytest.raises(go.RecordingError, match=r"none\.json: there is no such file"):
        read_alignment(tmp_path / "none.json")
    (tmp_path / "cut.json").write_text('{"format": ')
    with pytest.raises(go.RecordingError, match=r"cut\.json: is not JSON"):
        read_alignment(tmp_path / "cut.json")
