"""Whether the motion of the shoulder, taken as given, explains an arm's motion better.

An arm whose shoulder moves as recorded has the kinetic energy

    L = q' G(q) q' / 2 + b(q, t)' q' + c(q, t),

whose extremals depend on time: they have no parameter of their own, so that neither a time law nor
parallel transport can be had of them as of geodesics. Here each segment of a recording is predicted
by the extremal between its ends in its duration, with the shoulder as recorded and at rest (which
is the geodesic at constant speed), on the same cuts, and compared with straight lines.

Also the part that the shoulder's motion has in the forces at the joints.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import scipy
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.manifold.metrics import with_joint_inertia
from geodesic_ocp.model.anthropometry import trunk

SIDES = ("right", "left")
MASS = 70.0  # [kg], without effect on geodesics
METRICS: dict[str, Callable[[go.Model], go.Model]] = {
    "joint inertia": with_joint_inertia,
    "kinetic": lambda model: model,
}
# (rotations and positions of the base, and derivatives) at a time, (6,) each
BaseMotion = Callable[[float], tuple[np.ndarray, np.ndarray, np.ndarray]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", nargs="*", type=Path, help="MMM files of whole bodies")
    parser.add_argument("--duration", type=float, default=0.4, help="of a segment, on average [s]")
    parser.add_argument("--cutoff", type=float, default=3.0, help="of the trunk's motion [Hz]")
    options = parser.parse_args()
    print(
        "| recording | arm | metric | force of the shoulder's motion | straight lines | geodesics "
        "| shoulder given | not found |"
    )
    print("| --- | --- | --- | ---: | ---: | ---: | ---: | ---: |")
    for file in options.recordings:
        recorded = go.read_motion(file)
        height = float(recorded.subject.height or 0.0)
        for side in SIDES:
            arm = go.human_arm(side, height, MASS)
            motion = recorded.select(arm.joint_names).filtered()
            system = on_a_moving_base(arm, side, height)
            base = base_motion(motion, options.cutoff)
            for metric, model_of in METRICS.items():
                row = compared(model_of(arm), motion, system, base, options.duration)
                print(f"| {file.stem} | {side} | {metric} | {row} |", flush=True)


def compared(
    model: go.Model, motion: go.Motion, system: pin.Model, base: BaseMotion, duration: float
) -> str:
    """Share of the forces, errors of joints and hand by method, and segments not found."""
    metric = go.KineticEnergy(model)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        cuts = go.synergies.optimal_segmentations(metric, motion, spacing=0.1)
    segments = cuts.segments(round(motion.duration / duration), refined=False)
    straight, still, given = (np.array(motion.q) for _ in range(3))
    used = np.zeros(len(motion), dtype=bool)
    missed = 0
    for start, stop in segments:
        samples = slice(start, stop + 1)
        chord = _fractions(motion, samples)
        line = motion.q[start] + np.outer(chord, motion.q[stop] - motion.q[start])
        geodesic = go.geodesic(metric, motion.q[start], motion.q[stop])(chord)
        found = extremal(model, system, base, motion.time[samples], geodesic)
        if found is None:
            missed += 1
            continue
        used[samples] = True
        straight[samples], still[samples], given[samples] = line, geodesic, found
    errors = [_errors(model, motion, q, used) for q in (straight, still, given)]
    share = share_of_forces(model, motion, system, base)
    return f"{100 * share:.0f} % | {' | '.join(errors)} | {missed} of {len(segments)}"


def _fractions(motion: go.Motion, samples: slice) -> np.ndarray:
    time = motion.time[samples]
    return (time - time[0]) / (time[-1] - time[0])


def _errors(model: go.Model, motion: go.Motion, q: np.ndarray, used: np.ndarray) -> str:
    parts = (go.Motion(motion.time[used], each[used], motion.joint_names) for each in (motion.q, q))
    errors = go.synergies.motion_errors(model, *parts)
    return f"{errors.joint:.4f} rad, {1000 * errors.position:.1f} mm"


def extremal(
    model: go.Model, system: pin.Model, base: BaseMotion, time: np.ndarray, guess: np.ndarray
) -> np.ndarray | None:
    """Configurations at the times on the extremal between a guess's ends; None if not found."""
    n, data = model.dof, system.createData()
    armature = np.diag(model.armature)

    def right_hand_side(times: np.ndarray, states: np.ndarray) -> np.ndarray:
        result = np.empty_like(states)
        for column, (t, state) in enumerate(zip(times, states.T, strict=True)):
            place, speed, change = base(t)
            q, v = np.concatenate([place, state[:n]]), np.concatenate([speed, state[n:]])
            force = pin.rnea(system, data, q, v, np.concatenate([change, np.zeros(n)]))[6:]
            matrix = np.array(pin.crba(system, data, q))[6:, 6:]
            matrix = np.triu(matrix) + np.triu(matrix, 1).T + armature
            result[:, column] = np.concatenate([state[n:], -np.linalg.solve(matrix, force)])
        return result

    def ends(first: np.ndarray, last: np.ndarray) -> np.ndarray:
        return np.concatenate([first[:n] - guess[0], last[:n] - guess[-1]])

    start = np.vstack([guess.T, np.gradient(guess, time, axis=0).T])
    found = scipy.integrate.solve_bvp(right_hand_side, ends, time, start, tol=1e-4, max_nodes=400)
    return np.asarray(found.sol(time)[:n].T) if found.success else None


