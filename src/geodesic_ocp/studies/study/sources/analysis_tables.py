"""The tables of analyses that are in memory."""

from __future__ import annotations

from collections.abc import Sequence

from geodesic_ocp.studies.study.sources.source import StudyTables
from geodesic_ocp.studies.tables.analysis_rows import recording_rows, synergy_rows
from geodesic_ocp.studies.tables.columns import Row
from geodesic_ocp.synergies.analyse import Analysis


def analysis_tables(
    analyses: Sequence[Analysis],
    names: Sequence[str] | None,
    subjects: Sequence[str] | None,
    conditions: Sequence[str] | None,
) -> StudyTables:
    """Rows of all analyses, as those of a folder.

    Args:
        analyses: one of each recording.
        names: of the recordings; by default they are numbered.
        subjects: the persons; by default those of the motions.
        conditions: of the recordings, column "condition".

    Raises:
        ValueError: names, subjects or conditions are not one for each analysis, or names are equal.
    """
    count = len(analyses)
    names = [str(k) for k in range(1, count + 1)] if names is None else names
    if subjects is None:
        subjects = [each.motion.subject.name or "" for each in analyses]
    for what, given in (("names", names), ("subjects", subjects), ("conditions", conditions)):
        if given is not None and (isinstance(given, str) or len(given) != count):
            raise ValueError(f"{what} must be {count}, one for each analysis, got {given!r}")
    if len(set(names)) < count:
        raise ValueError(f"names must differ, got {list(names)!r}")
    recordings: list[Row] = []
    synergies: list[Row] = []
    for k, analysis in enumerate(analyses):
        identity: Row = {"recording": str(names[k]), "subject": str(subjects[k])}
        if conditions is not None:
            identity["condition"] = str(conditions[k])
        recordings += [identity | row for row in recording_rows(analysis)]
        synergies += [identity | row for row in synergy_rows(analysis)]
    return StudyTables(tuple(recordings), tuple(synergies))
