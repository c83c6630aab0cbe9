"""The recordings of a study: files, subjects and trials, from patterns or a table."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path, PurePosixPath
from typing import Literal

import numpy as np

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.human import as_stature
from geodesic_ocp.recordings.read_recording import stature_of
from geodesic_ocp.recordings.read_recordings import recording_files
from geodesic_ocp.studies.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.study_tables import Row, entry_of_file, read_file_table
from geodesic_ocp.trajectory.motion import Subject
from geodesic_ocp.trajectory.recording import Recording

_FIELD = re.compile(r"\{(\w*)\}|(\*)")


@dataclass(frozen=True)
class SubjectEntry:
    """Known facts about a file: subject, trial, height [m] and mass [kg] of the person."""

    subject: str
    trial: str = ""
    height: float | None = None
    mass: float | None = None


class SubjectPattern:
    """A pattern of paths such as "{subject}/{trial}" or "{subject}_*_{trial}".

    It is compared with the end of a path without its suffix. {subject}, {trial} and * stand for at
    least one character other than /, and for as few as possible, the first of them first.

    >>> SubjectPattern("{subject}_reach_{trial}").find("data/S01_reach_2.c3d")[0].trial
    '2'

    Raises:
        ValueError: no {subject}, another or a repeated field, or two with nothing between them.
    """

    def __init__(self, pattern: str) -> None:
        names = [match[1] for match in _FIELD.finditer(pattern) if not match[2]]
        if names.count("subject") != 1 or sorted(names) not in (["subject"], ["subject", "trial"]):
            raise ValueError(
                "the pattern of subjects must hold {subject} once, and may hold {trial} once and "
                f"*, as in '{{subject}}/*_{{trial}}'; got {pattern!r}"
            )
        if touching := re.search(r"(?:\{\w*\}|\*){2,}", pattern):
            raise ValueError(
                "the pattern of subjects must hold something between two fields, as in "
                f"'{{subject}}_{{trial}}'; got {touching[0]!r} in {pattern!r}"
            )
        self.pattern = pattern
        escaped = re.escape(pattern.removeprefix("./")).replace(r"\*", "[^/]+?")
        named = re.sub(r"\\\{(\w+)\\\}", r"(?P<\1>[^/]+?)", escaped)
        self._expression = re.compile(f"(?:.*/)?{named}")

    def find(self, path: str) -> tuple[SubjectEntry, str]:
        """Return what the pattern finds in a path, or why it does not match."""
        found = self._expression.fullmatch(str(PurePosixPath(path).with_suffix("")))
        if found is None:
            return SubjectEntry(""), f"its path does not match the pattern {self.pattern!r}"
        return SubjectEntry(found["subject"], found.groupdict().get("trial") or ""), ""


def read_subjects(table: str | PathLike[str]) -> dict[str, SubjectEntry]:
    """Read a CSV file with the columns file, subject and, if known, trial, height and mass.

    Raises:
        RecordingError: as `read_file_table`.
    """
    return read_file_table(table, _entry, ("file", "subject"))


def _entry(row: Mapping[str, str]) -> SubjectEntry:
    if not row["file"] or not row["subject"]:
        raise ValueError("file and subject must not be empty")
    numbers: dict[str, float | None] = {}
    for name in ("height", "mass"):
        try:
            numbers[name] = as_positive(name, float(text)) if (text := row.get(name)) else None
        except ValueError as failure:
            raise ValueError(f"{name}: {failure}") from None
    as_stature(*stature_of(Subject(), **numbers))
    return SubjectEntry(row["subject"], row.get("trial") or "", **numbers)


def alike(names: Iterable[str]) -> list[list[str]]:
    """Return groups of different names that one person may have.

    They differ in case, separators, zeros before a number or a word for subject in front of it
    ("S01", "sub-1"), or one ends in another ("KIT_1229", "1229").
    """
    groups: list[list[str]] = []
    for name in sorted(set(names), key=lambda each: (len(each), each)):
        for group in groups:
            ends = rf"[^0-9A-Za-z]{re.escape(group[0])}$"
            if _plain(name) == _plain(group[0]) or re.search(ends, name):
                group.append(name)
                break
        else:
            groups.append([name])
    return sorted(group for group in groups if len(group) > 1)


def may_be_one(names: Sequence[str]) -> str:
    """Return a clause that says that these subjects may be one person."""
    return f"Subjects {' and '.join(names)} may be the same person"


def _plain(subject: str) -> str:
    found = re.sub(r"[\W_]+", "", subject.casefold())
    found = re.sub(r"^(?:subject|subj|sub|participant|s|p|vp)(?=\d)", "", found)
    return re.sub(r"(?<!\d)0+(?=\d)", "", found)


#: Where the name of a subject is from: the table of subjects, a pattern of paths, the recording
#: itself, or, as nothing tells it, the name of the folder or of the file.
SubjectFrom = Literal["table", "path", "file", "folder name", "file name"]


@dataclass(frozen=True, repr=False)
class RecordingSource:
    """One side of a file that is to be analysed."""

    path: Path  # path of the file, absolute
    file: str  # relative to the deepest folder that holds all files that were given
    side: Side  # "right" or "left"
    # number of a part of the file between gaps, from 1; None: the whole file
    part: int | None = None
    subject: str = ""  # subject of the person; empty if the file is to tell
    # where the subject is from, see `SubjectFrom`; empty if the file is to tell
    subject_from: SubjectFrom | Literal[""] = ""
    fallback: str = ""  # the subject if the file does not tell
    fallback_from: SubjectFrom = "file name"  # where the fallback is from
    trial: str = ""  # the repetition
    # height, mass: height and mass of the person [m], [kg]; None if the file is to tell
    height: float | None = None
    mass: float | None = None
    problem: str = ""  # why the recording cannot be analysed; empty if nothing is known against it

    @property
    def name(self) -> str:
        """Name of the recording."""
        part = "" if self.part is None else f", part {self.part}"
        return f"{self.file}{part}, {self.side}"

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
    """Return the sources of all files, each with its subject and trial.

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
    listed = None if table is None else read_subjects(table)
    sources = []
    for path in files:
        file = path.relative_to(root).as_posix()
        folder = PurePosixPath(file).parent.name
        problem = ""
        entry = SubjectEntry("")
        found_in: SubjectFrom | Literal[""] = ""
        if listed is not None:
            found_in = "table"
            if found := entry_of_file(listed, path.as_posix()):
                entry = found
            else:
                shown = "/".join(path.parts[-2:])
                problem = f"{table} has no row whose file is the end of .../{shown}"
        elif named is not None:
            found_in = "path"
            (entry, problem) = named.find(path.as_posix())
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


