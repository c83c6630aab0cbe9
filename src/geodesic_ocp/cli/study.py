"""geodesic-ocp study: statistics over the subjects of an analysis of many recordings."""

from __future__ import annotations

from pathlib import Path

from geodesic_ocp.cli.terminal import check_folder, print_written
from geodesic_ocp.drawing.study_figures import study_figures
from geodesic_ocp.studies.study import study as study_tables
from geodesic_ocp.studies.study_result import as_measure
from geodesic_ocp.tables import text


def study(
    source: list[Path],
    /,
    *,
    measure: str = "joint",
    against: str | None = None,
    by: str | None = None,
    metadata: Path | None = None,
    out: Path | None = None,
) -> None:
    """Compute means, tests and synergies over the subjects of many recordings.

    Args:
        source: output folder of geodesic-ocp analyse, or its tables (recordings.csv,
            synergies.csv); several are joined.
        measure: quantity that is tested: joint, position or orientation (errors), these with
            _unfiltered, segments or segments_per_second.
        against: method, or condition of --by, with which the others are compared; default: straight
            lines on the same segments.
        by: column whose values are conditions, such as condition, trial or side.
        metadata: CSV with the column file and others, such as condition, for --by.
        out: folder for tables and figures.
    """
    check_folder(out)
    tested = as_measure(measure)
    found = study_tables(source[0] if len(source) == 1 else source, by=by, metadata=metadata)
    # Files first: the reader of what is printed, such as `head`, may stop early.
    files: list[Path] = []
    if out is not None:
        figures = study_figures(found, measure, against)
        files = found.save(out, measure=measure, against=against, figures=figures)
    print(found)
    for note in found.notes:
        print(f"note: {note}")
    print(f"\n{text(found.means())}")
    tests = found.tests(measure, against)
    references = list(tests["against"].unique())
    hidden = ["sign test p"]
    kind = "paired tests"
    if len(references) == 1:
        hidden = [*hidden, "against"]
        kind = f"against {references[0]}"
    print(f"\n{tested.header}, {kind}\n\n{text(tests.drop(columns=hidden))}")
    if found.synergies is not None and len(found.synergies):
        print(f"\n{text(found.synergy_statistics())}")
    if found.profiles is not None:
        print(f"\njoint inertia of each subject\n\n{text(found.joint_inertia())}")
        print(f"\n{text(found.scaling())}")
    if files:
        print()
    print_written(files)
