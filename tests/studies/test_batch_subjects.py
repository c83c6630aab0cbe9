"""Subjects and trials from names of files and from tables; tidy tables as files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pandas.testing import assert_frame_equal

import geodesic_ocp as go
from geodesic_ocp.studies.sources import SubjectPattern, read_subjects, recording_sources
from geodesic_ocp.studies.study_tables import (
    RECORDINGS,
    Row,
    entry_of_file,
    new_rows,
    peak_speed,
    read_table,
    write_table,
)

NAME = st.from_regex(r"[A-Za-z0-9äß ]+", fullmatch=True)


@pytest.mark.slow
@given(subject=NAME, trial=NAME, folder=NAME)
def test_patterns_find_what_names_were_made_of(subject: str, trial: str, folder: str) -> None:
    for pattern in ("{subject}/{trial}", "{subject}_{trial}", "*/{subject}-reach({trial})"):
        path = pattern.replace("*", folder).format(subject=subject, trial=trial)
        entry, problem = SubjectPattern(pattern).find(f"/data/{path}.c3d")
        assert not problem
        assert (entry.subject, entry.trial) == (subject, trial)


def test_a_path_that_does_not_match_is_told() -> None:
    entry, problem = SubjectPattern("{subject}_{trial}").find("data/reach.csv")
    assert not entry.subject
    assert problem == "its path does not match the pattern '{subject}_{trial}'"


@pytest.mark.parametrize("pattern", ["", "{trial}", "{subject}{subject}", "{subject}/{number}"])
def test_patterns_without_a_subject_are_refused(pattern: str) -> None:
    with pytest.raises(ValueError, match=r"must hold \{subject\} once"):
        SubjectPattern(pattern)


@pytest.mark.parametrize("pattern", ["{subject}{trial}", "{subject}*_{trial}", "x/*{subject}"])
def test_fields_that_cannot_be_told_apart_are_refused(pattern: str) -> None:
    with pytest.raises(ValueError, match="must hold something between two fields"):
        SubjectPattern(pattern)


def test_a_pattern_may_begin_in_the_current_folder() -> None:
    entry, problem = SubjectPattern("./{subject}/{trial}").find("/data/Ann/3.c3d")
    assert (entry.subject, entry.trial, problem) == ("Ann", "3", "")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("file,person\na,b\n", "there is no column subject"),
        ("file,subject\na,\n", "line 2: file and subject must not be empty"),
        ("file,subject,height\na,b,tall\n", "line 2: height: could not convert"),
        ("file,subject,mass\na,b,60\nc,d,-1\n", "line 3: mass: mass must be positive"),
        ("file,subject,height\na,b,1.7\nc,d,170\n", "line 3: height and mass must be at most 3 m"),
        ("file,subject\n\xff,b\n", "is not text in UTF-8"),
        ("file,subject,height\na,b,1,80\n", "line 2: 4 values under 3 columns"),
        ("file,subject\na.c3d,A\nb,B\na.c3d,B\n", "line 2 and line 4 differ about a.c3d"),
        ("file,subject,mass\na,A,60\n./a,A,61\n", "line 2 and line 3 differ about a"),
        ("file;subject\na;b\n", "line 1: separate columns by commas, got 'file;subject'"),
    ],
)
def test_wrong_tables_of_subjects(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "subjects.csv"
    file.write_bytes(text.encode("latin-1"))
    with pytest.raises(go.RecordingError, match=words):
        read_subjects(file)
    with pytest.raises(go.RecordingError, match="cannot be read"):
        read_subjects(tmp_path / "none.csv")


def test_the_longest_path_in_a_table_counts(tmp_path: Path) -> None:
    file = tmp_path / "subjects.csv"
    file.write_text("file,subject\nreach,A\nb/reach.c3d,B\n")
    table = read_subjects(file)
    for name, subject in (("a/reach.c3d", "A"), ("x/b/reach.c3d", "B")):
        entry = entry_of_file(table, name)
        assert entry is not None
        assert entry.subject == subject
    assert entry_of_file(table, "other.c3d") is None


@pytest.mark.parametrize(
    ("rows", "subjects"),
    [
        (["r.c3d,A", "r.xml,B"], {"r.c3d": "A", "r.xml": "B", "r.bvh": ""}),
        (["r,A", "r.xml,B"], {"r.c3d": "A", "r.xml": "B"}),
        (["S/r_1.5,A", "S/r_1.6,B"], {"S/r_1.5.c3d": "A", "S/r_1.6.c3d": "B", "S/r_1.c3d": ""}),
        (["r_1.5.c3d,A", "r_1.6.c3d,B"], {"r_1.5.c3d": "A", "r_1.6.c3d": "B", "r_1.c3d": ""}),
        (["r.c3d,A", "S/r,B"], {"r.c3d": "A", "S/r.c3d": "B"}),
        (["r.c3d,A", "r.c3d,A"], {"r.c3d": "A"}),
    ],
)
def test_a_row_counts_for_the_file_it_names_alone(
    rows: list[str], subjects: dict[str, str], tmp_path: Path
) -> None:
    file = tmp_path / "subjects.csv"
    file.write_text("\n".join(["file,subject", *rows]) + "\n")
    table = read_subjects(file)
    for name, subject in subjects.items():
        entry = entry_of_file(table, f"/data/{name}")
        assert (entry.subject if entry else "") == subject


@pytest.mark.parametrize("named", ["S1/a.csv", "./S1/a", "{}/S1/a.csv"])
def test_a_table_may_give_more_of_the_path_than_the_call(named: str, tmp_path: Path) -> None:
    """The whole path counts, not that within the folder of the call."""
    file, table = tmp_path / "S1" / "a.csv", tmp_path / "subjects.csv"
    file.parent.mkdir()
    file.touch()
    table.write_text(f"file,subject\n{named.format(tmp_path)},Ann\n")
    (source,) = recording_sources(file.parent, ["right"], table=table)
    assert (source.subject, source.subject_from, source.problem) == ("Ann", "table", "")


def test_files_are_named_from_their_common_folder(tmp_path: Path) -> None:
    for name in ("a/x.csv", "b/x.csv", "b/c/y.csv"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    sources = recording_sources(tmp_path, ["right"], recursive=True)
    assert {each.file: each.fallback for each in sources} == {
        "a/x.csv": "a",
        "b/x.csv": "b",
        "b/c/y.csv": "c",
    }
    assert {each.fallback_from for each in sources} == {"folder name"}
    (alone,) = recording_sources(tmp_path / "a" / "x.csv", ["left"])
    assert (alone.name, alone.fallback, alone.trial) == ("x.csv, left", "x", "x")
    assert alone.fallback_from == "file name"


CELLS = {
    "text": st.text(st.characters(exclude_characters="\r\0", exclude_categories=["Cs"])),
    "integer": st.none() | st.integers(0, 2**62),
    "number": st.none() | st.floats(0.0, allow_infinity=False),
}
ROWS = st.lists(
    st.fixed_dictionaries({name: CELLS[kind] for name, kind in RECORDINGS.items()}),
    unique_by=lambda row: (row["recording"], row["method"]),
)


@pytest.mark.slow
@given(rows=ROWS)
@settings(max_examples=max(5, settings().max_examples // 2))
def test_tables_are_read_as_they_were_written(
    tmp_path_factory: pytest.TempPathFactory, rows: list[Row]
) -> None:
    folder = tmp_path_factory.mktemp("tables")
    for file in write_table(folder, "recordings", rows):
        assert_frame_equal(read_table(file, "recordings"), new_rows(rows, "recordings"))


def test_wrong_tables_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="recordings has no column speed"):
        write_table(tmp_path, "recordings", [{"speed": 1.0}])
    with pytest.raises(go.RecordingError, match="there is no such file"):
        read_table(tmp_path / "recordings.csv", "recordings")
    (tmp_path / "failures.csv").write_text("recording,file\n")
    with pytest.raises(go.RecordingError, match="column reason is missing"):
        read_table(tmp_path / "failures.csv", "failures")
    (path, *_) = write_table(tmp_path, "recordings", [{"samples": 3}])
    path.write_text(path.read_text().replace(",3,", ",three,"))
    with pytest.raises(go.RecordingError, match=r"line 2, .*three"):
        read_table(path, "recordings")


@given(
    ends=st.tuples(st.floats(0.0, 3.0), st.floats(0.0, 3.0)),
    length=st.floats(0.1, 2.0),
    duration=st.floats(0.1, 2.0),
)
def test_the_peak_speed_is_the_largest(
    ends: tuple[float, float], length: float, duration: float
) -> None:
    law = go.trajectory.time_law(length, duration, *ends)
    synergy = go.synergies.Synergy(0, 1, 0.0, None, law)  # its path does not matter
    sampled = law(np.linspace(0.0, duration, 2001), 1)
    peak = peak_speed(synergy)
    assert peak >= sampled.max() - 1e-9
    assert peak == pytest.approx(sampled.max(), rel=1e-4, abs=1e-9)
