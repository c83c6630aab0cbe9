"""Options of the command line for the analysis of many recordings."""

from __future__ import annotations

import argparse
import glob
from pathlib import Path


def add_many_options(command: argparse.ArgumentParser) -> None:
    """Add the options that `analyse` has for many recordings."""
    group = command.add_argument_group("many recordings")
    group.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        help="number of processes (default: one for each core)",
    )
    group.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="of a Dask cluster, such as tcp://host:8786, whose workers see the same files; needs"
        " the extra cluster",
    )
    group.add_argument(
        "--recursive",
        action="store_true",
        help="also files in the folders within a folder, but not results of analyses",
    )
    group.add_argument(
        "--subjects",
        type=Path,
        metavar="FILE",
        help="CSV file with the columns file and subject, and if known trial, height [m] and"
        " mass [kg]",
    )
    group.add_argument(
        "--subject-from",
        metavar="PATTERN",
        help='of the paths without their suffix, such as "{subject}/{trial}" or'
        ' "{subject}_*_{trial}" (default: the subject in the file, or the name of its folder)',
    )
    group.add_argument(
        "--time-limit",
        type=float,
        metavar="SECONDS",
        help="leave a recording out that takes longer; not with --scheduler",
    )
    group.add_argument(
        "--tables-only",
        action="store_true",
        help="only write the tables from the results so far, also while another run works",
    )


_OF_MANY = (
    "jobs",
    "scheduler",
    "recursive",
    "subjects",
    "subject_from",
    "time_limit",
    "tables_only",
)


def are_many(options: argparse.Namespace) -> bool:
    """Whether many recordings are to be analysed, with tables of all and a result file for each.

    Raises:
        ValueError: options that have no effect on what is given.
    """
    (first, *others) = options.file
    path = Path(first)
    many = others or path.is_dir() or (glob.has_magic(first) and not path.exists())
    given = [name for name in _OF_MANY if getattr(options, name) not in (None, False)]
    if not many and not given:
        return False
    if options.curve:
        raise ValueError("--curve is of one recording, not of many")
    if options.out is None:
        what = "several recordings need" if many else f"--{given[0].replace('_', '-')} needs"
        raise ValueError(f"{what} --out, the folder of their results")
    if options.jobs is not None and options.scheduler is not None:
        raise ValueError("give either --jobs, processes of this computer, or --scheduler")
    if options.time_limit is not None and options.scheduler is not None:
        raise ValueError("--time-limit is for processes of this computer, not for --scheduler")
    return True
