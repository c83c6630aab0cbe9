"""Damaged files of every kind that the package writes are read, or refused by name."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from damage import damaged
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from known_problems import PlaneAroundDisc

import geodesic_ocp as go
from geodesic_ocp.cli.kinds import file_kind
from geodesic_ocp.fitting.metric_fit import FORMAT as METRIC
from geodesic_ocp.retargeting.arm_alignment import read_alignment
from geodesic_ocp.studies.analyse_recording import outcome_of
from geodesic_ocp.studies.result_files import equal_motions, read_result, write_result
from geodesic_ocp.studies.sources import RecordingSource
from geodesic_ocp.studies.study_tables import RECORDINGS
from geodesic_ocp.synergies.synergy import read_saved_synergies
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

WRONG = (
    *(float("inf"), 10**400, 10**40, -1, 0.5, None, True),
    *([], [None], {}, {"a": [{}]}, "", "wrong"),
)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A valid file of each kind."""
    folder = tmp_path_factory.mktemp("files")
    time = np.linspace(0.0, 0.3, 7)
    q = np.column_stack([time, time**2])
    motion = go.Motion(time, q, ("a", "b"), np.column_stack([np.ones(7), 2.0 * time]))
    synergies, _ = go.synergies.reconstruct(go.Euclidean(2), motion, [(0, 3), (3, 6)])
    go.synergies.save_synergies(folder / "synergies.json", synergies, ("a", "b"))
    go.solve(PlaneAroundDisc(), grid=go.Grid(2, 4), throw=False).save(folder / "solution.json")
    go.retargeting.Alignment(
        (0.1, -0.2, 0.3), np.eye(3), np.eye(3), 0.7, "right", "bend", None
    ).save(folder / "alignment.json", ["a note"])
    trajectory = JointTrajectory.from_positions(time, q, ("a", "b"))
    trajectory.save(folder / "trajectory.npz")
    trajectory.save(folder / "trajectory.json")
    metric = {
        "metric": "AdjustableKineticEnergy",
        "parameters": [{"name": "payload", "field": "payload", "joints": [], "value": 0.2}],
        "fixed": {"joint_inertia": [0.02] * 7},
        "undetermined": [],
        "rms_errors": [0.1],
    }
    kinds = {"text": "x", "integer": 2, "number": 0.1}
    row = {name: kinds[kind] for name, kind in RECORDINGS.items()}
    result = {
        "own_subject": "Ann",
        "probes": [9, [0.1, 0.2]],
        "recordings": [row | {"cutoff_hz": None}],
        "synergies": [{"synergy": 1, "metric": "m", "length": 0.3}],
        "warnings": ["a warning"],
    }
    write_result(folder / "result.json", result)
    (folder / "metric.json").write_text(json.dumps({"format": METRIC, "version": 1, **metric}))
    return {file.name: file for file in folder.iterdir()}


def read_synergies(file: Path) -> None:
    read_saved_synergies(file)
    go.synergies.load_synergies(file, go.Euclidean(2))


def read_solution(file: Path) -> None:
    go.ocp.load_solution(file)
    go.ocp.load_solution(file, PlaneAroundDisc())


def use_result(file: Path) -> None:
    """A damaged result counts as missing; one that is read can be told of and collected."""
    if (record := read_result(file)) is not None:
        str(outcome_of(RecordingSource(file, file.name, "right"), "key", record))
        assert not equal_motions([("right", *record["probes"])])


READERS: dict[str, Callable[[Path], object]] = {
    "metric.json": lambda file: go.fitting.load_metric(file, go.human_arm()),
    "result.json": use_result,
    "solution.json": read_solution,
    "synergies.json": read_synergies,
    "alignment.json": read_alignment,
    "trajectory.json": go.read_trajectory,
    "trajectory.npz": go.read_trajectory,
}


def places(value: Any) -> Iterator[tuple[Any, ...]]:
    """Keys that lead to every value in a JSON value; of long lists to the first entries."""
    entries = value.items() if isinstance(value, dict) else enumerate(value[:2])
    for key, each in entries:
        yield (key,)
        if isinstance(each, (dict, list)):
            yield from ((key, *rest) for rest in places(each))


def changed(record: Any, place: tuple[Any, ...], wrong: Any) -> str:
    """The JSON text with another value at a place, or, if that is `...`, without it."""
    whole = copy.deepcopy(record)
    parent = whole
    for key in place[:-1]:
        parent = parent[key]
    if wrong is ...:
        del parent[place[-1]]
    else:
        parent[place[-1]] = wrong
    return json.dumps(whole)


def check(name: str, file: Path) -> None:
    """The file is read, or refused by an error that names it."""
    for read in (READERS[name], file_kind):
        try:
            read(file)
        except (ValueError, OSError) as failure:
            assert str(file) in str(failure)  # noqa: PT017


few = settings(
    derandomize=True,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


def test_valid_files_are_read(files: dict[str, Path]) -> None:
    assert files.keys() == READERS.keys()
    for name, file in files.items():
        READERS[name](file)
    assert read_result(files["result.json"]) is not None


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(READERS))
@given(data=st.data())
@few
def test_changed_bytes(
    name: str, files: dict[str, Path], tmp_path: Path, data: st.DataObject
) -> None:
    content = data.draw(damaged(files[name].read_bytes()))
    (tmp_path / name).write_bytes(content)
    check(name, tmp_path / name)


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(name for name in READERS if name.endswith(".json")))
@given(data=st.data())
@few
def test_changed_values(
    name: str, files: dict[str, Path], tmp_path: Path, data: st.DataObject
) -> None:
    record = json.loads(files[name].read_text())
    place = data.draw(st.sampled_from(list(places(record))))
    wrong = data.draw(st.sampled_from([..., *WRONG]))
    (tmp_path / name).write_text(changed(record, place, wrong))
    check(name, tmp_path / name)


@pytest.mark.parametrize(
    ("name", "place", "wrong", "message"),
    [
        (
            "metric.json",
            ("parameters", 0),
            3,
            r"Expected `object`, got `int` - at `\$.parameters\[0\]`",
        ),
        ("metric.json", ("fixed",), [1], r"Expected `object`, got `array` - at `\$.fixed`"),
        (
            "synergies.json",
            ("synergies", 1, "start"),
            "one",
            r"`int`, got `str` - at `\$.synergies\[1\].start`",
        ),
        (
            "synergies.json",
            ("synergies", 0, "law", "knots"),
            [{}],
            r"at `\$.synergies\[0\].law.knots`",
        ),
        (
            "synergies.json",
            ("synergies", 0, "path", "degree"),
            ...,
            "missing required field `degree`",
        ),
        (
            "synergies.json",
            ("synergies", 0, "start_time"),
            float("inf"),
            "number Infinity is not finite",
        ),
        ("solution.json", ("stats", "energy"), None, r"`float`, got `null` - at `\$.stats.energy`"),
        ("trajectory.json", ("points", 0, "positions"), [10**400], "the number 10+ is not finite"),
    ],
)
def test_the_field_is_named(
    name: str,
    place: tuple[Any, ...],
    wrong: Any,
    message: str,
    files: dict[str, Path],
    tmp_path: Path,
) -> None:
    (tmp_path / name).write_text(changed(json.loads(files[name].read_text()), place, wrong))
    with pytest.raises(go.RecordingError, match=rf"{name}: .*{message}"):
        READERS[name](tmp_path / name)
