"""Options of the command line for the filter, the metric and the segments of an analysis."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import get_args

from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.synergies.analyse import Progress
from geodesic_ocp.synergies.analysis_metrics import METRIC_NAMES, as_analysis_metric
from geodesic_ocp.synergies.segmentation.segment_costs import Measure
from geodesic_ocp.synergies.segmentation.segment_optimal import segment_optimal
from geodesic_ocp.trajectory.motion import Motion

_OPTIMAL_ONLY = ("count", "penalty", "error")


def add_analysis_options(command: argparse.ArgumentParser) -> None:
    """Add the options that `analyse`, `retarget` and `demo` have in common."""
    group = command.add_argument_group("filter")
    chosen = group.add_mutually_exclusive_group()
    chosen.add_argument(
        "--cutoff",
        type=float,
        metavar="HZ",
        help="cut-off frequency [Hz] (default: chosen from the noise floor of the recording)",
    )
    chosen.add_argument(
        "--savitzky-golay",
        type=float,
        metavar="SECONDS",
        help="a Savitzky-Golay filter of order 2 with a window of this duration [s]; in the paper"
        " 0.21",
    )
    chosen.add_argument(
        "--no-filter", action="store_true", help="for recordings that have been filtered"
    )

    group = command.add_argument_group("metric")
    group.add_argument(
        "--metric",
        default="joint-inertia",
        metavar="NAME",
        help=f"{', '.join(METRIC_NAMES)}, or a file that geodesic-ocp fit wrote (.json); kinetic"
        " is the kinetic energy without joint inertia (default: %(default)s)",
    )
    group.add_argument(
        "--armature",
        type=float,
        metavar="X",
        help="joint inertia of every joint [kg m^2] (default: 0.03 m r^2, with the mass m and the"
        " reach r of the arm)",
    )

    group = command.add_argument_group("segments")
    group.add_argument(
        "--segments",
        choices=("online", "optimal"),
        default="online",
        help="cut where the motion leaves its geodesic, or where the error becomes least"
        " (default: %(default)s)",
    )
    group.add_argument(
        "--threshold",
        type=float,
        default=0.6,
        metavar="RAD",
        help="online: angle at which a new synergy begins [rad] (default: %(default)s)",
    )
    for name, default, unit, text in (
        ("rest-speed", 0.02, "FRACTION", "fraction of the largest speed below which the arm rests"),
        ("rest-duration", 0.1, "SECONDS", "the shortest rest that is a segment of its own [s]"),
        ("min-duration", 0.1, "SECONDS", "the shortest segment that is not a rest [s]; 0 for any"),
        ("hysteresis", 0.1, "RAD", "angle above the threshold that a turn must reach [rad]"),
    ):
        group.add_argument(
            f"--{name}",
            type=float,
            default=default,
            metavar=unit,
            help=f"online: {text} (default: %(default)s)",
        )
    wanted = group.add_mutually_exclusive_group()
    wanted.add_argument("--count", type=int, help="optimal: number of segments")
    wanted.add_argument(
        "--penalty", type=float, help="optimal: mean error that a further segment must save"
    )
    wanted.add_argument("--error", type=float, help="optimal: largest mean error")
    group.add_argument(
        "--measure",
        choices=get_args(Measure),
        default="joint",
        help="optimal: which error, of the joints [rad] or of the hand [m, rad]"
        " (default: %(default)s)",
    )
    for name, default, text in (
        ("spacing", 0.05, "time between possible cuts, before they are refined to the sample"),
        ("max-duration", 2.0, "of the longest segment"),
    ):
        group.add_argument(
            f"--{name}",
            type=float,
            default=default,
            metavar="SECONDS",
            help=f"optimal: {text} [s] (default: %(default)s)",
        )

    command.add_argument(
        "--out",
        type=Path,
        help="folder for tables, figures, synergies, and a robot's trajectory",
    )


def check_options(options: argparse.Namespace) -> None:
    """Check what does not depend on the recording.

    Raises:
        ValueError: options that exclude each other.
    """
    given = [name for name in _OPTIMAL_ONLY if getattr(options, name) is not None]
    if options.segments == "optimal" and not given:
        raise ValueError("--segments optimal needs one of --count, --penalty and --error")
    if options.segments == "online" and given:
        raise ValueError(f"--{given[0]} needs --segments optimal")
    if options.armature is not None and options.metric != "joint-inertia":
        raise ValueError(
            f"--armature is the joint inertia of --metric joint-inertia, not of {options.metric}"
        )


def filtered(options: argparse.Namespace, motion: Motion) -> Motion:
    """The motion with velocities, by the filter of the options."""
    if options.no_filter:
        return replace(motion, velocity=motion(motion.time, 1))
    return motion.filtered(cutoff=options.cutoff, duration=options.savitzky_golay)


def chosen_metric(options: argparse.Namespace, model: Model) -> Metric:
    """The metric that --metric names, for a model that has the armature of --armature.

    Raises:
        ValueError: it is neither a name nor a file that `save_metric` wrote.
    """
    name = options.metric
    if name == "joint-inertia" and options.armature is not None:
        return as_analysis_metric("kinetic", model)  # also with --armature 0
    if name in METRIC_NAMES:
        return as_analysis_metric(name, model)
    if not Path(name).is_file():
        raise ValueError(
            f"--metric must be {', '.join(METRIC_NAMES)} or a file, and there is no file {name!r}"
        )
    from geodesic_ocp.fitting.metric_file import load_metric  # with a solver, which others save

    return load_metric(name, model)


def chosen_segments(
    options: argparse.Namespace, metric: Metric, motion: Motion, model: Model, progress: Progress
) -> list[tuple[int, int]] | None:
    """The optimal segments of a filtered motion; None for those of the online rule."""
    if options.segments == "online":
        return None
    return segment_optimal(
        metric,
        motion,
        count=options.count,
        penalty=options.penalty,
        error=options.error,
        measure=options.measure,
        model=model,
        spacing=options.spacing,
        max_duration=options.max_duration,
        progress=progress,
    )
