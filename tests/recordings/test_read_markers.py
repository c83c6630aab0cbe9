"""Positions of markers from c3d, TRC and tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_recordings import MARKER_TABLE, TABLE, TRC, c3d, small_c3d

import geodesic_ocp as go
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.read_recording import read_markers, read_motion

NAN = [np.nan] * 3
EXPECTED = np.array(
    [
        [[0.100, 0.200, 1.400], [0.120, 0.210, 1.100]],
        [[0.101, 0.201, 1.401], NAN],
        [[0.102, 0.202, 1.402], [0.122, 0.212, 1.102]],
    ]
)
PROCESSORS = ("Intel", "DEC", "MIPS")


def write(folder: Path, name: str, content: str | bytes) -> Path:
    data = content.encode("latin-1") if isinstance(content, str) else content
    (folder / name).write_bytes(data)
    return folder / name


def points(seed: int = 0) -> np.ndarray:
    """Five frames of three points at whole millimetres; the second is not seen in one frame."""
    values = np.zeros((5, 3, 4))
    values[:, :, :3] = np.random.default_rng(seed).integers(-3000, 3000, (5, 3, 3))
    values[2, 1, 3] = -1.0
    return values


@pytest.mark.parametrize(
    ("content", "changes"),
    [
        (TRC, {}),
        (TRC, {"\t100.0\t200.0\t1400.0": "\t1e2\t2e2\t1.4e3"}),
        (TRC, {"\t\t\t\n": "\tnan\tNaN\tnan\n"}),
        (TRC, {"\t\t\t\n": "\t0\t0.0\t0\n"}),
        (TRC, {"walk.trc": "Übung.trc"}),
        (TRC, {"\t\t\tRELB\t\t": "\tRELB"}),
        (TRC, {"\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n": ""}),
        (TRC.replace("\t\t\t\n", "\tnan\tnan\tnan\n").replace("\t\t", ""), {"\t": "  "}),
        (TRC, {"\n": "\r\n"}),
        # Variants of OpenSim's own examples and programs.
        (TRC, {"100\t100\t3\t2\tmm": "  100.0\t\t  100.0\t\t 3\t\t2\t\t mm", "Rate\t": "Rate\t\t"}),
        (TRC, {"\tRSHO\t\t\tRELB\t\t": "\t\tRSHO\t\tRELB\t", "\tX1": "\t\tX1"}),
        (
            TRC,
            {
                "Time\tRSHO": "Time\t\tRSHO",
                "\tX1": "\t\tX1",
                "0\t100.0": "0\t\t100.0",
                "1\t101.0": "1\t\t101.0",
                "2\t102.0": "2\t\t102.0",
            },
        ),
        (TRC, {"\t": ","}),
        (TRC, {"\t": ",", "\n": ",\n"}),
        (MARKER_TABLE, {}),
        (MARKER_TABLE, {",,,": ",nan,nan,nan"}),
        (
            MARKER_TABLE,
            {"time,": "time,frame,", "0.00,": "0,1,", "0.01,": "0.01,,", "0.02,": ".02,,"},
        ),
    ],
)
def test_text_files(content: str, changes: dict[str, str], tmp_path: Path) -> None:
    for old, new in changes.items():
        assert old in content
        content = content.replace(old, new)
    markers = read_markers(write(tmp_path, "file.dat", content))
    assert markers.names == ("RSHO", "RELB")
    assert markers.time == pytest.approx([0.0, 0.01, 0.02])
    assert markers.positions == pytest.approx(EXPECTED, nan_ok=True)


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("cm", 0.01), ("mm", 0.001)])
def test_units_of_length(unit: str, metres: float, tmp_path: Path) -> None:
    for content, split in ((TRC, "\t"), (MARKER_TABLE, ",")):
        lines = content.replace("mm", unit).splitlines()
        for row, line in enumerate(lines[-3:], start=len(lines) - 3):
            cells = line.split(split)
            lengths = [str(1e-3 * float(each) / metres) if each else "" for each in cells[-6:]]
            lines[row] = split.join([*cells[:-6], *lengths])
        file = write(tmp_path, "file", "\n".join(lines))
        assert read_markers(file).positions == pytest.approx(EXPECTED, nan_ok=True)
    near = 1e-3 * points()
    file = write(tmp_path, "file", c3d(near / metres, ["A", "B", "C"], unit=unit))
    assert read_markers(file).positions[0] == pytest.approx(near[0, :, :3])


def test_counts_in_the_header_of_trc_that_are_wrong_are_told(tmp_path: Path) -> None:
    file = write(tmp_path, "walk.trc", TRC.replace("100\t100\t3\t2", "100\t100\t250\t2"))
    with pytest.warns(RuntimeWarning, match=r"walk\.trc: its header says 250 frames, it has 3"):
        assert len(read_markers(file)) == 3


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("102.0\t", "soon\t", "line 9: RSHO is not a number: 'soon'"),
        ("102.0\t", "inf\t", "line 9: RSHO is inf"),
        ("102.0\t", "\t", "line 9: RSHO has some of its three coordinates only"),
        ("\t1102.0", "", "line 9 has 7 entries, 8 are needed for frame, time and 2 markers"),
        ("\t1102.0", "\t1102.0\t1", "line 9 has 9 entries, 8 are needed"),
        ("0.02", "", "line 9: the time is not a number: ''"),
        ("0.02", "0.01", "time must increase: sample 2 is at 0.01 s, the one before at 0.01 s"),
        ("mm", "ft", "line 3 must give Units m, cm or mm, not 'ft'"),
        ("RSHO\t\t\tRELB\t\t", "", "line 4 names no markers"),
        ("\tRSHO\t\t\tRELB\t\t", "", "line 4 must name Frame#, Time and the markers"),
        ("Frame#", "Sample", "line 4 must name Frame#"),
        (
            "\tRSHO\t\t\tRELB\t\t",
            "\tRSHO",
            "names 1 markers, which must be three columns apart, but line 5 has 6 coordinates",
        ),
        (TRC[TRC.index("Frame#") :], "", "is cut off after 3 lines, within the header"),
    ],
)
def test_bad_trc_files(old: str, new: str, message: str, tmp_path: Path) -> None:
    file = write(tmp_path, "bad.trc", TRC.replace(old, new))
    with pytest.raises(go.RecordingError) as failure:
        read_markers(file)
    assert str(failure.value).startswith(f"{file}: ")
    assert message in str(failure.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("# unit: mm\n", "", "a line '# unit: mm' or '# unit: m' must precede the header"),
        ("mm", "ft", "joint"),  # then it is a table of angles
        ("RELB_z", "RELB", "line 4: RSHO_x is not a number: 'x'"),
        ("RSHO_x", "RSHO", "line 4: RELB_x is not a number: 'x'"),
        (",101,", ",x,", "line 4: RSHO_x is not a number: 'x'"),
        (",101,", ",,", "must be finite, or missing (NaN) in all coordinates"),
        (",,,", ",,,,", "line 4 has 8 entries, the header 7"),
        ("0.01", "", "line 4: time is not a number: ''"),
    ],
)
def test_bad_tables(old: str, new: str, message: str, tmp_path: Path) -> None:
    content = MARKER_TABLE.replace(",101,", ",x,").replace(",,,", ",x,x,x")
    if message.count("'x'") == 0 or old == ",101,":
        content = MARKER_TABLE
    file = write(tmp_path, "bad.csv", content.replace(old, new))
    with pytest.raises(go.RecordingError) as failure:
        read_markers(file)
    assert str(failure.value).startswith(f"{file}: ")
    assert message in str(failure.value)


@pytest.mark.parametrize("processor", PROCESSORS)
@pytest.mark.parametrize("scale", [-1.0, 0.5])
def test_every_layout_of_c3d(processor: str, scale: float, tmp_path: Path) -> None:
    """Floats and integers, of each of the three processors; with analog samples between."""
    for analog in (0, 6):
        content = c3d(points(), ["A", "B", "C"], processor=processor, scale=scale, analog=analog)
        markers = read_markers(write(tmp_path, "file.c3d", content))
        expected = 1e-3 * points()[:, :, :3] * (scale if scale > 0.0 else 1.0)
        expected[2, 1] = np.nan
        assert markers.positions == pytest.approx(expected, nan_ok=True)
        assert markers.time == pytest.approx(np.arange(5) / 100.0)
        assert markers.names == ("A", "B", "C")


@pytest.mark.parametrize("processor", PROCESSORS[:2])  # ezc3d does not read that of MIPS
@pytest.mark.parametrize("scale", [-1.0, 0.5])
def test_ezc3d_reads_the_same(processor: str, scale: float, tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    content = c3d(points(1), ["A", "B", "C"], processor=processor, scale=scale)
    file = write(tmp_path, "file.c3d", content)
    positions = np.moveaxis(ezc3d.c3d(str(file))["data"]["points"][:3], 0, -1).swapaxes(0, 1)
    assert read_markers(file).positions == pytest.approx(1e-3 * positions, nan_ok=True)


def test_ezc3d_reads_the_same_of_a_recording(shared: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    file = shared / "data" / "kit" / "take_book_from_shelf_right_arm_02.c3d"
    markers, content = read_markers(file), ezc3d.c3d(str(file))
    positions = np.moveaxis(content["data"]["points"][:3], 0, -1).swapaxes(0, 1)
    assert np.abs(markers.positions - 1e-3 * positions).max() <= 1e-12
    assert list(markers.names) == content["parameters"]["POINT"]["LABELS"]["value"]
    assert markers.positions.shape == (338, 53, 3)
    assert markers.time[-1] == pytest.approx(3.37)
    assert markers.subject.name == "1229"


def test_more_frames_than_the_header_can_count(tmp_path: Path) -> None:
    values = np.zeros((70_000, 1, 4))
    values[:, 0, 0] = 1.0 + np.arange(70_000)
    file = write(tmp_path, "long.c3d", c3d(values, ["A"]))
    assert read_markers(file).positions[-1, 0, 0] == pytest.approx(70.0)
    write(tmp_path, "long.c3d", file.read_bytes()[:-16])
    with pytest.raises(go.RecordingError, match="counts 70000 frames, there are 69999"):
        read_markers(file)


@pytest.mark.parametrize("counted", [65535, 70_000 % 65536])
def test_the_size_of_a_file_counts_what_its_header_cannot(counted: int, tmp_path: Path) -> None:
    """Header and POINT:FRAMES saturate or overflow; the last block is filled up with zeros."""
    values = np.zeros((70_000, 1, 4))
    values[:, 0, 0] = 1.0 + np.arange(70_000)
    content = c3d(values, ["A"], frames=counted).ljust(70_000 * 16 + 4 * 512, b"\0")
    file = write(tmp_path, "long.c3d", content)
    assert read_markers(file).positions[:, 0, 0] == pytest.approx(1e-3 * values[:, 0, 0])


@pytest.mark.slow
def test_ezc3d_writes_more_frames_than_the_header_can_count(tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [100.0]
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    content["parameters"]["POINT"]["LABELS"]["value"] = ("A",)
    values = 1.0 + np.arange(66_000)
    content["data"]["points"] = np.stack([values, values, values, 0.0 * values])[:, None]
    content.write(str(tmp_path / "long.c3d"))
    markers = read_markers(tmp_path / "long.c3d")
    assert markers.positions[:, 0] == pytest.approx(1e-3 * np.stack([values] * 3, axis=1))


def test_frames_that_the_header_does_not_count_are_told(tmp_path: Path) -> None:
    file = write(tmp_path, "file.c3d", c3d(points(), ["A", "B", "C"], frames=3))
    with pytest.warns(RuntimeWarning, match="counts 3 frames, which are read, but .* room for 5"):
        assert len(read_markers(file)) == 3


def test_points_at_the_origin_without_residual_are_missing(tmp_path: Path) -> None:
    values = points()
    values[0, 0] = 0.0
    values[1, 0] = (0.0, 0.0, 0.0, 3.0)  # seen by cameras, exactly at the origin
    markers = read_markers(write(tmp_path, "file.c3d", c3d(values, ["A", "B", "C"])))
    assert np.isnan(markers.positions[0, 0]).all()
    assert markers.positions[1, 0] == pytest.approx(np.zeros(3))


@pytest.mark.parametrize(
    ("labels", "strings", "names", "subject"),
    [
        (["Jo:A", "Jo:B", "Jo:C"], {}, ("A", "B", "C"), "Jo"),
        (["Jo:A", "Jo:B", "C"], {}, ("A", "B", "C"), "Jo"),
        (["A", "*1", ""], {}, ("A",), ""),
        (["A", "B"], {}, ("A", "B"), ""),
        (["A"], {"LABELS2": ["B", "C"]}, ("A", "B", "C"), ""),
        (["A", "RElbowAngles", "C"], {"ANGLES": ["RElbowAngles"]}, ("A", "C"), ""),
    ],
)
def test_labels_of_c3d(
    labels: list[str],
    strings: dict[str, list[str]],
    names: tuple[str, ...],
    subject: str,
    tmp_path: Path,
) -> None:
    """Subjects before a colon are left out; points that are no markers are dropped."""
    markers = read_markers(write(tmp_path, "file.c3d", c3d(points(), labels, strings=strings)))
    assert markers.names == names
    assert markers.subject.name == subject
    columns = [0, 2] if names == ("A", "C") else list(range(len(names)))
    assert markers.positions[0] == pytest.approx(1e-3 * points()[0, columns, :3])


TWO = TRC.replace("RELB", "RSHO")


@pytest.mark.parametrize("content", [c3d(points(), ["A", "RSHO", "RSHO"]), TWO.encode()])
def test_a_label_that_occurs_twice(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(content)
    with pytest.warns(RuntimeWarning, match="file: RSHO is the label of several markers: the firs"):
        markers = read_markers(tmp_path / "file")
    assert markers.names[-2:] == ("RSHO", "RSHO (2)")


@pytest.mark.parametrize(
    ("labels", "first", "second"),
    [
        (["Jo:A", "Al:B", "Jo:C"], ("Jo", "A", "C"), ("Al", "B")),
        (["Jo:A", "Al:A", "Al:C"], ("Jo", "A"), ("Al", "A", "C")),
        (["A", "Al:A", "Al:C"], ("", "A"), ("Al", "A", "C")),
    ],
)
def test_markers_of_several_people_are_never_mixed(
    labels: list[str], first: tuple[str, ...], second: tuple[str, ...], tmp_path: Path
) -> None:
    file = write(tmp_path, "two.c3d", c3d(points(), labels))
    with pytest.warns(RuntimeWarning, match=r"of several people: .* is taken, not Al; person='Al'"):
        markers = read_markers(file)
    assert (markers.subject.name, *markers.names) == first
    markers = read_markers(file, person="AL")
    assert (markers.subject.name, *markers.names) == second
    columns = [labels.index(f"Al:{name}") for name in second[1:]]
    assert markers.positions[0] == pytest.approx(1e-3 * points()[0, columns, :3])
    with pytest.raises(go.RecordingError, match=r"two\.c3d: there is no person 'Eve'; .*Al"):
        read_markers(file, person="Eve")


LABELS = ["A", "B", "C"]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (c3d(points(), LABELS, frames=6), "is cut off: the header counts 6 frames, there are 5"),
        (c3d(points(), LABELS)[:-1], "is cut off: the header counts 5 frames, there are 4"),
        (c3d(points(), LABELS)[:600], "the parameters are broken: 'RATE'"),
        (c3d(points(), LABELS)[:100], "is cut off or broken: its 100 bytes have no block 2"),
        (c3d(points(), LABELS, unit="ft"), "POINT:UNITS must be m, cm or mm, is 'ft'"),
        (c3d(points(), ["*1", "*2", ""]), "none of its 3 points has a marker's label"),
        (c3d(np.zeros((5, 0, 4)), [], analog=4), "has no markers, only analog data"),
        (
            c3d(np.zeros((5, 0, 4)), [], analog=4, rotations=["pelvis_4X4", "r_uarm_4X4"]),
            "has no markers, only rotations of pelvis_4X4, r_uarm_4X4, which are not read",
        ),
        (c3d(points()[:1], LABELS), "time must be two or more"),
        (c3d(points() + np.inf, LABELS), "marker A is at [inf inf inf] at sample 0"),
    ],
)
def test_bad_c3d_files(content: bytes, message: str, tmp_path: Path) -> None:
    file = write(tmp_path, "bad.c3d", content)
    with pytest.raises(go.RecordingError) as failure:
        read_markers(file)
    assert str(failure.value).startswith(f"{file}: ")
    assert message in str(failure.value)


def test_motions_and_markers_are_not_confused(tmp_path: Path) -> None:
    for name, content in {"a": TRC, "b": MARKER_TABLE, "c": small_c3d()}.items():
        file = write(tmp_path, name, content)
        assert isinstance(read_markers(file), Markers)
        with pytest.raises(
            go.RecordingError,
            match=r"go\.recordings\.read_markers, and .*go\.recordings\.fit_markers",
        ):
            read_motion(file)
    with pytest.raises(go.RecordingError, match=r"has no markers; read it with go\.read_motion"):
        read_markers(write(tmp_path, "d", TABLE))
