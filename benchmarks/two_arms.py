"""Synergies of two arms: each apart, both as one system, and with the trunk, on recordings.

For each recording and metric the cuts are those of the online rule at its default threshold, and
the best ones for some numbers of segments (`optimal_segmentations`), so that the systems can be
compared at equal numbers of segments. Errors of the joints are those of the 14 joints of the arms.
Errors of the hands are in the room: for arms alone with the observed trunk, for the upper body with
the predicted one; those that its arms alone make are in brackets.

With --robots, each recording on bodies with both arms and a waist instead: time over the person's,
slowest synergy, poses missed by more than the tolerance and the largest miss of all, motion of the
waist, least distance of links, and CPU time of `retarget`.

With --logs, log maps between random configurations first: how many are found, and how long they
take.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import geodesic_ocp as go
from geodesic_ocp.manifold.metrics import with_joint_inertia

SIDES = ("right", "left")
MASS = 70.0  # [kg], without effect on geodesics
METRICS: dict[str, Callable[[go.Model], go.KineticEnergy]] = {
    "joint inertia": lambda model: go.KineticEnergy(with_joint_inertia(model)),
    "kinetic": lambda model: go.KineticEnergy(model),
}


@dataclass(frozen=True)
class Found:
    """Segments and predicted motion of one model, the time they took, and what failed."""

    segments: int
    predicted: go.Motion
    seconds: float
    failed: str = ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="*", type=Path, help="MMM files of whole bodies")
    parser.add_argument("--counts", type=int, nargs="*", default=[], help="numbers of segments")
    parser.add_argument("--spacing", type=float, default=0.1, help="of candidates for cuts [s]")
    parser.add_argument("--metrics", nargs="+", choices=METRICS, default=list(METRICS))
    parser.add_argument("--logs", type=int, default=0, help="number of random log maps")
    parser.add_argument("--robots", nargs="*", default=[], help="such as g1, talos, armar6")
    options = parser.parse_args()
    if options.robots:
        _on_robots(options.recordings, options.robots)
        return
    if options.logs:
        _random_logs(options.logs)
    for file in options.recordings:
        motion = go.read_motion(file)
        height = float(motion.subject.height or 0.0)
        person = go.human_upper_body(height, MASS)
        arms = [go.human_arm(side, height, MASS) for side in SIDES]
        systems = {
            "arms apart": arms,
            "both arms": [go.model.combine(*arms)],
            "upper body": [person],
        }
        motion = motion.select(person.joint_names).filtered()
        print(f"\n## {file.stem}: {motion.duration:.1f} s, {motion.filter}\n", flush=True)
        print(
            "| metric | system | cuts | segments | joints [rad] | right hand | left hand | time |"
        )
        print("| --- | --- | --- | ---: | ---: | ---: | ---: | ---: |")
        for metric in options.metrics:
            for system, models in systems.items():
                found = [_by_rule(METRICS[metric](model), motion) for model in models]
                _report((metric, system, "rule"), found, models, arms, motion)
            for system, models in systems.items():
                if options.counts:
                    best = [
                        _best(METRICS[metric](model), motion, options.counts, options.spacing)
                        for model in models
                    ]
                    for found in zip(*best, strict=True):
                        _report((metric, system, "best"), found, models, arms, motion)


def _on_robots(files: Sequence[Path], robots: Sequence[str]) -> None:
    """Print a table of retargetings."""
    print("| recording | robot | time | slowest | missed | largest miss | waist | near | CPU [s] |")
    print("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for file in files:
        recording = go.read_recording(file, "both")
        analysis = go.analyse(recording.model, recording.motion)
        for name in robots:
            robot = go.load_model(name)
            begin = time.process_time()
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of what is in the table
                result = go.retarget(analysis, robot, throw=False)
            seconds = time.process_time() - begin
            (body,) = result.bodies
            slowest = max(
                each.duration / body.seconds(group)
                for group, each in zip(body.groups, body.synergies, strict=True)
                if group.kind != "rest"
            )
            errors = np.array([each for arm in result.arms for each in arm.pose_errors.values()])
            missed = sum(len(arm.missed) for arm in result.arms)
            waist = [robot.joint_names.index(joint) for joint in robot.shared_joints]
            moved = np.ptp(result.trajectory.positions[:, waist], axis=0)
            units = [robot.units[joint] for joint in waist]
            turned = ", ".join(f"{one:.2f} {unit}" for one, unit in zip(moved, units, strict=True))
            distance, angle = errors.max(axis=0)
            near = result.check.clearance
            row = (
                *(file.stem, name, f"{result.stretch:.2f}", f"{slowest:.2f}"),
                *(f"{missed} of {len(errors)}", f"{1000 * distance:.1f} mm, {angle:.3f} rad"),
                *(turned, "-" if near is None else f"{1000 * near:.1f} mm", f"{seconds:.0f}"),
            )
            print(f"| {' | '.join(row)} |", flush=True)
            for fault in result.unfit:
                print(f"  {fault}", flush=True)


def _random_logs(count: int, seed: int = 1) -> None:
    """Print a table of log maps between configurations in half and in all of the joints' range."""
    right, left = (go.human_arm(side) for side in SIDES)
    systems = {
        "one arm": right,
        "both arms": go.model.combine(right, left),
        "upper body": go.human_upper_body(),
    }
    print("| metric | system | range | found | median [ms] | longest [ms] |")
    print("| --- | --- | --- | ---: | ---: | ---: |")
    for name, metric_of in METRICS.items():
        for system, model in systems.items():
            metric = metric_of(model)
            go.log(metric, np.zeros(model.dof), np.full(model.dof, 0.01))  # compiles
            for part in (0.5, 1.0):
                rng, middle = np.random.default_rng(seed), (model.lower + model.upper) / 2.0
                seconds, found = [], 0
                for _ in range(count):
                    ends = rng.uniform(model.lower, model.upper, (2, model.dof))
                    begin = time.perf_counter()
                    try:
                        go.log(metric, *(middle + part * (ends - middle)))
                        found += 1
                    except go.NotConverged:
                        pass
                    seconds.append(1000.0 * (time.perf_counter() - begin))
                row = name, system, f"{part:g}", f"{found} of {count}"
                times = f"{np.median(seconds):.1f} | {max(seconds):.0f}"
                print(f"| {' | '.join(row)} | {times} |", flush=True)


