"""Rows by subject and by condition."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Sequence

from geodesic_ocp.studies.study.statistics.measures import StudyMeasure
from geodesic_ocp.studies.tables.columns import Row

RowsBySubject = dict[str, list[Row]]


def subject_of(row: Row) -> str:
    """The person; where the recording names none, its file, or else the recording itself."""
    return str(row.get("subject") or row.get("file") or row["recording"])


def by_subject(rows: Iterable[Row]) -> RowsBySubject:
    """Rows of each subject, subjects in natural order."""
    found: RowsBySubject = {}
    for row in rows:
        found.setdefault(subject_of(row), []).append(row)
    return {name: found[name] for name in in_natural_order(found)}


def in_natural_order(names: Iterable[str]) -> list[str]:
    """Names with the numbers in them in order: S2 before S10."""

    def key(name: str) -> tuple[list[tuple[bool, int, str]], str]:
        parts = re.split(r"([0-9]+)", name)
        return [(not p.isdigit(), int(p) if p.isdigit() else 0, p) for p in parts if p], name

    return sorted(names, key=key)


def conditions_of(rows: Iterable[Row], by: str | None) -> list[str]:
    """Values of a column in natural order; a single empty one without a column."""
    return [""] if by is None else in_natural_order({condition_of(row, by) for row in rows})


def condition_of(row: Row, by: str | None) -> str:
    """Value of the column in a row, as text."""
    if by is None:
        return ""
    value = row.get(by)
    return "not given" if value in (None, "") else str(value)


def rows_under(
    rows: Iterable[Row], by: str | None, condition: str, method: str | None = None
) -> list[Row]:
    """The rows under a condition, of one method or of all."""
    return [
        row
        for row in rows
        if condition_of(row, by) == condition and method in (None, row["method"])
    ]


def complete_rows(rows: Sequence[Row], measure: StudyMeasure) -> list[Row]:
    """The rows of the recordings that have the measure of all methods that have it anywhere.

    Raises:
        ValueError: there are no such recordings.
    """
    known = [row for row in rows if math.isfinite(measure.of(row))]
    methods = {row["method"] for row in known}
    counts = Counter(row["recording"] for row in known)
    found = [row for row in rows if counts[row["recording"]] == len(methods)]
    if not found:
        raise ValueError(f"complete: no recording has {measure.name!r} of all methods")
    return found
