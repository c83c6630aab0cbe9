"""Reading the tables of a study: what is wrong in a file is said with its line."""

from __future__ import annotations

from pathlib import Path

import pytest
from damage import damaged
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pandas.testing import assert_frame_equal
from studies.study_rows import drawn, rows_of, study_of_rows, written

import geodesic_ocp as go
from geodesic_ocp.studies.study import study, with_metadata
from geodesic_ocp.studies.study_tables import new_rows, write_table

HEADER = "recording,subject,method,duration_s,joint_error_rad,position_error_m\n"
LINE = "a,Ann,riemannian,1.0,0.1,0.2\n"


def test_a_folder_its_files_and_its_rows_give_the_same(tmp_path: Path) -> None:
    recordings, synergies = drawn(0, 2, 1)
    written(tmp_path, recordings, synergies)
    expected = study_of_rows(recordings, synergies)
    files = [tmp_path / "synergies.csv", tmp_path / "recordings.csv"]
    for source in (tmp_path, str(tmp_path), files):
        found = study(source)
        assert_frame_equal(found.means(), expected.means())
        assert_frame_equal(found.synergy_statistics(), expected.synergy_statistics())
    alone = study(tmp_path / "recordings.csv")
    assert_frame_equal(alone.means(), expected.means())
    assert "There is no table of synergies." in alone.notes
    with pytest.raises(ValueError, match="no table of synergies"):
        alone.synergy_statistics()


@pytest.mark.slow
def test_parquet_is_read_where_only_that_is_there(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    recordings, synergies = drawn(0, 3, 2)
    written(tmp_path, recordings, synergies)
    expected = study(tmp_path)
    for name in ("recordings", "synergies"):
        (tmp_path / f"{name}.csv").unlink()
    found = study(tmp_path)
    assert_frame_equal(found.means(), expected.means())
    assert_frame_equal(found.synergy_statistics(), expected.synergy_statistics())
    (tmp_path / "recordings.parquet").write_bytes(b"PAR1 and nothing else")
    with pytest.raises(go.RecordingError, match=r"recordings\.parquet: cannot be read as Parquet"):
        study(tmp_path)


@pytest.mark.slow
@given(st.integers(0, 100_000), st.integers(0, 255), st.integers(0, 100))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_parquet_is_refused_or_read(
    tmp_path: Path, place: int, value: int, missing: int
) -> None:
    """Also where text that is not UTF-8 hides in a file whose structure is right."""
    pytest.importorskip("pyarrow")
    whole = tmp_path / "whole"
    if not whole.is_dir():
        whole.mkdir()
        written(whole, drawn(0, 2, 1)[0])
    data = (whole / "recordings.parquet").read_bytes()
    place %= len(data)
    damaged = data[:place] + bytes([value]) + data[place + 1 + (missing % 3) * missing :]
    (tmp_path / "recordings.parquet").write_bytes(damaged)
    try:
        study(tmp_path).means()
    except go.RecordingError as error:
        reason = str(error)
    else:
        reason = "recordings"
    assert "recordings" in reason


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "line 1: is empty"),
        ("a,b\n1,2\n", "line 1: column recording, subject, method"),
        (HEADER, "has no recordings"),
        (HEADER + LINE + "b,Bob,riemannian,1.0\n", "line 3: 4 values under 6 columns"),
        (HEADER + LINE.replace("0.1", "0,1"), "line 2: 7 values under 6 columns"),
        (HEADER + LINE.replace("0.1", "much"), "line 2, column joint_error_rad: 'much' is not a n"),
        (HEADER + LINE.replace("0.1", "-0.1"), "line 2, column joint_error_rad: -0.1 is negative"),
        (HEADER + LINE.replace("0.1", "inf"), "line 2, column joint_error_rad: inf is not finite"),
        (HEADER + LINE + LINE, "line 3: a, riemannian is there already, in line 2"),
        (HEADER + LINE.replace("Ann", '"Ann'), "line 2: is not CSV"),
        (HEADER.replace("subject", "method") + LINE, "column method is there twice"),
    ],
)
def test_what_is_wrong_in_a_table_is_said_with_its_line(
    tmp_path: Path, text: str, message: str
) -> None:
    file = tmp_path / "recordings.csv"
    file.write_text(text)
    with pytest.raises(go.RecordingError, match=message) as raised:
        study(tmp_path)
    assert str(file) in str(raised.value)


def test_wrong_folders_and_files(tmp_path: Path) -> None:
    with pytest.raises(go.RecordingError, match=r"has no recordings\.csv or recordings\.parquet"):
        study(tmp_path)
    with pytest.raises(go.RecordingError, match="there is no such folder or table"):
        study(tmp_path / "missing")
    (tmp_path / "recordings.csv").write_bytes(b"recording,subject\n\xff\xfe\x00\n")
    with pytest.raises(go.RecordingError, match="is not text in UTF-8"):
        study(tmp_path)
    with pytest.raises(ValueError, match="must begin with one of recordings, synergies"):
        study([tmp_path / "recordings.csv", tmp_path / "other.csv"])
    for source in (3, [], [1, 2]):
        with pytest.raises(ValueError, match="source must be a folder, paths of tables, or anal"):
            study(source)  # type: ignore[arg-type]


