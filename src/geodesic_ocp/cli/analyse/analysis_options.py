"""Options of the command line for the filter, the metric and the segments of an analysis."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import get_args

from geodesic_ocp.cli.analyse.recording_options import stated
from geodesic_ocp.manifold.metrics import METRIC_NAMES
from geodesic_ocp.studies.batch.analysis_settings import AnalysisSettings
from geodesic_ocp.synergies.segment_costs import Measure

# By the kind of segments, options that have no effect on the other kind, with their defaults.
_NUMBER: dict[str, object] = {"count": None, "penalty": None, "error": None}
_DEFAULTS: dict[str, dict[str, object]] = {
    "online": {
        "threshold": 0.6,
        "rest_speed": 0.02,
        "rest_duration": 0.1,
        "min_duration": 0.1,
        "hysteresis": 0.1,
    },
    "optimal": {**_NUMBER, "measure": "joint", "spacing": 0.05, "max_duration": 2.0},
}


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
        "--no-filter",
        action="store_true",
        help="take the recording as it is, as it has been filtered before",
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
        help="online: cut where the motion leaves its geodesic; optimal: cut where the error"
        " becomes least (default: %(default)s)",
    )
    for name, unit, text in (
        (
            "threshold",
            "RAD",
            "angle [rad] between motion and geodesic at which a new synergy begins",
        ),
        ("rest-speed", "FRACTION", "the arm rests below this fraction of its largest speed"),
        (
            "rest-duration",
            "SECONDS",
            "duration [s] of the shortest rest that is a segment of its own",
        ),
        (
            "min-duration",
            "SECONDS",
            "duration [s] of the shortest segment that is not a rest; 0 allows any",
        ),
        (
            "hysteresis",
            "RAD",
            "angle [rad] beyond the threshold that a change of direction must reach",
        ),
    ):
        _add_segment_option(group, "online", name, text, unit)
    wanted = group.add_mutually_exclusive_group()
    wanted.add_argument("--count", type=int, help="number of segments; needs --segments optimal")
    wanted.add_argument(
        "--penalty",
        type=float,
        metavar="ERROR",
        help="mean error that a further segment must save; needs --segments optimal",
    )
    wanted.add_argument(
        "--error",
        type=float,
        help="largest mean error, with as few segments as possible; needs --segments optimal",
    )
    default = _DEFAULTS["optimal"]["measure"]
    group.add_argument(
        "--measure",
        choices=get_args(Measure),
        help="error that becomes least, of the joints [rad] or of the hand [m, rad]"
        f" (default: {default}); needs --segments optimal",
    )
    for name, text in (
        ("spacing", "time [s] between possible cuts, which then move to the best sample nearby"),
        ("max-duration", "duration [s] of the longest segment allowed"),
    ):
        _add_segment_option(group, "optimal", name, text, "SECONDS")

    command.add_argument(
        "--out",
        type=Path,
        help="folder for tables, figures, synergies, and a robot's trajectory",
    )


def _add_segment_option(
    group: argparse._ArgumentGroup, kind: str, name: str, text: str, unit: str
) -> None:
    default = _DEFAULTS[kind][name.replace("-", "_")]
    needs = "; needs --segments optimal" if kind == "optimal" else ""
    described = f"{text} (default: {default}){needs}"
    group.add_argument(f"--{name}", type=float, metavar=unit, help=described)


def check_options(options: argparse.Namespace) -> None:
    """Check what does not depend on the recording, and set the defaults of what is not given.

    Raises:
        ValueError: options that exclude each other.
    """
    if options.segments == "optimal" and all(getattr(options, name) is None for name in _NUMBER):
        raise ValueError("--segments optimal needs one of --count, --penalty and --error")
    for kind, defaults in _DEFAULTS.items():
        given = [name for name in defaults if getattr(options, name) is not None]
        if given and options.segments != kind:
            named = " and ".join(f"--{name.replace('_', '-')}" for name in given)
            raise ValueError(f"{named} need{'s' if len(given) == 1 else ''} --segments {kind}")
        for name, default in defaults.items():
            if name not in given:
                setattr(options, name, default)
    if options.armature is not None and options.metric != "joint-inertia":
        raise ValueError(
            f"--armature is the joint inertia of --metric joint-inertia, not of {options.metric}"
        )


def settings_of(options: argparse.Namespace) -> AnalysisSettings:
    """The settings of an analysis by the options, after `check_options`.

    Raises:
        ValueError: an option out of range.
    """
    return AnalysisSettings(
        height=getattr(options, "height", None),
        mass=getattr(options, "mass", None),
        resample=getattr(options, "resample", None),
        cutoff=options.cutoff,
        duration=options.savitzky_golay,
        unfiltered=options.no_filter,
        metric=options.metric,
        armature=options.armature,
        segments=options.segments,
        threshold=options.threshold,
        rest=options.rest_speed,
        rest_duration=options.rest_duration,
        min_duration=options.min_duration,
        hysteresis=options.hysteresis,
        count=options.count,
        penalty=options.penalty,
        error=options.error,
        measure=options.measure,
        spacing=options.spacing,
        max_duration=options.max_duration,
        **stated(options),
    )
