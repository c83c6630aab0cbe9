"""Inverse kinematics that keeps the limits of joints, speed and acceleration: a QP per sample."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, NamedTuple, TypeAlias

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from geodesic_ocp.arrays import (
    Array,
    as_not_negative,
    as_positive,
    as_vector,
    evaluate,
    rotation_vector,
)
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.execution.limits import (
    JointLimits,
    checked_limits,
    checked_start,
    usable_torque,
)
from geodesic_ocp.execution.stops import Averages
from geodesic_ocp.model.model import Model
from geodesic_ocp.ocp.pose_search import rotation_log
from geodesic_ocp.synergies.baselines import Poses
from geodesic_ocp.synergies.scores import pose_differences
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

StepSolver: TypeAlias = Callable[[Array, Array, Array, Array, float, tuple[Array, Array]], Array]
_GAIN = 10.0  # [1/s], of the pose error, and towards the posture
_DRIFT = 1.0  # [1/s], of the pose error, and towards the posture
_DAMPING = 1e-2  # [m or rad of the hand per unit of a joint]
_EVEN = 1e-6  # share of a step
_MANY = 1_000_000  # steps, where the end is not known
_FEWEST = 3  # steps: at rest, in motion, at rest
_COARSE = 25.0  # [Hz], at which starts are compared
_ROUNDING = 1e-9  # share of limits, and [rad or m], left to the rounding of sums
_ACCURACY = 1e-10  # [rad/s or m/s], of speeds
_HOLDING = 0.95  # share of its limit up to which a joint's torque may be to hold the arm
_PASSES = 2  # of the problem of a step with limits of torque
_SOFT = 8  # DAQP's number of conditions that may be violated


def track_within_limits(
    model: Model,
    start: ArrayLike,
    time: ArrayLike,
    poses: Poses | tuple[ArrayLike, ArrayLike],
    limits: JointLimits,
    *,
    rate: float = 200.0,
    posture: ArrayLike | None = None,
    posture_weight: float = 1e-2,
    smoothing: float = 1e-3,
    turning: bool = True,
    placing: bool = True,
    solver: StepSolver | None = None,
    hands: Sequence[str] = (),
) -> JointTrajectory:
    """Track poses of the hand from rest to rest, within the limits of joints, speed, acceleration.

    The constant speeds v of every step minimize

        |J v - w|^2 + posture_weight^2 |v - k (posture - q)|^2
            + smoothing rate |v - v_before|^2 + (d^2 + |e|^2) |v|^2

    where w = velocity of the target + g e, e is the error of the hand's pose, g = 10/s (at most the
    rate), k = 1/s and d = 0.01 m or rad of the hand per unit of a joint: tasks as a
    quadratic program (Kanoun, Lamiraux, Wieber, IEEE Trans. Robotics 27, 2011; here of one priority
    with weights), damped by the error (Sugihara, IEEE Trans. Robotics 27, 2011). Bounds of v keep
    range, speed and acceleration of every joint, and leave room to brake (`speed_bounds`). Limits
    on jerk and torque are not considered. Where limits or reach do not allow the pose, the hand
    stays behind.

    >>> import numpy as np
    >>> import geodesic_ocp as go
    >>> arm, q = go.human_arm(), [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]
    >>> path = go.geodesic(go.KineticEnergy(arm), q, [1.2, -0.2, -0.9, 1.6, -0.3, 0.1, 0.4])
    >>> limits = go.execution.joint_limits(arm, velocity=4.0, acceleration=20.0, jerk=200.0)
    >>> time = np.linspace(0.0, 2.0, 201)
    >>> poses = arm.hand_pose(path(time / 2.0))
    >>> tracked = go.execution.track_within_limits(arm, q, time, poses, limits)
    >>> off = arm.hand_pose(tracked.positions[-1])[1] - poses[1][-1]
    >>> bool(np.linalg.norm(off) < 0.01)  # [m]
    True

    Args:
        model: a robot arm.
        start: configuration (n,), within the limits; or several (k, n), of which that is taken from
            which the hand follows best: by the sum of its mean distance [m] and angle [rad].
        time: increasing times (k,) [s], of which a function `poses` needs the first and last only.
        poses: rotations (m, 3, 3) and positions (m, 3) [m] of the hand as a function of m times,
            or the two arrays at the k times.
        limits: limits of the joints; infinite where there are none.
        rate: rate of the controller and of the trajectory [Hz].
        posture: configuration (n,) preferred by a redundant arm; None: the start.
        posture_weight: posture weight of the speeds towards it [m or rad of the hand per unit of a
            joint].
        smoothing: weight of changes of the speeds [s]; like g, the default is the best in hand
            errors and jerk of a few values on recorded motions.
        turning, placing: whether it tracks rotations, and positions.
        solver: solver of the problem of a step in place of DAQP; from q, w, the speeds towards the
            posture and those of the step before, d^2 + |e|^2, and the bounds, it gives v.
        hands: h hands of the model that are tracked together; `poses` are then stacked,
            (m, 3 h, 3) and (m, 3 h). Empty: the hand of the model.

    Returns:
        Samples at the rate from time 0. Velocities are central differences of the positions, and
        accelerations second differences.

    Raises:
        ValueError: wrong shapes or numbers, a start outside the limits, less than three steps.
    """
    starts = [checked_start(model, each) for each in np.atleast_2d(np.asarray(start, dtype=float))]
    limits = checked_limits(model, limits)
    rate = as_positive("rate", rate, "Hz")
    named = tuple(hands) or (model.hand,)
    if not (turning or placing):
        raise ValueError("turning and placing are both False: there is nothing to track")
    if len(starts) > 1:
        shared: dict[str, Any] = {
            **{"posture": posture, "posture_weight": posture_weight, "smoothing": smoothing},
            **{"turning": turning, "placing": placing, "solver": solver, "hands": hands},
        }
        span = np.ptp(np.asarray(time, dtype=float))
        coarse = min(rate, max(_COARSE, 2.0 * _FEWEST / span))
        rotations, places, _ = _targets(time, poses, 1.0 / coarse, len(named))

        def lag(q: Array) -> float:
            tracked = track_within_limits(model, q, time, poses, limits, rate=coarse, **shared)
            here = model.stacked_poses(named, tracked.positions)
            found = pose_differences(here, (rotations, places))
            return float(placing * found[0].mean() + turning * found[1].mean())

        starts.sort(key=lag)
    q = starts[0]
    preferred = q if posture is None else as_vector("posture", posture, model.dof)
    duration = 1.0 / rate
    rotations, places, velocities = _targets(time, poses, duration, len(named))
    rows = (*range(3 * (not placing), 3), *range(3, 3 + 3 * turning))
    tracker = Tracker(
        model,
        limits,
        duration,
        preferred,
        rows=tuple(6 * number + row for number in range(len(named)) for row in rows),
        posture_cost=as_not_negative("posture_weight", posture_weight) ** 2,
        smoothing=as_not_negative("smoothing", smoothing),
        solver=solver,
        hands=named,
    )
    count = len(velocities)
    positions = np.empty((count + 1, model.dof))
    speeds = np.zeros((count + 2, model.dof))
    positions[0] = q
    for k in range(count):
        # At rest in the first and in the last step.
        left = min(k, count - 1 - k)
        target = rotations[k], places[k], velocities[k]
        speeds[k + 1] = tracker.speeds(q, speeds[k], *target, left)
        q = q + duration * speeds[k + 1]
        positions[k + 1] = q
    v = (speeds[1:] + speeds[:-1]) / 2.0
    a = np.diff(speeds, axis=0) / duration
    times = np.arange(count + 1) / rate
    return JointTrajectory(times, positions, v, a, model.joint_names, model.units)


@dataclass(frozen=True, eq=False)
class Tracker:
    """The problem of one step of `track_within_limits`, see there.

    Attributes:
        model, limits: model and limits of its joints.
        step: duration of a step [s].
        preferred: configuration (n,) preferred by a redundant arm.
        rows: rows of the pose errors that count, six for each hand.
        posture_cost, smoothing: weight of the speeds towards it, squared, and of changes [s].
        solver: in place of DAQP.
        hands: names of the hands; empty: the hand of the model.
        gravity: of free fall, in axes of the base (3,) [m/s^2], for limits of torques.
        torque_share: share of the limits of torque that may be used, see `usable_torque`; no more
            than 0.95 of a limit are, unless it takes more to hold the arm.
    """

    model: Model
    limits: JointLimits
    step: float
    preferred: Array
    rows: tuple[int, ...] = (0, 1, 2, 3, 4, 5)
    posture_cost: float = 1e-4
    smoothing: float = 1e-3
    solver: StepSolver | None = None
    hands: tuple[str, ...] = ()
    gravity: Array | None = None
    torque_share: float = 1.0

    def speeds(
        self,
        q: Array,
        previous: Array,
        rotation: Array,
        position: Array,
        velocity: Array,
        left: int = _MANY,
        sent: Averages | None = None,
    ) -> Array:
        """Return the speeds (n,) of the step that begins at q (n,), after those before it (n,).

        Args:
            q, previous: configuration, and speeds of the step before.
            rotation, position, velocity: pose of the target at its beginning, and velocity (6,)
                during the step.
            left: number of steps after this one, in the last of which the arm is at rest.
            sent: command before this step, whose torque and its rate are limited; None: they are
                not, as without `gravity`.
        """
        hands = self.hands or (self.model.hand,)
        jacobian, way = evaluate(_tracking(self.model, self.rows, hands), q, rotation, position)
        error = way[:, 0]
        change_cost = self.smoothing / self.step
        wanted = velocity[list(self.rows)] + min(_GAIN, 1.0 / self.step) * error
        towards = _DRIFT * (self.preferred - q)
        damped = _DAMPING**2 + float(error @ error)
        bounds = speed_bounds(self.model, self.limits, self.step, q, previous, left)
        if self.solver is not None:
            found = self.solver(q, wanted, towards, previous, damped, bounds)
        else:
            weight = self.posture_cost + change_cost + damped
            hessian = jacobian.T @ jacobian + weight * np.eye(self.model.dof)
            pulled = self.posture_cost * towards + change_cost * previous
            gradient = -(jacobian.T @ wanted + pulled)
            found = previous
            conditions = None
            # Again, as torques are not quite linear in the speeds.
            for _ in range(1 if sent is None else _PASSES):
                if sent is not None:
                    conditions = self._conditions(q, sent, found)
                found = box_least_squares(hessian, gradient, *bounds, conditions)
        return np.asarray(np.clip(found, *bounds))

    def _conditions(self, q: Array, sent: Averages, near: Array) -> StepConditions:
        """Return conditions on the speeds of a step that begins at q (n,), linear near some (n,):
        hard ones on torques of the command after it and on their change, and others on the torques
        that hold the arm and on the hands' speed in its direction.
        """
        assert self.gravity is not None
        previous = sent.past[-1]
        weight, slope = evaluate(_holding(self.model), q, self.gravity)
        held = np.abs(weight[:, 0])
        limit = self.limits.torque
        usable = usable_torque(limit, held, self.torque_share)
        upper = np.minimum(usable, np.maximum(_HOLDING * limit, held))
        change = self.step * self.limits.torque_rate
        lower, upper = (
            np.clip(each, sent.torque - change, sent.torque + change) for each in (-upper, upper)
        )
        then = sent.after(near, self.model, self.gravity)
        matrix = self.model.mass_matrix(then.position) / (self.step * sent.count)
        middle = matrix @ near - then.torque
        limited = np.isfinite(upper)
        found = [(matrix[limited], (middle + lower)[limited], (middle + upper)[limited])]
        some = np.isfinite(limit)  # a joint that is too weak to hold the arm is not led farther
        room = np.maximum(_HOLDING * limit - held, 0.0)[some] / self.step
        found.append((np.sign(weight[some]) * slope[some], np.full_like(room, -np.inf), room))
        hands = self.hands or (self.model.hand,)
        largest = self.limits.hand_speed
        moving = self.model.stacked_jacobians(hands, q).reshape(len(hands), 6, -1)[:, :3]
        for jacobian in moving if np.isfinite(largest) else ():
            row = (jacobian @ previous) @ jacobian
            allowed = largest * float(np.linalg.norm(jacobian @ previous))
            found.append((row[None], np.array([-np.inf]), np.array([allowed])))
        rows, least, most = map(np.concatenate, zip(*found, strict=True))
        return StepConditions(rows, least, most, int(limited.sum()))


def _targets(
    time: ArrayLike, poses: Poses | tuple[ArrayLike, ArrayLike], step: float, hands: int
) -> tuple[Array, Array, Array]:
    """Return rotations and positions of the hands at the ends of steps [s], and their velocities
    (k - 1, 6 h).

    After the last time, the pose is the last one. Velocities are those of translation [m/s] and
    rotation [rad/s] from each pose to the next. Poses between samples are of cubic splines.
    """
    given = np.array(time, dtype=float)
    if given.ndim != 1 or given.size < 2 or not np.all(np.diff(given) > 0.0):
        raise ValueError(f"time must be at least two increasing times, got shape {given.shape}")
    count = int(np.ceil((given[-1] - given[0]) / step - _EVEN))
    if count < _FEWEST:
        raise ValueError(
            f"time must span at least {_FEWEST} steps of {step:.3g} s, got "
            f"{given[-1] - given[0]:.3g} s"
        )
    instants = np.minimum(given[0] + step * np.arange(count + 1), given[-1])
    if callable(poses):
        rotations, positions = poses(instants)
    else:
        rotations, positions = (np.array(each, dtype=float) for each in poses)
        if hands > 1:
            raise ValueError("poses of several hands must be a function of times")
        if rotations.shape != (given.size, 3, 3) or positions.shape != (given.size, 3):
            raise ValueError(
                f"poses must be rotations ({given.size}, 3, 3) and positions ({given.size}, 3) at "
                f"the times, got shapes {rotations.shape} and {positions.shape}"
            )
        rotations = RotationSpline(given, Rotation.from_matrix(rotations))(instants).as_matrix()
        positions = CubicSpline(given, positions)(instants)
    each = rotations.reshape(len(rotations), hands, 3, 3)
    turns = rotation_vector((each[1:] @ each[:-1].swapaxes(2, 3)).reshape(-1, 3, 3))
    moves = np.diff(positions, axis=0).reshape(-1, 3)
    return rotations, positions, np.hstack([moves, turns]).reshape(-1, 6 * hands) / step


@lru_cache(maxsize=32)
def _tracking(model: Model, rows: tuple[int, ...], hands: tuple[str, ...]) -> ca.Function:
    """Return q, rotations and positions of the targets -> Jacobian, error."""
    q = ca.SX.sym("q", model.dof)
    size = 3 * len(hands)
    errors = []
    rotation = ca.SX.sym("R", size, 3)
    position = ca.SX.sym("p", size)
    for number, hand in enumerate(hands):
        own = slice(3 * number, 3 * number + 3)
        here, at = model.frame_pose(hand, q)
        errors += [position[own] - at, rotation_log(rotation[own, :] @ here.T)]
    error = ca.vertcat(*errors)
    jacobian = ca.densify(model.stacked_jacobians(hands, q)[list(rows), :])
    outputs = ca.cse([jacobian, ca.densify(error[list(rows)])])
    return ca.Function("tracking", [q, rotation, position], outputs)


@lru_cache(maxsize=32)
def _holding(model: Model) -> ca.Function:
    """Return q, gravity -> torques that hold the arm (n,), and their derivatives by q (n, n)."""
    q = ca.SX.sym("q", model.dof)
    gravity = ca.SX.sym("g", 3)
    held = model.inverse_dynamics(q, ca.SX.zeros(model.dof), ca.SX.zeros(model.dof), gravity)
    return ca.Function("holding", [q, gravity], ca.cse([held, ca.densify(ca.jacobian(held, q))]))


def speed_bounds(
    model: Model,
    limits: JointLimits,
    step: float,
    q: Array,
    previous: Array,
    left: int,
) -> tuple[Array, Array]:
    """Return least and largest constant speed (n,) over a step, q_next = q + step v.

    Between them there is always a speed, at which there is one again, and so on: the joint can
    brake before the end of its range, and come to rest in the steps that are left. (Viability: Del
    Prete, "Joint position and velocity bounds in discrete-time acceleration/torque control of robot
    manipulators", IEEE Robotics and Automation Letters 3, 2018; here for steps of constant speed.)

    Args:
        model: model of the joints.
        limits: limits of their speeds and accelerations.
        step: [s].
        q: configuration at the beginning of the step (n,).
        previous: speed in the step before (n,).
        left: number of steps after this one, in the last of which the arm is at rest.
    """
    change = (1.0 - _ROUNDING) * limits.acceleration * step  # of the speed from step to step
    largest = np.minimum((1.0 - _ROUNDING) * limits.velocity, left * change if left else 0.0)
    up = np.minimum(largest, _braking(model.upper - _ROUNDING - q, change, step))
    down = -np.minimum(largest, _braking(q - model.lower - _ROUNDING, change, step))
    up, down = (np.clip(each, previous - change, previous + change) for each in (up, down))
    return np.minimum(down, up), up


def _braking(room: Array, change: Array, step: float) -> Array:
    """Return largest speed v (n,) towards a limit at the distance `room` (n,).

    The distance step (v + (v - c) + (v - 2 c) + ...) until the joint stands, with the change c of
    speed per step, is the largest of step ((k + 1) v - c k (k + 1) / 2) over k = 0, 1, ...
    """
    room = np.maximum(room, 0.0) / step
    limited = np.isfinite(change) & np.isfinite(room)  # else it may stop at once
    most = np.where(limited, room, 0.0)
    at = np.where(limited, change, 1.0)
    k = np.floor(np.maximum(np.sqrt(2.0 * np.minimum(most / at, 1e12)) - 1.0, 0.0))
    found = [most / (count + 1.0) + at * count / 2.0 for count in (k, k + 1.0)]
    return np.where(limited, np.minimum(room, np.min(found, axis=0)), room)


class StepConditions(NamedTuple):
    """Conditions lower <= A x <= upper, with A `matrix` (k, n), of which the first are hard."""

    matrix: Array
    lower: Array
    upper: Array
    hard: int = 0


def box_least_squares(
    hessian: Array,
    gradient: Array,
    lower: Array,
    upper: Array,
    conditions: StepConditions | None = None,
) -> Array:
    """Return the x (n,) that minimizes x' H x / 2 + g' x subject to lower <= x <= upper.

    By DAQP (Arnström, Bemporad, Axehill, "A dual active-set solver for embedded quadratic
    programming using recursive LDL' updates", IEEE Trans. Automatic Control 67, 2022).

    Args:
        hessian: H, symmetric and positive definite (n, n).
        gradient: g (n,).
        lower, upper: bounds (n,), which may be infinite or equal.
        conditions: further ones. They are violated, by as little as possible, where bounds do not
            allow them; the hard ones only then, and others also where those do not allow them.

    Raises:
        NotConverged: DAQP finds no minimum, from rounding.
    """
    count = gradient.size
    rows = conditions or StepConditions(np.empty((0, count)), *np.empty((2, 0)))
    every = len(rows.matrix)
    # Numbers of hard conditions and of all; at last the hard ones alone, none of them hard.
    for hard, last in dict.fromkeys([(rows.hard, every), (0, rows.hard or every)]):
        most = np.append(upper, rows.upper[:last])
        least = np.append(lower, rows.lower[:last])
        kinds = np.full(count + last, _SOFT, dtype=np.intc)
        kinds[: count + hard] = 0
        problem = hessian, gradient, rows.matrix[:last], most, least, kinds
        x, _, flag, _ = _daqp().solve(*problem, primal_tol=_ACCURACY)
        if flag in (1, 2):  # 2: with soft conditions violated
            return np.asarray(np.clip(x, lower, upper))
    raise NotConverged(f"the least-squares problem of a step was not solved (DAQP: {flag})")


@cache
def _daqp() -> Any:
    """Return the solver of quadratic programs; ImportError without it."""
    try:
        import daqp
    except ImportError:
        raise ImportError(
            "tracking within limits needs daqp: pip install 'geodesic_ocp[robots]'"
        ) from None
    return daqp