def share_of_forces(
    model: go.Model, motion: go.Motion, system: pin.Model, base: BaseMotion
) -> float:
    """RMS of the forces of the shoulder's motion over that of all others but gravity.

    The size of a force f is that in the metric's dual, sqrt(f' G^-1 f).
    """
    assert motion.velocity is not None
    change = scipy.interpolate.CubicSpline(motion.time, motion.velocity)(motion.time, 1)
    data, sizes = system.createData(), np.zeros(2)
    rest = np.zeros(6)
    for row, t in enumerate(motion.time):
        place, speed, acceleration = base(t)
        q = np.concatenate([place, motion.q[row]])
        states = ((speed, acceleration), (rest, rest))
        moved, still = (
            pin.rnea(
                system,
                data,
                q,
                np.concatenate([of_base, motion.velocity[row]]),
                np.concatenate([change_of_base, change[row]]),
            )[6:]
            for of_base, change_of_base in states
        )
        inverse = np.linalg.inv(model.mass_matrix(motion.q[row]))
        for index, force in enumerate((moved - still, still + model.armature * change[row])):
            sizes[index] += force @ inverse @ force
    return float(np.sqrt(sizes[0] / sizes[1]))


def base_motion(motion: go.Motion, cutoff: float) -> BaseMotion:
    """Position [m] and x-y-z angles [rad] of the thorax over time, about their means."""
    frame = motion.trunk
    assert frame is not None
    turns = Rotation.from_matrix(frame.rotations)
    angles = (turns.mean().inv() * turns).as_euler("XYZ")
    places = (frame.positions - frame.positions.mean(axis=0)) @ turns.mean().as_matrix()
    smooth = go.Motion(motion.time, np.hstack([places, angles]), tuple("xyzabc"))
    smooth = smooth.filtered(cutoff=cutoff)
    spline = scipy.interpolate.CubicSpline(motion.time, smooth.q)
    return lambda t: (spline(t), spline(t, 1), spline(t, 2))


def on_a_moving_base(arm: go.Model, side: str, height: float) -> pin.Model:
    """The arm on a thorax that moves in three translations and three rotations, without gravity."""
    model, parent = pin.Model(), 0
    for joint in ("PX", "PY", "PZ", "RX", "RY", "RZ"):
        kind = getattr(pin, f"JointModel{joint}")()
        parent = model.addJoint(parent, kind, pin.SE3.Identity(), joint)
    frame = pin.Frame("thorax", parent, 0, pin.SE3.Identity(), pin.FrameType.OP_FRAME)
    across = trunk().half_width * height * (1.0 if side == "right" else -1.0)
    shoulder = pin.SE3(np.eye(3), np.array([across, 0.0, 0.0]))
    whole = pin.appendModel(model, arm.pin, model.addFrame(frame), shoulder)
    whole.gravity = pin.Motion.Zero()
    whole.armature = np.zeros(whole.nv)
    return whole


if __name__ == "__main__":
    main()
