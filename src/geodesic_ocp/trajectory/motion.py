"""Sampled motions of joints, and of a frame such as the thorax."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr, as_positive, real_array, settle
from geodesic_ocp.trajectory.filters import (
    MotionFilter,
    check_even,
    locally_fitted,
    low_passed,
    window_of,
    without_aliases,
)
from geodesic_ocp.trajectory.outliers import ALL_JOINTS, Outlier
from geodesic_ocp.trajectory.outliers import without_outliers as clean

_ORTHONORMAL = 1e-6
# Rates that differ by less are one rate: time stamps are rounded.
_SAME_RATE = 1e-3
_NAMED = 10  # outliers at most in a warning


@dataclass(frozen=True, eq=False, repr=False)
class FrameMotion(ShortRepr):
    """The pose of a frame, such as the thorax of a person, at the samples of a motion.

    Attributes:
        rotations: from the frame to the surrounding space, (k, 3, 3).
        positions: positions of the frame's origin in that space, (k, 3) [m].

    Raises:
        ValueError: shapes that do not match, values that are not finite, or a matrix that is not a
            rotation; the message names the first such sample.
    """

    rotations: Array
    positions: Array

    def __post_init__(self) -> None:
        rotations = real_array(self.rotations)
        positions = real_array(self.positions)
        count = len(positions) if positions.ndim else 0
        if rotations.shape != (count, 3, 3) or positions.shape != (count, 3):
            raise ValueError(
                f"rotations (k, 3, 3) and positions (k, 3) must match, got shapes "
                f"{rotations.shape} and {positions.shape}"
            )
        finite = np.isfinite(np.hstack([positions, rotations.reshape(count, 9)])).all(axis=1)
        if not finite.all():
            raise ValueError(f"the pose is not finite at sample {int(np.argmin(finite))}")
        products = np.swapaxes(rotations, 1, 2) @ rotations
        proper = np.abs(products - np.eye(3)).max(axis=(1, 2)) <= _ORTHONORMAL
        proper &= np.linalg.det(rotations) > 0.0
        if not proper.all():
            raise ValueError(f"the matrix at sample {int(np.argmin(proper))} is not a rotation")
        for name, array in (("rotations", rotations), ("positions", positions)):
            array.flags.writeable = False
            settle(self, **{name: array})

    def __len__(self) -> int:
        return len(self.positions)

    def interpolated(self, time: Array, at: Array) -> FrameMotion:
        """Return the poses at other times, from those at `time`.

        Positions by cubic spline, rotations along the shortest rotation between two samples; before
        the first sample and after the last the pose is theirs.
        """
        inside = np.clip(at, time[0], time[-1])
        spatial = scipy.spatial.transform
        interpolate = scipy.interpolate
        turning = spatial.Slerp(time, spatial.Rotation.from_matrix(self.rotations))
        moving = interpolate.CubicSpline(time, self.positions)
        return FrameMotion(turning(inside).as_matrix(), moving(inside))


@dataclass(frozen=True)
class Subject:
    """The recorded person: height [m], mass [kg] and name, if the recording has them."""

    height: float | None = None
    mass: float | None = None
    name: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Motion:
    """Joint coordinates over time, with velocities after filtering.

    Attributes:
        time: increasing times (k,) [s] of at least two samples.
        q: joint coordinates (k, n) [rad or m].
        joint_names: names of the n columns.
        velocity: (k, n) [rad/s or m/s], or None before filtering.
        subject: the recorded person.
        unfiltered: coordinates before filtering (k, n), or None.
        filter: the filter that was applied, and the noise of the recording; or None.
        trunk: pose of the thorax at the samples, its origin midway between the shoulders, in a
            space with z up; or None.
        outliers: samples that were found to be no motion, see `without_outliers`.
        doubts: why the motion may not be what was recorded, as phrases, such as those of a fit to
            markers; results that rest on the motion repeat them.

    Raises:
        ValueError: shapes that do not match, values that are not finite, or time that does not
            increase; the message names the first such sample.
    """

    time: Array
    q: Array
    joint_names: tuple[str, ...]
    velocity: Array | None = None
    subject: Subject = Subject()
    unfiltered: Array | None = None
    filter: MotionFilter | None = None
    trunk: FrameMotion | None = None
    outliers: tuple[Outlier, ...] = ()
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        time = real_array(self.time, "time")
        q = real_array(self.q, "q")
        names = tuple(self.joint_names)
        if time.ndim != 1 or q.shape != (time.size, len(names)):
            raise ValueError(
                f"time (k,) and q (k, {len(names)}) must fit together and the {len(names)} joint "
                f"names, got shapes {time.shape} and {q.shape}"
            )
        if time.size < 2:
            raise ValueError(f"a motion needs at least two samples, got {time.size}")
        if len(set(names)) < len(names):
            raise ValueError(f"joint names must differ, got {', '.join(names)}")
        arrays = {"time": time[:, None], "q": q}
        for name in ("velocity", "unfiltered"):
            if (given := getattr(self, name)) is not None:
                arrays[name] = real_array(given, name)
                if arrays[name].shape != q.shape:
                    raise ValueError(f"{name} must have the shape {q.shape} of q")
        for name, array in arrays.items():
            bad = np.argwhere(~np.isfinite(array))
            if len(bad):
                row, column = bad[0]
                which = "" if name == "time" else f" of {names[column]}"
                raise ValueError(f"{name}{which} is {array[row, column]} at sample {row}")
        if self.trunk is not None and len(self.trunk) != time.size:
            raise ValueError(f"trunk must have {time.size} samples, got {len(self.trunk)}")
        check_increasing(time)
        settle(self, joint_names=names)
        for name, array in (arrays | {"time": time}).items():
            array.flags.writeable = False
            settle(self, **{name: array})

    def __repr__(self) -> str:
        kind = "with velocities" if self.velocity is not None else "without velocities"
        names = ", ".join(self.joint_names[:8]) + (", ..." if len(self.joint_names) > 8 else "")
        return (
            f"Motion({len(self)} samples, {self.duration:.3g} s at {self.rate:.4g} Hz, {kind}, "
            f"joints {names})"
        )

    def __len__(self) -> int:
        return int(self.time.size)

    @property
    def duration(self) -> float:
        """[s]"""
        return float(self.time[-1] - self.time[0])

    @property
    def rate(self) -> float:
        """Mean sampling rate [Hz]."""
        return (len(self) - 1) / self.duration

    @property
    def caveat(self) -> str:
        """The doubts as a sentence; empty if there are none."""
        return f"Doubtful: {'; '.join(self.doubts)}." if self.doubts else ""

    # -- as a curve, for parallel transport ----------------------------------------------------

    @cached_property
    def _spline(self) -> scipy.interpolate.CubicSpline:
        return scipy.interpolate.CubicSpline(self.time, self.q)

    @property
    def breakpoints(self) -> Array:
        """Times of the samples [s]."""
        return self.time

    def __call__(self, s: ArrayLike, order: int = 0) -> Array:
        """Return coordinates at times s [s], or a derivative: the cubic spline through the samples.

        Raises:
            ValueError: s lies outside the recording.
        """
        times = np.asarray(s, dtype=float)
        if not np.all((times >= self.time[0]) & (times <= self.time[-1])):
            raise ValueError(
                f"s must lie in [{self.time[0]:.6g}, {self.time[-1]:.6g}] s, got {s!r}"
            )
        result: Array = np.asarray(self._spline(times, order))
        return result

    # -- other motions from this one -----------------------------------------------------------

    def select(self, joints: Sequence[str]) -> Motion:
        """Return the motion of these joints, in this order.

        Raises:
            ValueError: the motion lacks a joint.
        """
        missing = [name for name in joints if name not in self.joint_names]
        if missing:
            raise ValueError(
                f"there is no joint {', '.join(missing)}; there are {', '.join(self.joint_names)}"
            )
        columns = [self.joint_names.index(name) for name in joints]
        chosen: dict[str, Any] = {
            name: None if (given := getattr(self, name)) is None else given[:, columns]
            for name in ("q", "velocity", "unfiltered")
        }
        used = None if self.filter is None else self.filter.select(columns)
        outliers = tuple(each for each in self.outliers if each.joint in (*joints, ALL_JOINTS))
        return replace(self, **chosen, joint_names=tuple(joints), filter=used, outliers=outliers)

    def part(self, start: int, stop: int) -> Motion:
        """Return the motion from one sample to another, both included, as of a segment.

        What was found of the whole, its filter and its outliers, stays.

        Raises:
            ValueError: there are no such samples, or fewer than two.
        """
        if not 0 <= start < stop < len(self):
            raise ValueError(f"samples must be in 0 to {len(self) - 1}, got {start} to {stop}")
        rows = slice(start, stop + 1)
        chosen: dict[str, Any] = {
            name: None if (given := getattr(self, name)) is None else given[rows]
            for name in ("time", "q", "velocity", "unfiltered")
        }
        if self.trunk is not None:
            chosen["trunk"] = FrameMotion(self.trunk.rotations[rows], self.trunk.positions[rows])
        return replace(self, **chosen)

    def without_outliers(self) -> Motion:
        """Return the motion as it was recorded, without spikes, repeated frames and wraps.

        A spike is a single sample that is ten standard deviations of the noise away from the cubic
        through its neighbours, and 0.08 rad or more. It is replaced by interpolation, as are up to
        three frames that repeat the one before in all joints and are then caught up with. Steps by
        whole revolutions are undone. A sensor that stands still while other joints move is named,
        but its samples are kept, and so is a gap: a number, such as zero, to which joints jump and
        back.

        >>> import warnings
        >>> time = np.arange(200) / 100.0
        >>> q = np.sin(4.0 * time)
        >>> q[70] += 1.0  # [rad]
        >>> motion = go.Motion(time, q[:, None], ("elbow",))
        >>> with warnings.catch_warnings(action="ignore"):
        ...     cleaned = motion.without_outliers()
        >>> print(*cleaned.outliers)
        elbow at 0.700 s is 1 rad off its neighbours (spike, interpolated)

        Returns:
            The motion, without velocities or a filter, with what was found as `outliers`.

        Warns:
            RuntimeWarning: something was found; names the joint, the time and what was done.
        """
        before = self.q if self.unfiltered is None else self.unfiltered
        q, found = clean(self.time, before, self.joint_names)
        if not found:
            return replace(self._bare(), q=before)
        warnings.warn(
            "outliers in the recording: "
            + "; ".join(map(str, found[:_NAMED]))
            + (f"; and {len(found) - _NAMED} more" if len(found) > _NAMED else ""),
            RuntimeWarning,
            stacklevel=2,
        )
        return replace(self._bare(), q=q, outliers=(*self.outliers, *found))

    def resampled(self, rate: float) -> Motion:
        """Return the motion at `rate` evenly spaced samples per second [Hz], by cubic spline.

        To a lower rate, what the new samples cannot represent is filtered out first (zero-phase
        Butterworth filter, half the amplitude at 0.9 times half the new rate), as what lies above
        would be folded into the motion. The result has neither velocities nor a filter.
        """
        step = 1.0 / as_positive("rate", rate, "Hz")
        source = self
        if rate < (1.0 - _SAME_RATE) * self.rate and len(self) > 2:
            even = np.linspace(self.time[0], self.time[-1], len(self))
            source = replace(
                self._bare(), trunk=None, time=even, q=without_aliases(self(even), self.rate, rate)
            )
        count = int(np.floor(self.duration / step * (1.0 + 1e-12))) + 1
        time = self.time[0] + step * np.arange(count)
        trunk = None if self.trunk is None else self.trunk.interpolated(self.time, time)
        q = source(np.minimum(time, self.time[-1]))
        return replace(self._bare(), time=time, q=q, trunk=trunk)

    def _bare(self) -> Motion:
        return replace(self, velocity=None, unfiltered=None, filter=None)

    def filtered(
        self,
        window: int | None = None,
        order: int = 2,
        *,
        cutoff: float | None = None,
        duration: float | None = None,
    ) -> Motion:
        """Return positions and velocities without noise, by a zero-phase filter.

        Without arguments, a smoothing spline whose cut-off frequency is chosen from the noise floor
        of the recording, between 3 and 12 Hz: the one that minimizes the expected error of the
        velocities. Like a cut-off that is given, it does not depend on the sampling rate. Away from
        the ends the spline's response is that of a Butterworth filter of order 3 which runs
        forwards and backwards (Woltring, Advances in Engineering Software 8, 1986). A Savitzky-
        Golay filter fits a polynomial around every sample (Savitzky, Golay, Analytical Chemistry
        36, 1964; Klein et al. 2022 filter so, with 21 samples at 100 Hz: `duration=0.21`).

        A motion that was filtered before is filtered from its `unfiltered` coordinates, so that the
        result depends on the recording and the last filter alone. Outliers are taken out first
        (`without_outliers`).

        >>> time = np.arange(200) / 100.0
        >>> noise = 2e-3 * np.random.default_rng(0).normal(size=200)
        >>> motion = go.Motion(time, (np.sin(4.0 * time) + noise)[:, None], ("elbow",))
        >>> print(motion.filtered().filter)  # doctest: +NORMALIZE_WHITESPACE
        Filtered by a smoothing spline with a cut-off frequency of 4.1 Hz, chosen from the noise
        floor; noise of the joints: 2 mrad.

        Args:
            window: samples of a window of the Savitzky-Golay filter, odd.
            order: order of its polynomials.
            cutoff: -3 dB point of the smoothing spline [Hz].
            duration: duration of a window of the Savitzky-Golay filter [s]: the odd number of
                samples nearest to it.

        Returns:
            The motion with velocities, with its coordinates before any filter as `unfiltered`, but
            without outliers, and with the `filter`, which also has the noise that was found.

        Raises:
            ValueError: more than one filter is asked for; the samples are not evenly spaced, too
                few, or too slow for the cut-off; or window and order do not fit (window odd and
                above order, order at least 1).
        """
        given = {"window": window, "cutoff": cutoff, "duration": duration}
        named = [f"{name}={value}" for name, value in given.items() if value is not None]
        if len(named) > 1:
            raise ValueError(
                f"give only one of window, cutoff and duration, got {' and '.join(named)}"
            )
        check_even(self.time)
        cleaned = self.without_outliers()
        before = cleaned.q
        if duration is not None:
            window = window_of(duration, self.rate, order)
        if window is not None:
            q, velocity, used = locally_fitted(self.time, before, window, order)
        else:
            q, velocity, used = low_passed(self.time, before, cutoff)
        return replace(cleaned, q=q, velocity=velocity, unfiltered=before, filter=used)


def check_increasing(time: Array) -> None:
    """Raise ValueError, which names the sample, if times (k,) [s] do not increase."""
    later = np.diff(time) > 0.0
    if not later.all():
        row = int(np.argmin(later)) + 1
        raise ValueError(
            f"time must increase: sample {row} is at {time[row]:.6g} s, the one before at "
            f"{time[row - 1]:.6g} s"
        )


def bandwidth(motion: Motion, cutoff: float | None = None) -> float:
    """Return frequency [Hz] up to which a motion varies: as given, of its filter, or of its
    sampling.

    A motion without frequencies above f has 2 f T independent values in the time T. Of a motion
    whose filter is not known, `Motion.filter` being None, f is half the sampling rate: every sample
    counts as independent, as in unfiltered data. If such a motion was filtered elsewhere, give the
    cut-off frequency.

    Raises:
        ValueError: the cut-off frequency is not positive.
    """
    frequency = motion.rate / 2.0
    if cutoff is not None:
        return min(as_positive("cutoff", cutoff, "Hz"), frequency)
    return frequency if motion.filter is None else min(motion.filter.bandwidth, frequency)