def identity(source: RecordingSource, own_subject: str) -> dict[str, str]:
    """Return what identifies a recording in the tables, with the subject that the file names."""
    subject = source.subject
    subject_from = str(source.subject_from)
    if not subject:
        subject = own_subject
        subject_from = "file"
    if not subject:
        subject = source.fallback
        subject_from = source.fallback_from
    return {
        "recording": source.name,
        "file": source.file,
        "subject": subject,
        "subject_from": subject_from,
        "trial": source.trial,
        "side": source.side,
    }


def stature(
    settings: AnalysisSettings, source: RecordingSource
) -> tuple[float | None, float | None]:
    """Return height [m] and mass [kg] by the settings or the table of subjects; None if unknown."""
    return (
        source.height if settings.height is None else settings.height,
        source.mass if settings.mass is None else settings.mass,
    )


def person_row(recording: Recording, settings: AnalysisSettings, source: RecordingSource) -> Row:
    """Return height and mass of the model, what they rest on, and the errors of markers."""
    subject = recording.motion.subject
    fit = recording.fit
    height, mass = stature_of(subject, *stature(settings, source))
    row: Row = {"height_m": height, "mass_kg": mass}
    for name in ("height", "mass"):
        if getattr(settings, name) is not None:
            origin = "given"
        elif getattr(source, name) is not None:
            origin = "table"
        elif name == "height" and fit is not None and fit.height is not None:
            origin = "file" if "subject" in fit.height_from else "markers"
        else:
            origin = "assumed" if getattr(subject, name) is None else "file"
        row[f"{name}_from"] = origin
    row["marker_error_m"] = None if fit is None else float(np.nanmean(fit.errors))
    return row
