"""Which files of a folder that the package wrote are shown."""

from __future__ import annotations

from pathlib import Path

from geodesic_ocp.cli.show.file_kind import file_kind
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.studies.batch.results.result_file import RESULTS, SYNERGIES

_TRAJECTORY = "trajectory.npz"  # of retarget, beside the same as .csv and .json


def folder_files(folder: Path) -> list[Path]:
    """The trajectory that retarget wrote, or the synergies of analyse, or the solutions of solve.

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
        one = next((folder / RESULTS).glob(f"*{SYNERGIES}"), None)
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
