"""Retargeting while the person moves: each sample of the arm becomes a command for the robot.

The steps of one tick are all causal, and their delays are known:

1. A parabola through the last samples removes noise. From a point shortly before the newest sample
   the geodesic with its velocity leads to now: beyond, what it foresees is worth less than the
   accelerations that it costs the robot.
2. The pose of the hand there is mapped to the robot as in `retarget`.
3. Inverse kinematics follows it in steps of constant speed (`Tracker`).
4. Two moving averages make these steps smooth, one over a step h and one over a time T. The limits
   of position, speed and acceleration are intervals, so that an average of motions within them is
   within them, and its jerk is at most 2 a / T, where a is the limit of acceleration. Averages
   delay by (h + T) / 2. (Biagiotti, Melchiorri, "FIR filters for online trajectory planning with
   time- and frequency-domain specifications", Control Engineering Practice 20, 2012.)
5. A step is taken only if the robot can still stop after it with all commands within the limits;
   else it is changed towards the stop found before (`Stops`).
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_number, as_positive, as_vector
from geodesic_ocp.execution.limits import JointLimits, checked_limits, checked_start, joint_limits
from geodesic_ocp.execution.stops import Averages, Stops
from geodesic_ocp.execution.track_within_limits import Tracker
from geodesic_ocp.manifold.metrics import as_analysis_metric
from geodesic_ocp.model.model import Model, as_model
from geodesic_ocp.retargeting.arm_alignment import Alignment, align, check_joints
from geodesic_ocp.retargeting.paired_arm import PoseMapping, gravity_on
from geodesic_ocp.retargeting.settings import RetargetingSettings
from geodesic_ocp.synergies.segment import OnlineSegmentation

# Samples of the parabolas: for the hand, and for the synergies as Klein et al. 2022 filter them.
_SHORT = 11
_LONG = 21
_POWERS = np.arange(3.0)[:, None]
_BEFORE = 3  # samples from the newest back to where the geodesic leaves the parabola
_DRIFT = 0.01  # by which the rate of the steps may deviate, beyond a gap altogether
_DEFAULT = RetargetingSettings()
# Shares of limits of torque, its rate and the hand's speed within which a step is sought, and that
# it keeps: some is left for instants between the commands.
_SOUGHT = 0.95
_KEPT = 0.99
_GAP = 2.5  # steps without a sample, after which the person's motion begins anew


@dataclass(frozen=True, eq=False, repr=False)
class LiveCommand(ShortRepr):
    """The state that the robot is to have at the end of a step, (n,) each.

    Between two commands the jerk is constant.

    Attributes:
        time: since the first step began [s].
        position, velocity, acceleration: [rad or m], per second, per second squared.
        torque: of this state by inverse dynamics, with gravity as the robot is aligned [N m or N].
    """

    time: float
    position: Array
    velocity: Array
    acceleration: Array
    torque: Array


class LiveRetargeting:
    """Retargeting of a person's motion while it goes on: a command for each sample.

    The robot's hand follows that of the person. Commands have continuous accelerations and keep all
    limits, whatever the samples are: of position, speed, acceleration, jerk and torque, and of
    torque rate and the hand's speed on average over a step. The hand stays behind where joints are
    too weak to hold the arm.
    Commands lag behind by `delay`, and by more where the limits do not allow the person's speed.
    Distances between links or to obstacles are not considered. At the beginning, and after a gap, a
    parallel gripper takes the nearer one of both grasps. Synergies of the person are those of the
    online rule (`segment`), as `segment_developed` needs the whole motion. They are closed as soon
    as it is certain (`cuts`): 0.1 s after they end, mostly, and the filter's 0.1 s.

    >>> import numpy as np, geodesic_ocp as go
    >>> person, robot = go.human_arm("right"), go.human_arm("right", height=1.95)
    >>> limits = go.execution.joint_limits(robot, velocity=3.0)
    >>> live = go.retargeting.LiveRetargeting(person, robot, np.zeros(7), limits=limits)
    >>> for time in np.arange(100) / 100.0:
    ...     command = live.step(time, [0.0, 0.0, 0.0, time**2, 0.0, 0.0, 0.0])
    >>> round(command.time, 2), round(live.delay, 3)
    (1.0, 0.055)

    Args:
        person: model of the person's arm.
        robot: the arm.
        start: configuration (n,) of the robot, in which it rests [rad or m].
        alignment, person_alignment, limits: see `retarget`.
        settings: settings, of which `scale`, `mirror`, `torque_share` and whether positions and
            orientations count are used.
        rate: of the samples and of the commands [Hz].
        threshold: threshold of the online rule [rad], see `segment`.

    Attributes:
        delay: delay of the command, by its averages [s].
        command: the last command.

    Raises:
        ValueError: a start outside the limits, wrong shapes, or limits of jerk without limits of
            acceleration.
    """

    def __init__(
        self,
        person: Model,
        robot: Model,
        start: ArrayLike,
        *,
        alignment: Alignment | None = None,
        person_alignment: Alignment | None = None,
        limits: JointLimits | None = None,
        settings: RetargetingSettings = _DEFAULT,
        rate: float = 100.0,
        threshold: float = 0.6,
    ) -> None:
        self.person = as_model(person)
        self.robot = as_model(robot)
        if len(robot.hands) > 1:
            raise ValueError("robot: must have one hand; load one of its arms")
        source = align(person) if person_alignment is None else person_alignment
        target = align(robot) if alignment is None else alignment
        check_joints(source, person)
        check_joints(target, robot)
        self.mapping = PoseMapping.between(person, source, target, settings)
        self.limits = joint_limits(robot) if limits is None else checked_limits(robot, limits)
        self._step = 1.0 / as_positive("rate", rate, "Hz")
        placing = settings.position_weight > 0.0
        turning = settings.orientation_weight > 0.0
        rows = (*range(3 * (not placing), 3), *range(3, 3 + 3 * turning))
        q = checked_start(robot, start)
        self._gravity = gravity_on(target)
        sought, kept = (
            replace(
                self.limits,
                torque=torque * self.limits.torque,
                torque_rate=share * self.limits.torque_rate,
                hand_speed=share * self.limits.hand_speed,
            )
            for torque, share in ((1.0, _SOUGHT), (_KEPT, _KEPT))
        )
        self._tracker = Tracker(
            robot,
            sought,
            self._step,
            q,
            rows=rows,
            gravity=self._gravity,
            torque_share=settings.torque_share,
        )
        self._stops = Stops(robot, kept, self._gravity)
        self._stop = np.zeros((1, q.size))  # speeds with which it can come to rest
        limited = np.isfinite(self.limits.jerk)
        averaged = 2.0 * self.limits.acceleration[limited] / self.limits.jerk[limited]
        if not np.all(np.isfinite(averaged)):
            raise ValueError("limits: joints with a limit of jerk need one of acceleration")
        # Steps of the second average, the same for all joints to keep them together.
        count = max(1, int(np.ceil(np.max(averaged, initial=0.0) / self._step - 1e-9)))
        self.delay = self._step * (1.0 + count) / 2.0
        self._metric = as_analysis_metric(None, person)
        zero = np.zeros(person.dof)
        # The largest speed, until a larger one is seen: that of 1 rad/s of all joints.
        fastest = self._metric.norm(zero, np.ones(person.dof))
        self._segmentation = OnlineSegmentation(self._metric, threshold, fastest=fastest)
        # Functions are built and compiled now, not while the person moves.
        self._metric.kernels.available()
        rotations, positions = self.mapping(np.array([zero, zero]))
        still = np.zeros(robot.dof)
        past = np.zeros((count + 1, robot.dof))
        weight = robot.inverse_dynamics(q, still, still, self._gravity)
        self._sent = Averages(self._step, past, q, still, still, weight)
        self._tracker.speeds(q, still, rotations[0], positions[0], np.zeros(6), sent=self._sent)
        self._stops.after(q, self._sent, still, self._stop)
        self._samples: deque[tuple[float, Array]] = deque(maxlen=_LONG)
        self._time = -np.inf
        self._ticks = 0
        # of steps without a pause, to check their rate
        self._begin = 0.0
        self._counted = 0
        self._target = q  # configuration after the steps of constant speed
        self.command = LiveCommand(0.0, q, still, still, weight)

    def __repr__(self) -> str:
        arms = f"{self.person.name} on {self.robot.name}"
        return f"LiveRetargeting({arms}, delay {self.delay:.3g} s, {self._ticks} steps)"

    @property
    def cuts(self) -> tuple[float, ...]:
        """Times at which synergies start or stop [s], so far."""
        return tuple(self._segmentation.cuts)

    def step(self, time: float, q: ArrayLike | None = None) -> LiveCommand:
        """Return the command for the end of the step that begins now.

        It is called once in every step of the robot. Its work is bounded, but Python's collection
        of garbage may interrupt it for some 50 ms; not after `gc.freeze()`. After a gap of more
        than two steps the robot brakes and rests, after 90 steps and the delay at most; with the
        next sample it goes on.

        Args:
            time: [s], later than in the step before; that of the sample.
            q: sample of the person's joints (n,) [rad]; None if none has arrived.

        Raises:
            ValueError: the time does not increase, or not at the rate; a wrong number of joints,
                numbers that are not finite, or angles in degrees. The command remains the one
                before; `step(time)` without the sample takes the step.
        """
        time = as_number("time", time)
        if time <= self._time:
            raise ValueError(f"time must increase, got {time:g} s after {self._time:g} s")
        if time - self._time > _GAP * self._step:
            self._begin = time
            self._counted = 0
        elapsed = time - self._begin
        late = abs(elapsed - self._counted * self._step)
        if late > _GAP * self._step + _DRIFT * elapsed:
            raise ValueError(
                f"step was called {self._counted / elapsed:.4g} times per second, not "
                f"{1.0 / self._step:.4g}: give the rate"
            )
        if q is not None:
            sample = as_vector("q", q, self.person.dof)
            self._metric.check_units("q", sample)
            self._add(time, sample)
        self._time, self._counted = time, self._counted + 1
        before = self._sent.past[-1]
        sent = self._sent
        if self._samples and time - self._samples[-1][0] <= _GAP * self._step:
            rotations, positions = self.mapping(self._expected(time))
            turn = rotations[1] @ rotations[0].T
            turning = (turn - turn.T)[[2, 0, 1], [1, 2, 0]] / 2.0  # of small angles
            velocity = np.append(positions[1] - positions[0], turning) / self._step
            pose = rotations[0], positions[0]
            speeds = self._tracker.speeds(self._target, before, *pose, velocity, sent=sent)
            speeds, self._stop = self._stops.after(self._target, sent, speeds, self._stop)
        else:
            speeds = self._stop[0]
            self._stop = np.vstack([self._stop[1:], 0.0 * before])
        self._target = self._target + self._step * speeds
        self._sent, self._ticks = sent.after(speeds, self.robot, self._gravity), self._ticks + 1
        state = (self._sent.position, self._sent.velocity, self._sent.acceleration)
        self.command = LiveCommand(self._ticks * self._step, *state, self._sent.torque)
        return self.command

    def _add(self, time: float, q: Array) -> None:
        """Add a sample to the parabolas and to the synergies."""
        if self._samples and time - self._samples[-1][0] > _GAP * self._step:
            self._samples.clear()
            self._segmentation.restart()
        if not self._samples and self.mapping.target.parallel_gripper:
            self.mapping = self._nearer_grasp(q)
        self._samples.append((time, q))
        if len(self._samples) == _LONG:
            middle = self._samples[_LONG // 2][0]
            self._segmentation.add(middle, *self._parabola(_LONG, middle))

    def _nearer_grasp(self, q: Array) -> PoseMapping:
        """Return the mapping with the gripper turned to where the robot's is nearer to it."""
        here, _ = self.robot.hand_pose(self._target)
        both = (replace(self.mapping, turned=turned) for turned in (False, True))
        return max(both, key=lambda each: float(np.sum(each(q)[0] * here)))

    def _parabola(self, count: int, time: float) -> tuple[Array, Array]:
        """Return position and velocity (n,) at a time of the parabola through the last samples."""
        times, samples = zip(*list(self._samples)[-count:], strict=True)
        powers = ((np.array(times) - time) / self._step) ** _POWERS
        values = np.linalg.solve(powers @ powers.T, powers @ np.array(samples))
        return values[0], values[1] / self._step

    def _expected(self, time: float) -> Array:
        """Return where the person will be at a time, and one step later (2, n)."""
        if len(self._samples) < _SHORT:
            return np.array([self._samples[-1][1]] * 2)
        touched = self._samples[-1 - _BEFORE][0]
        position, velocity = self._parabola(_SHORT, touched)
        # Along a geodesic the velocity is transported parallel to itself.
        state = np.append(position, velocity)[None]
        bend = self._metric.transport_matrices(state)[0] @ velocity / 2.0
        since = time - touched + np.array([[0.0], [self._step]])
        return np.asarray(position + since * velocity + since**2 * bend)
