"""`geodesic-ocp study`: statistics over subjects of an analysis of many recordings."""

from __future__ import annotations

import argparse

from geodesic_ocp.cli.analyse.recording import check_folder
from geodesic_ocp.studies.study.statistics.measures import as_measure
from geodesic_ocp.studies.study.study import study


def study_tables(options: argparse.Namespace) -> None:
    """Print means, tests and synergies, and write all tables and figures.

    Raises:
        RecordingError: the tables cannot be read.
        ValueError: an unknown measure, method or column.
    """
    check_folder(options.out)
    measure = as_measure(options.measure)
    source = options.source[0] if len(options.source) == 1 else options.source
    found = study(source, by=options.by, metadata=options.metadata)
    # Files first: the reader of what is printed, such as `head`, may stop early.
    files = []
    if options.out is not None:
        files = found.save(options.out, measure=measure.name, against=options.against)
    print(found)
    for note in found.notes:
        print(f"note: {note}")
    print(f"\n{found.means_table()}")
    print(f"\n{measure.header}\n\n{found.test_table(measure.name, options.against)}")
    if found.synergies:
        print(f"\n{found.synergy_table()}")
    if files:
        print()
    for file in files:
        print(f"wrote {file}")
