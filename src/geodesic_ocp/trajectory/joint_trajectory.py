"""Joint trajectories for robot controllers: CSV, a ROS 2 message in JSON, NumPy and other files."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly, make_interp_spline

from geodesic_ocp.arrays import Array, ShortRepr, as_positive, real_array, settle
from geodesic_ocp.records import write_together
from geodesic_ocp.trajectory.exports import EXPORTS, NANO, library
from geodesic_ocp.trajectory.interpolation import quintic

_SUFFIXES = (".csv", ".json", ".npz", *EXPORTS)
_EVEN = 1e-4  # largest deviation of an even step, of its length
KINDS = ("position", "velocity", "acceleration", "effort")  # of columns of a table
# The attribute of each kind.
_ARRAYS = dict(zip(KINDS, ("positions", "velocities", "accelerations", "efforts"), strict=True))
_METRES = ("m", "m/s", "m/s^2", "N")  # their units for a joint in metres


@dataclass(frozen=True, eq=False, repr=False)
class JointTrajectory(ShortRepr):
    """Joint positions, velocities and accelerations over time.

    Attributes:
        time: from the start (k,) [s].
        positions, velocities, accelerations: (k, n) [rad or m], per second, per second squared.
        joint_names: names of the n columns.
        units: units of the positions, "rad" or "m" for each joint; empty: all "rad".
        efforts: torques or forces of the joints (k, n) [N m or N], or None.
        derived: "velocity", "acceleration", if these were not stated but derived from the others.
        digits: by kind ("position", "velocity" and so on), what the last digit of its numbers
            stands for (n,), of a file whose unit was another one; see `last_digits`.

    Raises:
        ValueError: arrays of the wrong shape, numbers that are not finite, no sample, joints that
            share a name, or another unit.
    """

    time: Array
    positions: Array
    velocities: Array
    accelerations: Array
    joint_names: tuple[str, ...]
    units: tuple[str, ...] = ()
    efforts: Array | None = None
    derived: tuple[str, ...] = ()
    digits: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = tuple(str(name) for name in self.joint_names)
        units = tuple(self.units) or ("rad",) * len(names)
        shape = (np.size(self.time), len(names))
        if shape[0] == 0 or not names or len(set(names)) < len(names):
            raise ValueError(
                f"a trajectory needs samples and joints of different names, got {shape[0]} samples "
                f"of joints {', '.join(names) or 'without names'}"
            )
        if len(units) != len(names) or not set(units) <= {"rad", "m"}:
            raise ValueError(f"units must be 'rad' or 'm' for each joint, got {self.units!r}")
        settle(self, joint_names=names)
        settle(self, units=units)
        if not set(self.derived) <= set(KINDS[1:3]):
            raise ValueError(f"derived must be among {', '.join(KINDS[1:3])}: {self.derived!r}")
        for name in ("time", *_ARRAYS.values()):
            values = getattr(self, name)
            if values is None:
                continue
            array = real_array(values, name)
            expected = shape[:1] if name == "time" else shape
            if array.shape != expected:
                raise ValueError(f"{name} must have shape {expected}, got {array.shape}")
            if not np.all(np.isfinite(array)):
                sample = int(np.argwhere(~np.isfinite(array))[0, 0])
                raise ValueError(f"{name} must be finite, sample {sample} is not")
            settle(self, **{name: array})

    _shown = ("joint_names", "duration", "rate")

    @classmethod
    def side_by_side(
        cls, parts: Sequence[JointTrajectory], joint_names: Sequence[str]
    ) -> JointTrajectory:
        """Return trajectories of several arms at the same times as one trajectory, under these
        names.

        Raises:
            ValueError: the trajectories are sampled at different times.
        """
        for part in parts:
            if not np.array_equal(part.time, parts[0].time):
                raise ValueError("trajectories side by side must be sampled at the same times")
        efforts = [part.efforts for part in parts if part.efforts is not None]
        known = [kind for kind in KINDS if kind != "effort" or len(efforts) == len(parts)]
        return cls(
            parts[0].time,
            np.hstack([part.positions for part in parts]),
            np.hstack([part.velocities for part in parts]),
            np.hstack([part.accelerations for part in parts]),
            tuple(joint_names),
            tuple(unit for part in parts for unit in part.units),
            np.hstack(efforts) if len(efforts) == len(parts) else None,
            tuple(kind for kind in KINDS if any(kind in part.derived for part in parts)),
            {kind: np.hstack([part.last_digits(kind) for part in parts]) for kind in known},
        )

    def columns(self, chosen: slice | Sequence[int], joint_names: Sequence[str]) -> JointTrajectory:
        """Return some columns, as of one of several arms `side_by_side`, under these names."""
        numbers = np.arange(len(self.joint_names))[chosen]
        cut: dict[str, Any] = {
            name: None if (given := getattr(self, name)) is None else given[:, numbers]
            for name in _ARRAYS.values()
        }
        units = tuple(self.units[k] for k in numbers)
        digits = {kind: each[numbers] for kind, each in self.digits.items()}
        return replace(self, **cut, joint_names=tuple(joint_names), units=units, digits=digits)

    def last_digits(self, kind: str) -> Array:
        """Return what the last digit of a kind of numbers stands for (n,), such as 1e-6 [rad].

        Raises:
            ValueError: there are no such numbers.
        """
        if kind not in self._found_digits:
            raise ValueError(f"the trajectory has no {kind}")
        return self.digits.get(kind, self._found_digits[kind])

    @cached_property
    def _found_digits(self) -> dict[str, Array]:
        count = len(self.joint_names)
        return {kind: np.full(count, last_digit(each)) for kind, each in self._by_kind().items()}

    @classmethod
    def from_positions(
        cls,
        time: ArrayLike,
        positions: ArrayLike,
        joint_names: Sequence[str],
        units: Sequence[str] = (),
    ) -> JointTrajectory:
        """Return the trajectory through positions (k, n) at times (k,), with derivatives of a
        spline.

        The cubic spline interpolates the positions (not-a-knot), so noise in them is amplified.

        Raises:
            ValueError: fewer than four samples, times that do not increase, or as the constructor.
        """
        values = real_array(positions, "position")
        empty = np.zeros_like(values)
        whole = cls(real_array(time, "time"), values, empty, empty, (*joint_names,), (*units,))
        if len(whole.time) < 4:
            raise ValueError(
                "velocities and accelerations can be found for at least four samples only, got "
                f"{len(whole.time)}"
            )
        steps = np.diff(whole.time)
        if not np.all(steps > 0.0):
            k = int(np.argmin(steps > 0.0))
            raise ValueError(
                "velocities and accelerations can be found at increasing times only: sample "
                f"{k + 1} at {whole.time[k + 1]:.6g} s follows {whole.time[k]:.6g} s"
            )
        spline = make_interp_spline(whole.time, values, k=3)
        velocities, accelerations = (spline.derivative(k)(whole.time) for k in (1, 2))
        return replace(
            whole, velocities=velocities, accelerations=accelerations, derived=KINDS[1:3]
        )

    @property
    def duration(self) -> float:
        """Time from the first to the last sample [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def rate(self) -> float | None:
        """Samples per second [Hz]; None if the samples are not evenly spaced."""
        steps = np.diff(self.time)
        if not steps.size or not self.duration > 0.0:
            return None
        step = self.duration / steps.size
        return 1.0 / step if np.abs(steps - step).max() <= _EVEN * step else None

    def at_rate(self, rate: float) -> JointTrajectory:
        """Return the trajectory sampled evenly, `rate` times per second [Hz], by quintic
        interpolation.

        Between two samples, the quintic polynomial that has their positions, velocities and
        accelerations. Time is stretched to a whole number of steps, by less than one step
        altogether, so that the last sample is the last one; speeds never grow by it. Efforts are
        left out: they do not follow from positions alone.

        Raises:
            ValueError: rate is not positive, or the times of this trajectory do not increase.
        """
        rate = as_positive("rate", rate, "Hz")
        if not np.all(np.diff(self.time) > 0.0) or len(self.time) < 2:
            raise ValueError("only a trajectory at increasing times can be sampled at a rate")
        steps = max(int(np.ceil(self.duration * rate * (1.0 - 1e-9))), 1)
        stretch = max(steps / rate / self.duration, 1.0)
        instants = np.linspace(self.time[0], self.time[-1], steps + 1)
        q, v, a = self.states(instants)
        time = self.time[0] + np.arange(steps + 1) / rate
        return replace(
            self,
            time=time,
            positions=q,
            velocities=v / stretch,
            accelerations=a / stretch**2,
            efforts=None,
            digits={kind: self.last_digits(kind) for kind in KINDS[:3]},
        )

    def states(self, times: ArrayLike) -> tuple[Array, Array, Array]:
        """Return positions, velocities and accelerations (k, n) each at times (k,) [s], as in
        `at_rate`.

        Before the first sample and after the last one the trajectory is where it begins or ends.
        """
        instants = np.clip(np.asarray(times, dtype=float), self.time[0], self.time[-1])
        q, v, a = (self._spline(instants, order) for order in range(3))
        return q, v, a

    @cached_property
    def _spline(self) -> PPoly:
        return quintic(self.time, self.positions, self.velocities, self.accelerations)

    def _by_kind(self) -> dict[str, Array]:
        named = {kind: getattr(self, name) for kind, name in _ARRAYS.items()}
        return {kind: array for kind, array in named.items() if array is not None}

    def csv(self) -> str:
        """Return CSV with time_from_start and the position, velocity and acceleration of each
        joint.

        The columns of joints are named `shoulder position`, with efforts at the end if there are
        any. Angles are in rad; a column of a joint in metres ends in its unit, `lift velocity
        [m/s]`.
        """
        header = ["time_from_start"]
        found = self._by_kind()
        for kind, metres in zip(found, _METRES, strict=False):
            for name, unit in zip(self.joint_names, self.units, strict=True):
                header.append(f"{name} {kind}" + (f" [{metres}]" if unit == "m" else ""))
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(np.column_stack([self.time, *found.values()]).tolist())
        return text.getvalue()

    def json(self, *, effort: bool = False) -> str:
        """Return JSON with the fields of the ROS 2 message trajectory_msgs/msg/JointTrajectory.

        The message has no units: controllers take rad and m.

        Args:
            effort: include the efforts, if known. The joint_trajectory_controller of ros2_control
                rejects a message that has any.
        """
        known = self.efforts if effort else None
        efforts = np.zeros((len(self.time), 0)) if known is None else known
        arrays = self.positions, self.velocities, self.accelerations, efforts
        names = ("positions", "velocities", "accelerations", "effort")
        points = []
        for instant, *values in zip(self.time, *(each.tolist() for each in arrays), strict=True):
            seconds, nanoseconds = divmod(round(float(instant) * NANO), NANO)
            since = {"time_from_start": {"sec": seconds, "nanosec": nanoseconds}}
            points.append(dict(zip(names, values, strict=True)) | since)
        header = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
        message = {"header": header, "joint_names": list(self.joint_names), "points": points}
        return json.dumps(message, indent=1)

    def npz(self) -> bytes:
        """Return a NumPy archive (.npz) of plain arrays, read by `numpy.load`.

        `time` (k,) [s]; `position`, `velocity`, `acceleration` (k, n); `effort` (k, n) if there is
        any; `joint_names` and `units` (n,) of text; `rate` [Hz], NaN for uneven samples.
        """
        archive = io.BytesIO()
        np.savez(
            archive,
            allow_pickle=False,
            time=self.time,
            **self._by_kind(),
            joint_names=np.array(self.joint_names),
            units=np.array(self.units),
            rate=np.array(np.nan if self.rate is None else self.rate),
        )
        return archive.getvalue()

    def save(self, file: str | PathLike[str], *, effort: bool = False) -> Path:
        """Write a file by its suffix, and return its path.

        .csv, .json (ROS 2) and .npz, which `read_trajectory` reads; .parquet (an episode of
        LeRobot), .mcap (/joint_states) and .rrd (rerun), see `trajectory.exports`.

        Args:
            file: its path. A .csv and an .npz include the efforts, if known.
            effort: also include them in a .json, see `json`.

        Raises:
            ValueError: another suffix, or uneven samples for a .parquet.
            ImportError: the package that writes the file is missing.
            OSError: the file cannot be written.
        """
        check_export(path := Path(file))
        json = partial(self.json, effort=effort)
        given = self.time, self._by_kind(), self.joint_names, self.rate
        writers: dict[str, Callable[[], str | bytes]]
        writers = {".csv": self.csv, ".json": json, ".npz": self.npz}
        writers |= {suffix: partial(export, *given) for suffix, export in EXPORTS.items()}
        written = writers[path.suffix]()
        content = written if isinstance(written, bytes) else written.encode("utf-8")
        write_together(path.parent, lambda folder: (folder / path.name).write_bytes(content))
        return path


def last_digit(values: Array) -> float:
    """Return what the last digit of numbers stands for: a power of ten, or the spacing of floats.

    >>> last_digit(np.array([0.25, 0.5, 1.125]))
    0.001

    The coarsest power of ten of which all are multiples. Numbers of single precision count as such.
    Fewer than three significant digits, as of -2, 0 and 2, are no rounding: such numbers are exact.
    """
    largest = float(np.abs(values).max(initial=0.0))
    finest = float(np.spacing(max(largest, np.finfo(float).tiny)))
    for decimals in range(np.finfo(float).precision):
        scaled = values * 10.0**decimals
        if np.all(np.abs(scaled - np.rint(scaled)) <= np.spacing(np.abs(scaled))):
            found = 10.0**-decimals
            if 100.0 * found > largest:  # at most two significant digits
                return finest
            break
    else:
        found = finest
    if np.array_equal(values, values.astype(np.float32)):
        found = max(found, float(np.spacing(np.float32(largest))))
    return found


def check_export(file: Path) -> None:
    """Check that a trajectory can be written to a file of this name.

    Raises:
        ValueError: it has another suffix than those of `JointTrajectory.save`.
        ImportError: the package that writes the file is missing.
    """
    if file.suffix not in _SUFFIXES:
        raise ValueError(f"file must end in {', '.join(_SUFFIXES)}, got {str(file)!r}")
    if file.suffix in EXPORTS:
        library(file.suffix)