def test_a_table_that_was_cut_off_between_two_lines_is_noticed(tmp_path: Path) -> None:
    recordings, synergies = drawn(0, 2, 1)
    written(tmp_path, recordings, synergies[:-1])
    with pytest.raises(go.RecordingError, match="S2_0 has 1 synergies, but 2 in the table of rec"):
        study(tmp_path)
    written(tmp_path, recordings[:3], synergies)
    with pytest.raises(go.RecordingError, match="S2_0 is not in the table of recordings"):
        study(tmp_path)


def test_recordings_that_were_cut_by_different_metrics_are_not_averaged(tmp_path: Path) -> None:
    rows = [
        *rows_of("a", "Ann", {"riemannian": 1.0}, metric="one"),
        *rows_of("b", "Bob", {"riemannian": 1.0}, metric="two", method_label="straight lines"),
    ]
    write_table(tmp_path, "recordings", rows)
    with pytest.raises(go.RecordingError, match="cut by metrics that differ cannot be averaged"):
        study(tmp_path)
    assert len(study(tmp_path, by="metric").means("joint")) == 2


@pytest.mark.parametrize("other", ["online", None])  # tables of other origin may not say
def test_recordings_that_were_cut_by_different_rules_are_not_averaged(
    tmp_path: Path, other: str | None
) -> None:
    first = rows_of("a", "Ann", {"riemannian": 1.0}, cuts="developed")
    second = rows_of("b", "Bob", {"riemannian": 1.0}, **({"cuts": other} if other else {}))
    write_table(tmp_path, "recordings", [*first, *second])
    known = other or "not known"
    with pytest.raises(go.RecordingError, match=f"cuts are developed in .* a, but {known} in b"):
        study(tmp_path)
    assert len(study(tmp_path, by="cuts").means("joint")) == 2


@pytest.mark.parametrize(
    ("file", "names", "chosen"),
    [
        ("r.c3d", ["r.xml", "r.c3d"], "r.c3d"),
        ("S1/r_1.5.c3d", ["r_1.6", "r_1.5"], "r_1.5"),
        ("r.c3d", ["/data/S1/r.c3d", "/data/S1/q.c3d"], "/data/S1/r.c3d"),
        ("r_1", ["S1/r", "S1/r_1"], "S1/r_1"),
        ("r.c3d", ["S1/r.c3d", "S2/r.c3d", "S3/r"], ""),
        ("r_1.c3d", ["r_1.5", "r_1.6"], ""),
        ("S1/r", ["S1/q", "S2/S1"], ""),
    ],
)
def test_metadata_are_those_of_the_file_that_is_named(
    file: str, names: list[str], chosen: str, tmp_path: Path
) -> None:
    table = tmp_path / "files.csv"
    table.write_text("\n".join(["file,condition", *(f"{name},{name}" for name in names)]) + "\n")
    if chosen:
        rows = with_metadata(new_rows([{"file": file}], "recordings"), table)
        assert rows["condition"].tolist() == [chosen]
    else:
        with pytest.raises(go.RecordingError, match="does not name the recording's file"):
            with_metadata(new_rows([{"file": file}], "recordings"), table)


@pytest.mark.slow
def test_conditions_come_from_a_column_or_from_a_table_of_files(tmp_path: Path) -> None:
    recordings, _ = drawn(0, 3, 2)
    written(tmp_path, recordings)
    assert study(tmp_path, by="trial").conditions == ("0", "1")
    table = tmp_path / "files.csv"
    names = sorted({str(row["recording"]) for row in recordings})
    lines = [f"data/{name},{'slow' if name.endswith('0') else 'fast'}" for name in names]
    table.write_text("\n".join(["file,condition", *(line.split("/")[1] for line in lines)]) + "\n")
    found = study(tmp_path, by="condition", metadata=table)
    assert found.conditions == ("fast", "slow")
    assert set(found.means()["recordings"]) == {3}
    table.write_text(f"file,condition\n{names[0]},slow\n")
    with pytest.raises(go.RecordingError, match=r"does not name the recording's file 'S1_1\.csv'"):
        study(tmp_path, by="condition", metadata=table)
    rows = [row for k in range(21) for row in rows_of(f"r{k}", "Ann", {"riemannian": 1.0})]
    write_table(tmp_path, "recordings", [{**row, "trial": row["recording"]} for row in rows])
    with pytest.raises(ValueError, match="'trial' has 21 values, more than 20, such as 'r0', 'r1'"):
        study(tmp_path, by="trial")
    with pytest.raises(
        ValueError,
        match="by must be a column, one of trial, side, metric, cuts, settings, got 'method'",
    ):
        study(tmp_path, by="method")
    with pytest.raises(ValueError, match="names: only for analyses"):
        study(tmp_path, names=["a"])


@pytest.mark.slow
@given(data=st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_tables_are_refused_or_read(tmp_path: Path, data: st.DataObject) -> None:
    """Never anything but a RecordingError; what is read can be averaged or says why not."""
    if not (tmp_path / "whole.csv").is_file():
        written(tmp_path, *drawn(0, 2, 1))
        (tmp_path / "recordings.csv").replace(tmp_path / "whole.csv")
        for file in tmp_path.glob("*.parquet"):
            file.unlink()
    whole = (tmp_path / "whole.csv").read_bytes()
    (tmp_path / "recordings.csv").write_bytes(data.draw(damaged(whole)))
    try:
        found = study(tmp_path)
        found.means()
    except go.RecordingError as error:
        reason = str(error)
    else:
        reason = "recordings"
    assert "recordings" in reason
