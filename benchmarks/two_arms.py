"""Synergies of two arms: each apart, both as one system, and with the trunk, on recordings.

For each recording and metric the cuts are those of the online rule at its default threshold, and
the best ones for some numbers of segments (`optimal_segmentations`), so that the systems can be
compared at equal numbers of segments. Errors of the joints are those of the 14 joints of the arms.
Errors of the hands are in the room: for arms alone with the observed trunk, for the upper body with
the predicted one; those that its arms alone make are in brackets.

Then the part that the motion of the trunk has in the forces at the joints of the arms. With
--logs, log maps between random configurations first: how many are found, and how long they take.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
import scipy
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.model.human.anthropometry import trunk
from geodesic_ocp.model.human.human_upper_body import human_upper_body
from geodesic_ocp.synergies.joint_inertia import with_joint_inertia

KIT = Path(__file__).resolve().parents[2] / "shared" / "data" / "kit"
RECORDINGS = (
    "Trial_75",
    "take_book_from_shelf_right_arm_02",
    "take_book_from_shelf_right_arm_03",
    "hand_to_mouth_right_arm_01",
    "hand_to_mouth_right_arm_02",
)
SIDES = ("right", "left")
MASS = 70.0  # [kg], without effect on geodesics
CUTOFFS = (None, 3.0)  # [Hz]; accelerations amplify noise
METRICS: dict[str, Callable[[go.Model], go.KineticEnergy]] = {
    "joint inertia": lambda model: go.KineticEnergy(with_joint_inertia(model)),
    "kinetic": lambda model: go.KineticEnergy(model),
}


@dataclass(frozen=True)
class Found:
    """Segments and predicted motion of one model, the time they took, and log maps that failed."""

    segments: int
    predicted: go.Motion
    seconds: float
    failed: int = 0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="*", default=list(RECORDINGS))
    parser.add_argument("--counts", type=int, nargs="*", default=[], help="numbers of segments")
    parser.add_argument("--spacing", type=float, default=0.1, help="of candidates for cuts [s]")
    parser.add_argument("--metrics", nargs="+", choices=METRICS, default=list(METRICS))
    parser.add_argument("--logs", type=int, default=0, help="number of random log maps")
    options = parser.parse_args()
    if options.logs:
        _random_logs(options.logs)
    for name in options.recordings:
        motion = go.read_motion(KIT / f"{name}.xml")
        height = float(motion.subject.height or 0.0)
        person = human_upper_body(height, MASS)
        arms = [go.human_arm(side, height, MASS) for side in SIDES]
        systems = {"arms apart": arms, "both arms": [go.combine(*arms)], "upper body": [person]}
        motion = motion.select(person.joint_names).filtered()
        print(f"\n## {name}: {motion.duration:.1f} s, {motion.filter}\n", flush=True)
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
        print()
        for side, arm in zip(SIDES, arms, strict=True):
            for cutoff in CUTOFFS:
                print(f"{side} arm: {base_motion(arm, side, motion, height, cutoff)}", flush=True)


def _random_logs(count: int, seed: int = 1) -> None:
    """Print a table of log maps between configurations in half and in all of the joints' range."""
    right, left = (go.human_arm(side) for side in SIDES)
    systems = {
        "one arm": right,
        "both arms": go.combine(right, left),
        "upper body": human_upper_body(),
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
    go.reconstruct(metric, motion, go.segment(metric, motion))
    begin = time.perf_counter()
    segments = go.segment(metric, motion)
    predicted = go.reconstruct(metric, motion, segments).predicted
    return Found(len(segments), predicted, time.perf_counter() - begin)


def _best(
    metric: go.KineticEnergy, motion: go.Motion, counts: Sequence[int], spacing: float
) -> list[Found]:
    """Best cuts for each number; the time is that of all numbers together."""
    motion = motion.select(metric.model.joint_names)
    begin = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # failures are counted here
        cuts = go.optimal_segmentations(metric, motion, spacing=spacing)
    seconds = time.perf_counter() - begin
    failed = cuts._costs.failures
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
        own = go.evaluate(arm, motion, predicted)
        joints.append(own.joint)
        shown = f"{1000 * own.position:.1f} mm, {own.orientation:.3f} rad"
        if models[number].dof == 20:
            whole = go.evaluate(models[number], motion, predicted).hands[side]
            shown = (
                f"{1000 * whole.position:.1f} mm, {whole.orientation:.3f} rad "
                f"({1000 * own.position:.1f}, {own.orientation:.3f})"
            )
        hands.append(shown)
    segments = " + ".join(str(each.segments) for each in found)
    seconds = sum(each.seconds for each in found)
    failed = sum(each.failed for each in found)
    taken = f"{seconds:.2f} s" + (f", {failed} failed" if failed else "")
    row = *title, segments, f"{np.mean(joints):.4f}", *hands, taken
    print(f"| {' | '.join(row)} |", flush=True)


def base_motion(
    arm: go.Model, side: str, motion: go.Motion, height: float, cutoff: float | None
) -> str:
    """The part of the shoulder's motion in the forces at an arm's joints, without gravity.

    The forces of the recorded motion, with the thorax moving as recorded and at rest. Their size is
    that in the metric's dual, sqrt(f' G^-1 f), with and without the default joint inertia.
    """
    assert motion.trunk is not None
    moving, frame = _on_a_moving_base(arm, side, height), motion.trunk
    mean = Rotation.from_matrix(frame.rotations).mean()
    turned = (mean.inv() * Rotation.from_matrix(frame.rotations)).as_euler("XYZ")
    placed = (frame.positions - frame.positions.mean(axis=0)) @ mean.as_matrix()
    base = go.Motion(motion.time, np.hstack([placed, turned]), tuple("xyzabc")).filtered(
        cutoff=cutoff
    )
    joints = motion.select(arm.joint_names).filtered(cutoff=cutoff)
    assert base.velocity is not None
    assert joints.velocity is not None
    q, v = np.hstack([base.q, joints.q]), np.hstack([base.velocity, joints.velocity])
    a = scipy.interpolate.CubicSpline(motion.time, v)(motion.time, 1)
    at_rest = np.array([*[0.0] * 6, *[1.0] * arm.dof])
    data = moving.createData()
    forces = np.array([pin.rnea(moving, data, *state)[6:] for state in zip(q, v, a, strict=True)])
    fixed = np.array(
        [
            pin.rnea(moving, data, x, y * at_rest, z * at_rest)[6:]
            for x, y, z in zip(q, v, a, strict=True)
        ]
    )
    speed = np.linalg.norm(base.velocity[:, :3], axis=1)
    turn = np.linalg.norm(base.velocity[:, 3:], axis=1)
    parts = []
    for name in METRICS:
        model = METRICS[name](arm).model
        added = np.outer(np.ones(len(a)), model.armature) * a[:, 6:]
        inverse = np.array([np.linalg.inv(model.mass_matrix(row)) for row in joints.q])

        def size(force: np.ndarray, inverse: np.ndarray = inverse) -> float:
            return float(np.sqrt(np.mean(np.einsum("ki,kij,kj->k", force, inverse, force))))

        share = size(forces - fixed) / size(fixed + added)
        parts.append(f"{100 * share:.1f} % ({name})")
    return (
        f"below {'the noise' if cutoff is None else f'{cutoff:g} Hz'}, "
        f"motion of the trunk ({speed.mean():.3f} m/s, {turn.mean():.3f} rad/s on average) is "
        f"{' and '.join(parts)} of the forces at the joints, RMS"
    )


def _on_a_moving_base(arm: go.Model, side: str, height: float) -> pin.Model:
    """The arm on a thorax that moves in three translations and three rotations, without gravity."""
    model, parent = pin.Model(), 0
    for joint in ("PX", "PY", "PZ", "RX", "RY", "RZ"):
        kind = getattr(pin, f"JointModel{joint}")()
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), joint)
    across = trunk().half_width * height * (1.0 if side == "right" else -1.0)
    collar = model.addFrame(
        pin.Frame("thorax", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME)
    )
    shoulder = pin.SE3(np.eye(3), np.array([across, 0.0, 0.0]))
    whole = pin.appendModel(model, arm.pin, collar, shoulder)
    whole.gravity = pin.Motion.Zero()
    return whole


if __name__ == "__main__":
    main()
