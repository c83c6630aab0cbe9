"""Motion: joint coordinates sampled over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_positive

# Time stamps may deviate from even spacing by this fraction of a step, as recordings round them.
_UNEVEN = 0.1


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
        joint_names: of the n columns.
        velocity: (k, n) [rad/s or m/s], or None before filtering.
        subject: the recorded person.

    Raises:
        ValueError: shapes that do not match, values that are not finite, or time that does not
            increase; the message names the first such sample.
    """

    time: Array
    q: Array
    joint_names: tuple[str, ...]
    velocity: Array | None = None
    subject: Subject = Subject()

    def __post_init__(self) -> None:
        time, q = np.array(self.time, dtype=float), np.array(self.q, dtype=float)
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
        if self.velocity is not None:
            arrays["velocity"] = np.array(self.velocity, dtype=float)
            if arrays["velocity"].shape != q.shape:
                raise ValueError(f"velocity must have the shape {q.shape} of q")
        for name, array in arrays.items():
            bad = np.argwhere(~np.isfinite(array))
            if len(bad):
                row, column = bad[0]
                which = "" if name == "time" else f" of {names[column]}"
                raise ValueError(f"{name}{which} is {array[row, column]} at sample {row}")
        steps = np.diff(time)
        if np.any(steps <= 0.0):
            row = int(np.argmax(steps <= 0.0)) + 1
            raise ValueError(
                f"time must increase: sample {row} is at {time[row]:.6g} s, the one before at "
                f"{time[row - 1]:.6g} s"
            )
        for array in arrays.values():
            array.flags.writeable = False
        time.flags.writeable = False
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "q", q)
        object.__setattr__(self, "joint_names", names)
        object.__setattr__(self, "velocity", arrays.get("velocity"))

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

    # -- as a curve, for parallel transport ----------------------------------------------------

    @cached_property
    def _spline(self) -> scipy.interpolate.CubicSpline:
        return scipy.interpolate.CubicSpline(self.time, self.q)

    @property
    def breakpoints(self) -> Array:
        """Times of the samples [s]."""
        return self.time

    def __call__(self, s: ArrayLike, order: int = 0) -> Array:
        """Coordinates at times s [s], or a derivative: the cubic spline through the samples.

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
        """The motion of these joints, in this order.

        Raises:
            ValueError: the motion lacks a joint.
        """
        missing = [name for name in joints if name not in self.joint_names]
        if missing:
            raise ValueError(
                f"there is no joint {', '.join(missing)}; there are {', '.join(self.joint_names)}"
            )
        columns = [self.joint_names.index(name) for name in joints]
        velocity = None if self.velocity is None else self.velocity[:, columns]
        return replace(self, q=self.q[:, columns], joint_names=tuple(joints), velocity=velocity)

    def resampled(self, rate: float) -> Motion:
        """The motion at `rate` evenly spaced samples per second [Hz], by cubic spline."""
        step = 1.0 / as_positive("rate", rate, "Hz")
        count = int(np.floor(self.duration / step * (1.0 + 1e-12))) + 1
        time = self.time[0] + step * np.arange(count)
        return replace(self, time=time, q=self(np.minimum(time, self.time[-1])), velocity=None)

    def filtered(self, window: int = 21, order: int = 2) -> Motion:
        """Positions and velocities by a Savitzky-Golay filter of `window` samples.

        A polynomial of this order is fitted around every sample (Savitzky and Golay, Analytical
        Chemistry 36, 1964).

        Raises:
            ValueError: the samples are not evenly spaced, there are fewer than `window`, or window
                and order do not fit (window odd and above order, order at least 1).
        """
        if window % 2 == 0 or order < 1 or window <= order:
            raise ValueError(
                f"window must be odd and above order, order at least 1, got {window} and {order}"
            )
        if len(self) < window:
            raise ValueError(
                f"filtering with window {window} needs as many samples, not {len(self)}"
            )
        step = self.duration / (len(self) - 1)
        off = self.time - np.linspace(self.time[0], self.time[-1], len(self))
        row = int(np.argmax(np.abs(off)))
        if abs(off[row]) > _UNEVEN * step:
            raise ValueError(
                f"filtering needs evenly spaced samples: sample {row} is {abs(off[row]):.6g} s off "
                f"the even grid of steps of {step:.6g} s; resample first (Motion.resampled, or "
                "--resample on the command line)"
            )
        q, slope = _fitted(self.q, window, order)
        return replace(self, q=q, velocity=slope / step)


def _fitted(values: Array, window: int, order: int) -> list[Array]:
    """Values and slopes per sample, (k, n) each, of polynomials fitted to `window` samples.

    Each sample is in the middle of its polynomial's samples, except near the ends.
    """
    half, powers = window // 2, np.arange(order + 1)
    x = np.linspace(-1.0, 1.0, window)[:, None]
    fit = np.linalg.pinv(x**powers)  # from samples to coefficients
    first, last = values[:window], values[-window:]
    windows = sliding_window_view(values, window, axis=0)
    return [
        np.vstack([at[:half] @ first, windows @ at[half], at[half + 1 :] @ last])
        for at in (x**powers @ fit, (powers / half * x ** np.maximum(powers - 1, 0)) @ fit)
    ]
