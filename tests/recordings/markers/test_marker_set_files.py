"""Marker sets from files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import geodesic_ocp as go
from geodesic_ocp.recordings.markers.marker_set import as_marker_set
from geodesic_ocp.recordings.recording_settings import RecordingSettings

RECORD = {
    "name": "laboratory",
    "unit": "m",
    "uncertainty": {"dial": 0.02},
    "places": {"dial": ["left forearm", [-0.03, 0.0, -0.22]]},
}


def test_a_file_holds_the_attributes(tmp_path: Path) -> None:
    file = tmp_path / "set.json"
    file.write_text(json.dumps(RECORD))
    place = ("left forearm", (-0.03, 0.0, -0.22))
    expected = go.recordings.MarkerSet("laboratory", {"dial": place}, "m", {"dial": 0.02})
    assert as_marker_set(file) == as_marker_set(str(file)) == expected
    assert as_marker_set(expected) is expected
    assert as_marker_set(None) is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"places": {"dial": ["left forearm", [0.0, 1.0]]}}, "the offset of dial"),
        ({"places": ["dial"]}, "set.json"),
        ({"unit": "inch"}, "unit must be 'height' or 'm'"),
        ({"colour": "red"}, "has the keys name, places"),
        ({"uncertainty": {"band": 0.1}}, "'band' is not a marker of this set"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, changes: dict[str, object], message: str) -> None:
    file = tmp_path / "set.json"
    file.write_text(json.dumps(RECORD | changes))
    with pytest.raises(go.RecordingError, match=message) as failure:
        as_marker_set(file)
    assert str(failure.value).startswith(str(file))


def test_a_file_that_is_no_json_is_named(tmp_path: Path) -> None:
    file = tmp_path / "set.json"
    file.write_text("{")
    with pytest.raises(go.RecordingError, match=r"set\.json: is not a marker set in JSON"):
        as_marker_set(file)


def test_known_sets_are_named() -> None:
    known = as_marker_set("HALPE_26")
    assert known is not None
    assert known.places["RWrist"] == ("right hand", (0.0, 0.0, 0.0))
    assert RecordingSettings(marker_set="HALPE_26").reading()["marker_set"] == "HALPE_26"
    with pytest.raises(ValueError, match="marker_set, which is no file, must be one of BODY_25, "):
        RecordingSettings(marker_set="HALPE")
    with pytest.raises(ValueError, match="marker_set, which is no file, must be one of BODY_25, "):
        as_marker_set("HALPE")


def test_a_number_is_no_marker_set() -> None:
    with pytest.raises(ValueError, match="must be a MarkerSet or a file, got 3"):
        as_marker_set(3)  # type: ignore[arg-type]
