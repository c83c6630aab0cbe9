"""What becomes of a recording of many, as small values that travel between processes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from geodesic_ocp.studies.batch.analysis_settings import AnalysisSettings
from geodesic_ocp.studies.batch.sources.recording_source import RecordingSource

OutcomeKind = Literal["analysed", "found", "file", "solver", "process", "same", "missing", "error"]


@dataclass(frozen=True, repr=False)
class RecordingTask:
    """A recording that is to be analysed.

    Attributes:
        source: of the recording.
        settings: of the analysis.
        folder: of the output, absolute.
        key: of the result, see `result_key`.
        time_limit: of the process that analyses it [s], or None.
    """

    source: RecordingSource
    settings: AnalysisSettings
    folder: Path
    key: str
    time_limit: float | None = None

    def __repr__(self) -> str:
        return f"RecordingTask({self.source.name!r}, {self.key[:8]})"


@dataclass(frozen=True, repr=False)
class RecordingOutcome:
    """What became of a recording.

    Attributes:
        source: of the recording.
        kind: "analysed" now, or "found" with a result from before; or why there is none: the
            "file" cannot be used, a "solver" failed, its "process" died, its motion is the "same"
            as another's, it is "missing" as nobody has analysed it yet, or another "error".
        text: the result, or the reason, in one sentence.
        key: of the result; empty if there is none.
        warnings: that the analysis gave.
        seconds: that the analysis took.
    """

    source: RecordingSource
    kind: OutcomeKind
    text: str = ""
    key: str = ""
    warnings: tuple[str, ...] = ()
    seconds: float = 0.0

    @property
    def success(self) -> bool:
        """Whether there is a result."""
        return self.kind in ("analysed", "found")

    def __str__(self) -> str:
        """As a line of text."""
        return f"{self.source.name}: {self.text}"

    def __repr__(self) -> str:
        return f"RecordingOutcome({self.source.name!r}, {self.kind}: {self.text})"
