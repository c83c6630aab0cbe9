"""BatchResult: what became of many recordings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from geodesic_ocp.studies.batch.outcome import RecordingOutcome
from geodesic_ocp.studies.tables.columns import Row
from geodesic_ocp.studies.tables.read_rows import read_rows


@dataclass(frozen=True, eq=False, repr=False)
class BatchResult:
    """What became of many recordings (`analyse_recordings`).

    Attributes:
        folder: of the tables and results.
        analysed: number of recordings that were analysed now.
        found: number of recordings with a result from before.
        failures: those without a result, each with its reason, in the order of the files.
        warned: those with a result whose analysis gave warnings.
        seconds: that the run took.
        files: of the tables and the summary.
        others: number of results in the folder that are not of these recordings, and in no table.
        notes: what the tables rest on, in sentences: subjects named after files, assumed heights.
    """

    folder: Path
    analysed: int
    found: int
    failures: tuple[RecordingOutcome, ...]
    warned: tuple[RecordingOutcome, ...]
    seconds: float
    files: tuple[Path, ...]
    others: int = 0
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"BatchResult({self.folder}: {self.counts})"

    @property
    def counts(self) -> str:
        """Numbers of recordings, in words."""
        parts = [f"{self.analysed} analysed"]
        if self.found:
            parts.append(f"{self.found} analysed before")
        missing = sum(outcome.kind == "missing" for outcome in self.failures)
        if missing:
            parts.append(f"{missing} not analysed yet")
        if len(self.failures) > missing or not missing:
            parts.append(f"{len(self.failures) - missing} left out")
        return ", ".join(parts)

    def recordings(self) -> list[Row]:
        """Rows of recordings.csv, one for each recording and method."""
        return read_rows(self.folder / "recordings.csv", "recordings")

    def synergies(self) -> list[Row]:
        """Rows of synergies.csv, one for each synergy."""
        return read_rows(self.folder / "synergies.csv", "synergies")
