"""Kinds of files and folders, recognized by their content."""

from __future__ import annotations

import re
import zipfile
from pathlib import Path
from typing import Literal, TypeAlias

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.fitting.metric_fit import FORMAT as METRIC
from geodesic_ocp.ocp.solution import FORMAT as SOLUTION
from geodesic_ocp.recordings.formats.recognise import recognise
from geodesic_ocp.records import parse_json
from geodesic_ocp.retargeting.arm_alignment import FORMAT as ALIGNMENT
from geodesic_ocp.studies.result_files import FORMAT as RESULT
from geodesic_ocp.studies.result_files import RESULTS
from geodesic_ocp.studies.result_files import SYNERGIES as SYNERGIES_OF_ONE
from geodesic_ocp.synergies.synergy import FORMAT as SYNERGIES
from geodesic_ocp.trajectory.files.mmm import xml_root

Kind: TypeAlias = Literal[
    "recording",
    "trajectory",
    "synergies",
    "solution",
    "alignment",
    "problems",
    "robot",
    "result",
]

_HEAD = 1 << 16  # bytes
# A column of a table that a recording does not have.
_OF_TRAJECTORY = re.compile(r"time_from_start.*|.+[ _./](position|velocity)( *[\[(].*)?", re.I)
_RECORDS: dict[str, Kind] = {
    SYNERGIES: "synergies",
    SOLUTION: "solution",
    ALIGNMENT: "alignment",
    RESULT: "result",
}
_TRAJECTORY = "trajectory.npz"  # of retarget, beside the same as .csv and .json
REPORT = "report.html"  # of retarget, beside it
_ROBOTS = ("robot", "mujoco")  # root elements of URDF and Simox files, and of MJCF


def file_kind(file: Path) -> Kind:
    """Return the kind of a file; only Python files are recognized by their suffix.

    Raises:
        RecordingError: the file is of no known kind, or holds nothing that can be seen.
        OSError: the file cannot be read.
    """
    if file.suffix == ".py":
        return "problems"
    with file.open("rb") as stream:
        head = stream.read(_HEAD)
    text = head.decode("utf-8-sig", errors="replace").lstrip()
    if text.startswith(("{", "[")):
        return _kind_of_json(file)
    if text.startswith("<"):
        return _kind_of_xml(file)
    if head.startswith(b"PK"):
        return "trajectory" if _has_positions(file) else "recording"
    if _is_trajectory_table(text):
        return "trajectory"
    try:
        recognise(file)
    except RecordingError as failure:
        if file.suffix == ".csv":  # such as table.csv of an analysis
            raise RecordingError(
                f"{file}: is neither a recording nor a trajectory, which have a column for time"
            ) from None
        raise RecordingError(f"{failure}; geodesic-ocp show --help lists what is shown") from None
    return "recording"


def _kind_of_json(file: Path) -> Kind:
    try:
        record = parse_json(file.read_text(encoding="utf-8-sig"))
    except (ValueError, RecursionError) as failure:
        raise RecordingError(f"{file}: is not JSON: {failure}") from None
    if not isinstance(record, dict):
        raise RecordingError(f"{file}: is a JSON list, which is nothing that can be shown")
    kind = _RECORDS.get(str(record.get("format")))
    if kind is not None:
        return kind
    if record.get("format") == METRIC:
        raise RecordingError(
            f"{file}: is a fitted metric, of which there is nothing to see; analyse a recording "
            f"with it: geodesic-ocp analyse RECORDING --metric {file}"
        )
    if {"joint_names", "points"} <= set(record):
        return "trajectory"
    entries = ", ".join(map(repr, list(record)[:4])) or "none"
    raise RecordingError(
        f"{file}: is JSON, but neither synergies, a solution, an alignment nor a trajectory; its "
        f"entries are {entries}"
    )


def _kind_of_xml(file: Path) -> Kind:
    name = xml_root(file).tag.rpartition("}")[2]
    if name.lower() in _ROBOTS:
        return "robot"
    if name == "OpenSimDocument":
        raise RecordingError(
            f"{file}: is a model of OpenSim; give a motion (.mot, .sto), and the model as "
            f"--convention {file}"
        )
    if name == "sdf":
        raise RecordingError(f"{file}: is SDF; robots are read from URDF and MJCF")
    return "recording"


def _is_trajectory_table(text: str) -> bool:
    """Return whether the header of a table has the columns of a joint trajectory."""
    header = next((line for line in text.splitlines() if line and not line.startswith("#")), "")
    return any(_OF_TRAJECTORY.fullmatch(name.strip(" \"'")) for name in header.split(","))


def _has_positions(file: Path) -> bool:
    """Return whether a NumPy archive has the arrays of a joint trajectory."""
    try:
        with zipfile.ZipFile(file) as archive:
            return {"position.npy", "joint_names.npy"} <= set(archive.namelist())
    except zipfile.BadZipFile:
        raise RecordingError(f"{file}: is a damaged archive") from None


def retargeting_page(folder: Path) -> Path | None:
    """Return the page that retarget wrote to a folder, if it is of the trajectory there."""
    page = folder / REPORT
    trajectory = folder / _TRAJECTORY
    if not (page.is_file() and trajectory.is_file()):
        return None
    return page if page.stat().st_mtime >= trajectory.stat().st_mtime else None


def folder_files(folder: Path) -> list[Path]:
    """Return the trajectory that retarget wrote, or the synergies of analyse, or the solutions of
    solve.

    Raises:
        RecordingError: the folder has none of these, or those of many recordings.
    """
    if (trajectory := folder / _TRAJECTORY).is_file():
        return [trajectory]
    if (synergies := folder / "synergies.json").is_file():
        return [synergies]
    sides = [folder / side / "synergies.json" for side in ("right", "left")]
    if found := [file for file in sides if file.is_file()]:  # of analyse --side both
        return found
    if (folder / RESULTS).is_dir():
        one = next((folder / RESULTS).glob(f"*{SYNERGIES_OF_ONE}"), None)
        such = "" if one is None else f", such as {one}"
        raise RecordingError(f"{folder}: holds results of many recordings; give one of them{such}")
    if solutions := [file for file in sorted(folder.glob("*.json")) if _is_solution(file)]:
        return solutions
    raise RecordingError(
        f"{folder}: is a folder without results of analyse, retarget or solve; give a file"
    )


def _is_solution(file: Path) -> bool:
    try:
        return file_kind(file) == "solution"
    except RecordingError:
        return False
