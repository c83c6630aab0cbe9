"""Recordings on robots: times, limits, energy against inverse kinematics, tracking in MuJoCo.

Usage: python benchmarks/retargeting.py [FILE[:SIDE] ...] [--robots NAME ...] [--mount] [--quick]

The bundled recording is added to the MMM motions; without a side, both arms are taken. Prints three
tables in Markdown: one row for each recording and robot; medians and worst by robot; and measures
of the synergies against inverse kinematics (QP) under the same limits. `--out FILE` writes them
and, beside it, all values as CSV.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
import warnings
from importlib.resources import as_file, files
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from pandas import DataFrame

import geodesic_ocp as go
from geodesic_ocp.execution.motion_measures import MotionMeasures
from geodesic_ocp.execution.trajectory_clearance import trajectory_clearance
from geodesic_ocp.model.formats.load_model import default_hand
from geodesic_ocp.retargeting.arm_result import compare_under_equal_limits
from geodesic_ocp.tables import markdown, new_table

ROBOTS = (
    *("panda", "xarm7", "ur5", "talos-left-arm", "talos-right-arm"),
    *("tiago-pro-left-arm", "tiago-pro-right-arm", "armar6-left", "armar6-right"),
    *("g1-left-arm", "g1-right-arm"),
)
LIMIT = 1.0 + 1e-6  # largest share of a limit
FINE = 20  # points per node of the grid at which limits are checked
COLUMNS = {
    "recording": "recording",
    "robot": "robot",
    "synergies": "synergies",
    "out_of_reach": "out of reach",
    "missed": "missed by more than the tolerance",
    "worst_miss": "largest miss [m]",
    "worst_angle": "largest miss [rad]",
    "gave_way": "gave way to clearance",
    "gave_way_by": "by [m]",
    "ratio": "time / person's",
    "worst_ratio": "worst synergy",
    "action_ratio": "action / QP's",
    "acceleration": "largest acceleration [rad/s^2]",
    "velocity_share": "velocity [limit]",
    "acceleration_share": "acceleration [limit]",
    "jerk_share": "jerk [limit]",
    "torque_share": "torque [limit]",
    "deviation": "hand from the paths [m]",
    "tracking": "tracking in MuJoCo [rad]",
    "tracking_hand": "of the hand [mm]",
    "clearance": "clearance [m]",
    "seconds": "processor seconds",
    "failure": "failures",
}
# Name, whether less is better, and the value.
MEASURES = {
    "action": ("action [J s]", True),
    "torque": ("torque, rms [N m]", True),
    "jerk": ("jerk, rms [rad/s^3]", True),
    "smoothness": ("smoothness of the hand (spectral arc length)", False),
    "elbow": ("elbow, beside the person's [arm length]", True),
    "position": ("hand, mean [m]", True),
    "rotation": ("hand, mean [rad]", True),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", nargs="*", help="MMM motions, FILE or FILE:left or FILE:right")
    parser.add_argument("--robots", nargs="+", default=ROBOTS, help="names, or files (URDF, ...)")
    parser.add_argument("--tolerance", type=float, default=1e-6)
    parser.add_argument("--quick", action="store_true", help="without MuJoCo and comparison")
    parser.add_argument("--mount", action="store_true", help="find where the base stands")
    parser.add_argument("--out", type=Path, help="file for the tables (Markdown)")
    parser.add_argument(
        "--check",
        action="store_true",
        help="fail if a pose is missed by more than the tolerance, a limit exceeded, or a motion "
        "not found",
    )
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    compared: list[dict[str, MotionMeasures]] = []
    models = {
        model.name: model
        for robot in options.robots
        for model in [go.load_model(robot, hand=default_hand(robot))]
    }
    for name, analysis in _recordings(options.files):
        for robot in models:
            row = {"recording": name, "robot": robot, "failure": ""}
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # about the file, and poses out of reach
                    row |= _run(analysis, models[robot], options, compared)
            except (go.NotConverged, ValueError) as error:
                traceback.print_exc()  # the other pairs are still to be measured
                row["failure"] = f"{type(error).__name__}: {error}"
            rows.append(row)
            print(*row.values(), sep=" | ", file=sys.stderr, flush=True)
    text = "\n".join(markdown(table) for table in _tables(rows, compared))
    print(text)
    if options.out:
        options.out.write_text(text, encoding="utf-8")
        every = new_table(tuple(COLUMNS), tuple(tuple(r.get(k, "") for k in COLUMNS) for r in rows))
        every.to_csv(options.out.with_suffix(".csv"))
    failures = [row for row in rows if row["failure"]]
    if options.check and failures:
        lines = (f"{row['recording']}, {row['robot']}: {row['failure']}" for row in failures)
        sys.exit("\n".join(lines))


def _recordings(given: list[str]) -> list[tuple[str, go.synergies.Analysis]]:
    found = []
    for each in given:
        file, _, side = each.partition(":")
        for one in (side,) if side else ("right", "left"):
            found.append((f"{Path(file).stem} {one}", _read(Path(file), one)))
    with as_file(files("geodesic_ocp") / "data" / "climb.csv") as file:
        found.append(("bundled left", _read(file, "left")))
    return found


def _read(file: Path, side: Any) -> go.synergies.Analysis:
    motion = go.read_motion(file, go.human_arm(side).joint_names)
    arm = go.human_arm(side, motion.subject.height or 1.75, motion.subject.mass or 70.0)
    return go.analyse(arm, motion)


def _run(
    analysis: go.synergies.Analysis,
    model: go.Model,
    options: argparse.Namespace,
    compared: list[dict[str, MotionMeasures]],
) -> dict[str, Any]:
    """One row of the table; measures are added to `compared`."""
    begin = time.process_time()
    aligned = go.retargeting.place_base(model, analysis).alignment if options.mount else None
    found = go.retarget(
        analysis, model, alignment=aligned, tolerance=options.tolerance, throw=False
    )
    row: dict[str, Any] = {"seconds": time.process_time() - begin}
    (arm,), planned = found.arms, found.planned
    robot, limits, gravity = arm.robot, arm.limits, arm.gravity
    distance, angle = np.max(list(arm.pose_errors.values()), axis=0)
    gave_way = [
        transfer.position_error
        for number, transfer in enumerate(arm.transfers, 1)
        if number in arm.missed and number not in arm.out_of_reach
    ]
    (shares,), (deviations,) = planned.usage, planned.path_deviation
    checked = found.check
    durations = np.diff(planned.robot_edges) / np.diff(planned.edges)
    row |= {
        "synergies": f"{len(analysis.synergies)} -> {len(arm.groups)}",
        "out_of_reach": len(arm.out_of_reach),
        "missed": len(arm.missed),
        "worst_miss": float(distance),
        "worst_angle": float(angle),
        "gave_way": len(gave_way),
        "gave_way_by": max(gave_way, default=0.0),
        "ratio": planned.stretch,
        "worst_ratio": float(durations.max()),
        "acceleration": float(checked.largest["acceleration"].max()),
        "deviation": max((each.hand for each in deviations), default=0.0),
    }
    for kind in ("velocity", "acceleration", "jerk", "torque"):
        row[f"{kind}_share"] = float(getattr(shares, kind).max())
    violation = max(_outside(robot, synergy.path) for synergy in arm.synergies)
    reasons = list(found.faults)
    if violation > 0.0:
        reasons.append(f"a path leaves the joint limits by {violation:.2g} rad")
    if shares.largest > LIMIT:
        reasons.append(f"{shares.largest:.6g} of a limit")
    row["failure"] = "; ".join(dict.fromkeys(reasons))
    if not options.quick:
        start = arm.baseline.positions[0]
        measures = compare_under_equal_limits(planned, analysis.motion, arm.mapping, starts=start)
        compared.append(measures)
        ours, theirs, *_ = measures.values()
        row["action_ratio"] = ours.action / theirs.action
        row |= _replayed(found.trajectory, robot, limits, gravity)
        least = trajectory_clearance(robot, found.trajectory).least
        row["clearance"] = np.nan if least is None else least
    return row


def _replayed(
    trajectory: Any, robot: go.Model, limits: go.execution.JointLimits, gravity: Any
) -> dict[str, float]:
    """Largest errors of the joints and of the hand in simulation, if MuJoCo is installed."""
    from geodesic_ocp.execution.replay import replay

    try:
        found = replay(trajectory, robot, limits=limits, gravity=gravity)
    except ImportError:
        return {}
    return {
        "tracking": float(found.largest_error.max()),
        "tracking_hand": 1e3 * float(found.position_error.max()),
    }


def _outside(model: go.Model, path: Any) -> float:
    """Largest excess over the joint limits anywhere on a path."""
    q = path(np.linspace(0.0, 1.0, FINE * path.grid.size))
    return max(0.0, float(np.maximum(model.lower - q, q - model.upper).max()))


def _tables(
    rows: list[dict[str, Any]], compared: list[dict[str, MotionMeasures]]
) -> list[DataFrame]:
    keys = [key for key in COLUMNS if any(row.get(key, "") != "" for row in rows)]
    shown = tuple(tuple(_entry(row.get(key)) for key in keys) for row in rows)
    tables = [new_table(tuple(COLUMNS[key] for key in keys), shown), _summary(rows)]
    return [*tables, _against(compared)] if compared else tables


def _entry(value: Any) -> Any:
    """Text or a number of a table."""
    return "-" if value is None or value == "" or value != value else value


def _summary(rows: list[dict[str, Any]]) -> DataFrame:
    """Medians and worst of all rows, and by robot."""
    worst = [
        *("worst_ratio", "acceleration", "velocity_share", "acceleration_share", "jerk_share"),
        *("torque_share", "deviation", "tracking", "tracking_hand"),
    ]
    header = (
        *("robot", "recordings", "failures", "time / person's, median", "worst"),
        "action / QP's, median",
        *(f"{COLUMNS[key]}, worst" for key in worst),
        *("clearance, least [m]", "processor seconds, median", "worst"),
    )
    names = ["all", *dict.fromkeys(row["robot"] for row in rows)]
    entries: list[tuple[str | int | float, ...]] = []
    for name in names:
        chosen = [row for row in rows if name in ("all", row["robot"])]

        def of(key: str, which: Any, chosen: list[dict[str, Any]] = chosen) -> str | float:
            values = [row[key] for row in chosen if key in row and not np.isnan(row[key])]
            return float(which(values)) if values else "-"

        failures = sum(bool(row["failure"]) for row in chosen)
        entries.append(
            (
                *(name, len(chosen), failures, of("ratio", median), of("ratio", max)),
                of("action_ratio", median),
                *(of(key, max) for key in worst),
                *(of("clearance", min), of("seconds", median), of("seconds", max)),
            )
        )
    return new_table(header, tuple(entries))


def _against(compared: list[dict[str, MotionMeasures]]) -> DataFrame:
    """In how many motions the synergies are better than each opponent, by measure."""
    ours = next(iter(compared[0]))
    header = ["measure", "synergies, median"]
    opponents = [name for name in compared[0] if name != ours]
    for name in opponents:
        header += [f"{name}, median", "synergies better"]
    entries: list[tuple[str | int | float, ...]] = []
    for key, (title, less) in MEASURES.items():
        sign = 1.0 if less else -1.0
        entry: list[str | int | float] = [title, _median([getattr(m[ours], key) for m in compared])]
        for name in opponents:
            pairs = [(getattr(m[ours], key), getattr(m[name], key)) for m in compared]
            known = [pair for pair in pairs if not np.isnan(pair).any()]
            better = sum(sign * mine < sign * other for mine, other in known)
            entry += [_median([other for _, other in known]), f"{better} of {len(known)}"]
        entries.append(tuple(entry))
    return new_table(tuple(header), tuple(entries))


def _median(values: list[float]) -> float | str:
    known = [value for value in values if not np.isnan(value)]
    return float(median(known)) if known else "-"


if __name__ == "__main__":
    main()
