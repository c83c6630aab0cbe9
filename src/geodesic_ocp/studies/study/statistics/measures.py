"""What a study compares: errors and numbers of segments, by name."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from geodesic_ocp.studies.tables.columns import Row

_FILTERED = {
    "joint": ("joint_error_rad", "joints [rad]", "joint error [rad]", 1.0),
    "position": ("position_error_m", "hand [m]", "hand position error [mm]", 1000.0),
    "orientation": (
        "orientation_error_rad",
        "hand [rad]",
        "hand orientation error [rad]",
        1.0,
    ),
}


@dataclass(frozen=True)
class StudyMeasure:
    """A number of every recording and method.

    Attributes:
        name: as in `Study.means`.
        column: of recordings.csv.
        header: of a column of a table, with the unit.
        axis: label of a figure's axis, with its unit.
        scale: from the table's unit to that of the axis.
        per_second: whether it is the column's number over the recording's duration.
    """

    name: str
    column: str
    header: str
    axis: str
    scale: float = 1.0
    per_second: bool = False

    def __repr__(self) -> str:
        return f"StudyMeasure({self.name}: {self.header})"

    @property
    def unit(self) -> str:
        """Of the table, such as "rad"; empty of a number without one."""
        return self.header.partition("[")[2].removesuffix("]")

    def of(self, row: Row) -> float:
        """The number in a row of recordings.csv; NaN where it is missing."""
        value, duration = row.get(self.column), row.get("duration_s")
        if not isinstance(value, int | float):
            return math.nan
        if not self.per_second:
            return float(value)
        return value / duration if isinstance(duration, int | float) and duration > 0 else math.nan


MEASURES = {
    each.name: each
    for each in (
        *(StudyMeasure(name, *parts) for name, parts in _FILTERED.items()),
        *(
            StudyMeasure(
                f"{name}_unfiltered",
                column.replace("_error_", "_error_unfiltered_"),
                header.replace(" [", ", unfiltered ["),
                axis.replace(" [", ", unfiltered ["),
                scale,
            )
            for name, (column, header, axis, scale) in _FILTERED.items()
        ),
        StudyMeasure("segments", "segments", "segments", "number of segments"),
        StudyMeasure(
            "segments_per_second",
            "segments",
            "segments per second [1/s]",
            "segments per second [1/s]",
            per_second=True,
        ),
    )
}


def as_measure(name: str) -> StudyMeasure:
    """The measure of this name.

    Raises:
        ValueError: there is none.
    """
    if not isinstance(name, str) or name not in MEASURES:
        raise ValueError(f"measure must be one of {', '.join(MEASURES)}, got {name!r}")
    return MEASURES[name]


def is_known(rows: Iterable[Row], measure: StudyMeasure) -> bool:
    """Whether any row has the measure."""
    return any(math.isfinite(measure.of(row)) for row in rows)


def known_measures(rows: Sequence[Row], names: Iterable[str]) -> list[str]:
    """Those of the measures that any row has."""
    return [name for name in names if is_known(rows, MEASURES[name])]


def known_measure(rows: Sequence[Row], name: str) -> StudyMeasure:
    """The measure of this name.

    Raises:
        ValueError: there is none, or no row has it.
    """
    measure = as_measure(name)
    if not is_known(rows, measure):
        raise ValueError(f"measure {name!r}: the table has no {measure.column}")
    return measure
