"""Subjects and trials from patterns of file names, and from a table of the files."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path, PurePosixPath

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.studies.tables.file_names import named_file, path_ends
from geodesic_ocp.studies.tables.text_table import read_text_table

_FIELD = re.compile(r"\{(\w*)\}|(\*)")


@dataclass(frozen=True)
class SubjectEntry:
    """What is known of a file: subject, trial, height [m] and mass [kg] of the person."""

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
        pattern = pattern.removeprefix("./")
        parts, end = [], 0
        for match in _FIELD.finditer(pattern):
            parts.append(re.escape(pattern[end : match.start()]))
            parts.append("[^/]+?" if match[2] else f"(?P<{match[1]}>[^/]+?)")
            end = match.end()
        self._expression = re.compile("(?:.*/)?" + "".join([*parts, re.escape(pattern[end:])]))

    def find(self, path: str) -> tuple[SubjectEntry, str]:
        """What the pattern finds in a path, or why it does not."""
        found = self._expression.fullmatch(str(PurePosixPath(path).with_suffix("")))
        if found is None:
            return SubjectEntry(""), f"its path does not match the pattern {self.pattern!r}"
        return SubjectEntry(found["subject"], found.groupdict().get("trial") or ""), ""


@dataclass(frozen=True, repr=False)
class SubjectTable:
    """Entries by the path of the file, as far as the table gives it, with or without its suffix.

    Attributes:
        path: of the table.
        entries: by path.
    """

    path: Path
    entries: Mapping[str, SubjectEntry]

    def __repr__(self) -> str:
        return f"SubjectTable({self.path}, {len(self.entries)} files)"

    @classmethod
    def read(cls, path: str | PathLike[str]) -> SubjectTable:
        """Read a CSV file with the columns file, subject and, if known, trial, height and mass.

        Raises:
            RecordingError: the table is missing, lacks a column, has a wrong entry, or lines of one
                file that differ.
        """
        file = Path(path)
        names, lines = read_text_table(file)
        if missing := [name for name in ("file", "subject") if name not in names]:
            raise RecordingError(f"{file}: there is no column {' or '.join(missing)}")
        entries: dict[str, SubjectEntry] = {}
        places: dict[str, str] = {}
        for where, values in lines:
            key, entry = _entry(f"{file}: {where}", dict(zip(names, values, strict=True)))
            if entries.setdefault(key, entry) != entry:
                raise RecordingError(f"{file}: {places[key]} and {where} differ about {key}")
            places.setdefault(key, where)
        return cls(file, entries)

    def find(self, file: str) -> tuple[SubjectEntry, str]:
        """The entry whose path is the end of this one, or why there is none.

        The longest path counts, and of two as long the one with the suffix.
        """
        for end in path_ends(file):
            if (entry := self.entries.get(end)) is not None:
                return entry, ""
        shown = "/".join(PurePosixPath(file).parts[-2:])
        return SubjectEntry(""), f"{self.path} has no row whose file is the end of .../{shown}"


def _entry(where: str, row: Mapping[str, str]) -> tuple[str, SubjectEntry]:
    if not row["file"] or not row["subject"]:
        raise RecordingError(f"{where}: file and subject must not be empty")
    numbers: dict[str, float | None] = {}
    for name in ("height", "mass"):
        try:
            numbers[name] = as_positive(name, float(text)) if (text := row.get(name)) else None
        except ValueError as failure:
            raise RecordingError(f"{where}: {name}: {failure}") from None
    entry = SubjectEntry(row["subject"], row.get("trial") or "", **numbers)
    return named_file(row["file"]), entry
