"""The files of recordings in folders and of patterns."""

from __future__ import annotations

import glob
from collections.abc import Iterable
from os import PathLike
from pathlib import Path

from geodesic_ocp.errors import RecordingError

#: Ends of the names of recordings, by which a folder is searched.
SUFFIXES = (".xml", ".csv", ".amc", ".bvh", ".mot", ".sto", ".trc", ".c3d", ".npz")

# What lies together in a folder of results: of many recordings, of one, and of a study.
_RESULTS = (
    ("recordings.csv", "synergies.csv", "results"),
    ("synergies.json", "table.csv"),
    ("study.md", "means.csv"),
)


def recording_files(
    paths: str | PathLike[str] | Iterable[str | PathLike[str]], *, recursive: bool = False
) -> list[Path]:
    """The files that paths name: files, folders, and patterns such as "data/**/*.c3d".

    Args:
        paths: one or several. Of a folder all files whose names end as those of recordings do
            (`SUFFIXES`), sorted; hidden ones are left out, and folders within it that hold the
            tables of an analysis or a study. Of a pattern all files that match.
        recursive: also those in the folders within a folder.

    Returns:
        The files in the order given, each once.

    Raises:
        RecordingError: a folder or pattern without any such file, or a path that is neither a
            file nor a folder, without the suffix of a recording.
        ValueError: no path.
    """
    given = [paths] if isinstance(paths, (str, PathLike)) else list(paths)
    files: list[Path] = []
    for path in map(Path, given):
        if path.is_dir():
            files += _in_folder(path, recursive)
        elif glob.has_magic(str(path)) and not path.exists():
            files += _matching(str(path))
        elif path.exists() or path.suffix.lower() in SUFFIXES:
            files.append(path)  # whoever reads it tells if it is missing
        else:
            raise RecordingError(f"{path}: there is no such file or folder")
    if not files:
        raise ValueError("paths must name at least one file or folder, got none")
    return list(dict.fromkeys(files))


def _in_folder(folder: Path, recursive: bool) -> list[Path]:
    ours: dict[Path, bool] = {folder: False}  # whether a folder holds what this package wrote

    def is_result(place: Path) -> bool:
        if place not in ours:
            ours[place] = is_result(place.parent) or any(
                all((place / name).exists() for name in names) for names in _RESULTS
            )
        return ours[place]

    inside = sorted(
        each
        for each in (folder.rglob("*") if recursive else folder.iterdir())
        if each.suffix.lower() in SUFFIXES
        and each.is_file()
        and not any(part.startswith(".") for part in each.relative_to(folder).parts)
        and not is_result(each.parent)
    )
    if not inside:
        where = "in this folder" + (" or those within it" if recursive else "")
        ends = f"{', '.join(SUFFIXES[:-1])} or {SUFFIXES[-1]}"
        raise RecordingError(f"{folder}: no file {where} ends in {ends}")
    return inside


def _matching(pattern: str) -> list[Path]:
    found = sorted(Path(each) for each in glob.glob(pattern, recursive=True))
    files = [each for each in found if each.is_file()]
    if not files:
        raise RecordingError(f"{pattern}: no file matches this pattern")
    return files
