"""The tidy tables of many recordings: what each column holds, and in which unit.

recordings.csv has one row for each recording and method, synergies.csv one for each synergy, and
failures.csv one for each recording without a result. Units are the suffix of a column's name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

Kind = Literal["text", "integer", "number"]
Cell = str | int | float | None  # None where a value is not known or does not apply
Row = dict[str, Cell]


@dataclass(frozen=True)
class TableColumn:
    """A column of a tidy table.

    Attributes:
        name: machine-friendly, with the unit as suffix.
        kind: of its values; integers and numbers may be missing.
        meaning: in words.
    """

    name: str
    kind: Kind
    meaning: str

    def __post_init__(self) -> None:
        if self.kind not in get_args(Kind):
            raise ValueError(f"kind must be one of {', '.join(get_args(Kind))}, got {self.kind!r}")

    def __repr__(self) -> str:
        return f"TableColumn({self.name}: {self.kind})"

    def parsed(self, text: str) -> Cell:
        """The value that a CSV file holds as this text; empty text is a missing value.

        Raises:
            ValueError: the text is not of this kind.
        """
        if self.kind == "text":
            return text
        if not text:
            return None
        return int(text) if self.kind == "integer" else float(text)


# What identifies a recording in every table.
IDENTITY_COLUMNS = (
    TableColumn("recording", "text", "names the recording: the file and the side"),
    TableColumn("file", "text", "the recording's file, relative to the folder that was given"),
    TableColumn("subject", "text", "the person; recordings of one person are not independent"),
    TableColumn(
        "subject_from",
        "text",
        "table, path, or file that names the subject, else folder name or file name",
    ),
    TableColumn("trial", "text", "the repetition, within the subject"),
    TableColumn("side", "text", "right or left"),
)

RECORDING_COLUMNS = (
    *IDENTITY_COLUMNS,
    TableColumn("height_m", "number", "body height of the model [m]"),
    TableColumn("height_from", "text", "given, table, file, markers, or assumed"),
    TableColumn("mass_kg", "number", "body mass of the model [kg]"),
    TableColumn("mass_from", "text", "given, table, file, or assumed"),
    TableColumn("marker_error_m", "number", "mean distance of markers from the fitted ones [m]"),
    TableColumn("samples", "integer", "number of samples"),
    TableColumn("duration_s", "number", "from the first sample to the last [s]"),
    TableColumn("rate_hz", "number", "mean sampling rate [Hz]"),
    TableColumn("cutoff_hz", "number", "of the filter [Hz]; missing where there is none"),
    TableColumn("noise_rad", "number", "root mean square over joints of the recording's noise"),
    TableColumn("metric", "text", "in which the motion is cut and planned, in words"),
    TableColumn("threshold_rad", "number", "of the segmentation; missing for optimal segments"),
    TableColumn("method", "text", "key of the method, see `Analysis.errors`"),
    TableColumn("method_label", "text", "the method in words, as in `Analysis.table`"),
    TableColumn("segments", "integer", "of the method; missing if the method has none"),
    TableColumn("joint_error_rad", "number", "mean absolute error of a joint [rad]"),
    TableColumn("position_error_m", "number", "mean error of the hand's position [m]"),
    TableColumn("orientation_error_rad", "number", "mean error of the hand's orientation [rad]"),
    TableColumn("joint_error_unfiltered_rad", "number", "against the unfiltered recording [rad]"),
    TableColumn("position_error_unfiltered_m", "number", "against the unfiltered recording [m]"),
    TableColumn(
        "orientation_error_unfiltered_rad", "number", "against the unfiltered recording [rad]"
    ),
    TableColumn("computation_s", "number", "time that the whole recording took [s]"),
    TableColumn("settings", "text", "identifies the settings of the analysis"),
)

SYNERGY_COLUMNS = (
    *IDENTITY_COLUMNS,
    TableColumn("metric", "text", "of the geodesic, in words"),
    TableColumn("synergy", "integer", "number of the synergy in the recording, from 1"),
    TableColumn("start_sample", "integer", "index of its first sample, from 0"),
    TableColumn("stop_sample", "integer", "index of its last sample"),
    TableColumn("start_time_s", "number", "of its first sample, on the recording's clock [s]"),
    TableColumn("duration_s", "number", "[s]"),
    TableColumn("length", "number", "in the metric's unit: sqrt(kg) m, of straight lines rad"),
    TableColumn("mean_speed", "number", "length over duration [unit of the length per s]"),
    TableColumn("peak_speed", "number", "largest speed of its time law [unit of the length per s]"),
    TableColumn("joint_error_rad", "number", "mean over its samples and joints [rad]"),
    TableColumn("position_error_m", "number", "mean over its samples [m]"),
    TableColumn("orientation_error_rad", "number", "mean over its samples [rad]"),
    TableColumn("settings", "text", "identifies the settings of the analysis"),
)

FAILURE_COLUMNS = (
    *IDENTITY_COLUMNS,
    TableColumn("kind", "text", "file, solver, process, same (as another), missing or error"),
    TableColumn("reason", "text", "in one sentence"),
)

TABLES: dict[str, tuple[TableColumn, ...]] = {
    "recordings": RECORDING_COLUMNS,
    "synergies": SYNERGY_COLUMNS,
    "failures": FAILURE_COLUMNS,
}
