"""RecordingSource: one side of a file, with what is known of its subject before it is read."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import Literal

from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.recordings.recording_files import recording_files
from geodesic_ocp.studies.batch.sources.subject_names import (
    SubjectEntry,
    SubjectPattern,
    SubjectTable,
)

#: Where the name of a subject is from: the table of subjects, a pattern of paths, the recording
#: itself, or, as nothing tells it, the name of the folder or of the file.
SubjectFrom = Literal["table", "path", "file", "folder name", "file name"]


@dataclass(frozen=True, repr=False)
class RecordingSource:
    """One side of a file that is to be analysed.

    Attributes:
        path: of the file, absolute.
        file: relative to the deepest folder that holds all files that were given.
        side: "right" or "left".
        subject: of the person; empty if the file is to tell.
        subject_from: where the subject is from, see `SubjectFrom`; empty if the file is to tell.
        fallback: the subject if the file does not tell.
        fallback_from: where the fallback is from.
        trial: the repetition.
        height, mass: of the person [m], [kg]; None if the file is to tell.
        problem: why the recording cannot be analysed; empty if nothing is known against it.
    """

    path: Path
    file: str
    side: Side
    subject: str = ""
    subject_from: SubjectFrom | Literal[""] = ""
    fallback: str = ""
    fallback_from: SubjectFrom = "file name"
    trial: str = ""
    height: float | None = None
    mass: float | None = None
    problem: str = ""

    @property
    def name(self) -> str:
        """Of the recording."""
        return f"{self.file}, {self.side}"

    def __repr__(self) -> str:
        return f"RecordingSource({self.name!r}, subject {self.subject or self.fallback!r})"


def recording_sources(
    paths: str | PathLike[str] | Iterable[str | PathLike[str]],
    sides: Sequence[Side],
    *,
    recursive: bool = False,
    pattern: str | None = None,
    table: str | PathLike[str] | None = None,
) -> list[RecordingSource]:
    """The sources of all files, each with its subject and trial.

    A subject is, in this order, that of the table, of the pattern, of the file, the name of the
    file's folder if files of several folders are given, or the file's name. A trial is that of the
    table, of the pattern, or the file's name.

    Raises:
        RecordingError: a folder without recordings, or a table that cannot be read.
        ValueError: no path, or a pattern without {subject}.
    """
    given = recording_files(paths, recursive=recursive)
    files = list(dict.fromkeys(Path(os.path.abspath(file)) for file in given))
    root = Path(os.path.commonpath([file.parent for file in files]))
    named = None if pattern is None else SubjectPattern(pattern)
    listed = None if table is None else SubjectTable.read(table)
    sources = []
    for path in files:
        file = path.relative_to(root).as_posix()
        folder = PurePosixPath(file).parent.name
        problem, entry = "", SubjectEntry("")
        found_in: SubjectFrom | Literal[""] = ""
        if listed is not None:
            found_in, (entry, problem) = "table", listed.find(path.as_posix())
        elif named is not None:
            found_in, (entry, problem) = "path", named.find(path.as_posix())
        for side in sides:
            sources.append(
                RecordingSource(
                    path=path,
                    file=file,
                    side=side,
                    subject=entry.subject,
                    subject_from=found_in,
                    fallback=folder or path.stem,
                    fallback_from="folder name" if folder else "file name",
                    trial=entry.trial or path.stem,
                    height=entry.height,
                    mass=entry.mass,
                    problem=problem,
                )
            )
    return sources