def _by_rule(metric: go.KineticEnergy, motion: go.Motion) -> Found:
    """Cuts of the online rule; the time is without compiling."""
    motion = motion.select(metric.model.joint_names)
    go.synergies.reconstruct(metric, motion, go.segment(metric, motion))
    begin = time.perf_counter()
    segments = go.segment(metric, motion)
    predicted = go.synergies.reconstruct(metric, motion, segments).predicted
    return Found(len(segments), predicted, time.perf_counter() - begin)


def _best(
    metric: go.KineticEnergy, motion: go.Motion, counts: Sequence[int], spacing: float
) -> list[Found]:
    """Best cuts for each number; the time is that of all numbers together."""
    motion = motion.select(metric.model.joint_names)
    begin = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        cuts = go.synergies.optimal_segmentations(metric, motion, spacing=spacing)
    seconds = time.perf_counter() - begin
    failed = "; ".join(str(warning.message) for warning in caught)
    return [Found(count, cuts.predicted(count, refined=False), seconds, failed) for count in counts]


def _report(
    title: tuple[str, str, str],
    found: Sequence[Found],
    models: Sequence[go.Model],
    arms: Sequence[go.Model],
    motion: go.Motion,
) -> None:
    """Print a row."""
    joints, hands = [], []
    for side, arm in enumerate(arms):
        number = side if len(found) > 1 else 0
        predicted = found[number].predicted
        own = go.synergies.motion_errors(arm, motion, predicted)
        joints.append(own.joint)
        shown = f"{1000 * own.position:.1f} mm, {own.orientation:.3f} rad"
        if models[number].dof == 20:
            whole = go.synergies.motion_errors(models[number], motion, predicted).hands[side]
            shown = (
                f"{1000 * whole.position:.1f} mm, {whole.orientation:.3f} rad "
                f"({1000 * own.position:.1f}, {own.orientation:.3f})"
            )
        hands.append(shown)
    segments = " + ".join(str(each.segments) for each in found)
    seconds = sum(each.seconds for each in found)
    taken = ", ".join([f"{seconds:.2f} s", *(each.failed for each in found if each.failed)])
    row = *title, segments, f"{np.mean(joints):.4f}", *hands, taken
    print(f"| {' | '.join(row)} |", flush=True)


if __name__ == "__main__":
    main()
