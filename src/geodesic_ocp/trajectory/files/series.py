"""Series: columns of numbers over time with gaps, which are bridged or divide a recording.

A gap is an empty cell, nan, or a number that stands for one (`gap_samples`). Short gaps are bridged
on request, and long ones divide the recording into parts. Every format of joint angles passes here.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.trajectory.gaps import gap_samples
from geodesic_ocp.trajectory.motion import FrameMotion, Motion
from geodesic_ocp.trajectory.outliers import turns_between
from geodesic_ocp.trajectory.recording import LARGEST_ANGLE

_SHORTEST = 0.5  # [s] of a part between gaps


class Gaps(RecordingError):
    """Samples of a recording are missing; `parts` has start and end [s] of the parts between."""

    def __init__(self, message: str, parts: Sequence[tuple[float, float]] = ()) -> None:
        super().__init__(message)
        self.parts = tuple(parts)


@dataclass(frozen=True, eq=False)
class Series:
    """Columns of a recording over time.

    Attributes:
        time: (k,) [s].
        q: numbers (k, n) [rad or m], NaN where the file has none.
        joint_names: names of the n columns.
    """

    time: Array
    q: Array
    joint_names: tuple[str, ...]

    @cached_property
    def stand_for_gaps(self) -> NDArray[np.bool_]:
        """Where numbers stand for a gap (k, n); angles that were wrapped jump back as well."""
        q = np.array(self.q)
        for column in q.T:
            known = np.isfinite(column)
            turns = turns_between(column[known])
            turns[2.0 * np.pi * np.abs(turns) > LARGEST_ANGLE] = 0.0
            column[np.flatnonzero(known)[1:]] -= 2.0 * np.pi * np.cumsum(turns)
        return gap_samples(q[:, :, None], LARGEST_ANGLE)

    @cached_property
    def known(self) -> Array:
        """The numbers (k, n), NaN in all gaps."""
        return np.where(self.stand_for_gaps, np.nan, self.q)

    def motion(
        self, file: Path, joints: Sequence[str], *, fill: float | None, part: int | None
    ) -> Motion:
        """Return the motion of these columns, whose gaps alone matter.

        Args:
            file: of the recording, for messages.
            joints: names of columns, in the order of the result.
            fill: longest gap [s] that is bridged by interpolation; None: none may be.
            part: number, from 1, of the part between longer gaps.

        Raises:
            Gaps: there are longer ones, and no part is asked for.
            RecordingError: there is no such column.
            ValueError: there is no such part.
        """
        if missing := [name for name in joints if name not in self.joint_names]:
            raise RecordingError(
                f"there is no joint {', '.join(missing)}; there are {', '.join(self.joint_names)}"
            )
        columns = [self.joint_names.index(name) for name in joints]
        chosen = Series(self.time, self.q[:, columns], tuple(joints))
        kept, q = chosen._complete(file, fill, part)
        return Motion(self.time[kept], q, chosen.joint_names)

    def _complete(
        self, file: Path, fill: float | None, part: int | None
    ) -> tuple[NDArray[np.int64], Array]:
        """Return the samples of a part, or of all, and their numbers with short gaps bridged."""
        time = self.time
        q = np.array(self.known)
        missing = np.isnan(self.known)
        every = np.arange(len(time))
        if not missing.any() and part in (None, 1):
            return every, q
        filled = np.zeros(0, dtype=int)
        for column in range(q.shape[1]):
            known = np.flatnonzero(~missing[:, column])
            gaps = np.flatnonzero(np.diff(known) > 1)
            if fill is not None and known.size > 1 and gaps.size:
                short = np.diff(time[known])[gaps] <= fill * (1.0 + 1e-9)
                curve = scipy.interpolate.Akima1DInterpolator(
                    time[known], q[known, column], method="makima"
                )
                for gap in gaps[short]:
                    inside = np.arange(known[gap] + 1, known[gap + 1])
                    q[inside, column] = curve(time[inside])
                filled = np.append(filled, known[gaps[short]])
        gone = np.isnan(q)
        rows = np.flatnonzero(~gone.any(axis=1))
        runs = [each for each in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1) if each.size]
        parts = [each for each in runs if time[each[-1]] - time[each[0]] >= _SHORTEST]
        whole = len(runs) == 1 and len(parts) == 1 and fill is not None  # ends alone may be missing
        if part is None and gone.any() and not whole:
            raise self._gaps(file, gone, parts)
        if part is not None and not 1 <= part <= len(parts):
            raise ValueError(f"part must be a number from 1 to {len(parts)}, got {part}")
        kept = every if not gone.any() and part is None else parts[(part or 1) - 1]
        bridged = int(np.isin(filled, kept).sum())
        done = [f"{bridged} gap{'s'[: bridged - 1]} of up to {fill:g} s bridged"] if bridged else []
        if kept.size < len(time):
            done.append(f"the part from {time[kept[0]]:.2f} to {time[kept[-1]]:.2f} s alone")
        if done:
            told = f"{file}: read with {' and '.join(done)}{self._reason()}"
            warnings.warn(told, RuntimeWarning, stacklevel=5)
        return kept, q[kept]

    def _reason(self) -> str:
        """Return which samples are gaps although they have numbers, as the end of a message."""
        rows = np.flatnonzero(self.stand_for_gaps.any(axis=1))
        if not rows.size:
            return ""
        columns = np.flatnonzero(self.stand_for_gaps.any(axis=0))
        every = columns.size == len(self.joint_names) > 1
        names = "every joint" if every else ", ".join(self.joint_names[k] for k in columns)
        jump = "jumps" if every or columns.size == 1 else "jump"
        number = self.q[rows[0], columns[np.argmax(self.stand_for_gaps[rows[0], columns])]]
        start = f"{self.time[rows[0]]:.3f} s"
        gaps = f"{rows.size} samples from {start} on are gaps"
        if rows.size == 1:
            gaps = f"the sample at {start} is a gap"
        return f"; {gaps}, as {names} {jump} there to a number such as {number:.6g} and back"

    def _gaps(
        self, file: Path, gone: NDArray[np.bool_], parts: Sequence[NDArray[np.int64]]
    ) -> Gaps:
        """Return the error that says what is missing, and what reads the file nevertheless.

        Args:
            gone: where samples are missing (k, n) in gaps that are not bridged.
            parts: samples of the parts between them.
        """
        spans = [(float(self.time[each[0]]), float(self.time[each[-1]])) for each in parts]
        row, column = np.argwhere(gone)[0]
        lacking = int(gone.any(axis=1).sum())
        remedies = []
        longest = max(self._longest_gap(each) for each in gone.T)
        if empty := [self.joint_names[k] for k in np.flatnonzero(gone.all(axis=0))]:
            remedies.append(f"no sample has {', '.join(empty)}")
        elif longest > 0.0:
            enough = math.ceil(1e3 * longest * (1.0 - 1e-9)) / 1e3  # not less, in few digits
            remedies.append(
                f"fill={enough:g} (--fill {enough:g}) bridges all gaps, of which the longest "
                f"lasts {longest:.3g} s"
            )
        if spans:
            between = ", ".join(f"{start:.2f} to {end:.2f} s" for start, end in spans)
            reads = "part=1 (--part 1), ... reads the parts apart that are"
            if len(spans) == 1:
                reads = "part=1 (--part 1) reads the part that is"
            remedies.append(f"{reads} whole for {_SHORTEST:g} s or more: {between}")
        elif not empty:
            remedies.append(f"no part is whole for {_SHORTEST:g} s")
        return Gaps(
            f"{file}: {self.joint_names[column]} is missing at {self.time[row]:.3f} s; in all "
            f"{lacking} of {len(self.time)} samples lack a joint{self._reason()}; "
            + "; ".join(remedies),
            spans,
        )

    def _longest_gap(self, gone: NDArray[np.bool_]) -> float:
        """Return how long a column lacks numbers (k,) between two that it has [s]."""
        known = self.time[~gone]
        apart = np.diff(np.flatnonzero(~gone)) > 1
        return float(np.diff(known)[apart].max(initial=0.0))


def without_gaps(file: Path, motion: Motion, *, fill: float | None, part: int | None) -> Motion:
    """Return a motion whose numbers may stand for gaps without these, see `Series.motion`.

    Where a gap is bridged, the pose of the trunk is interpolated, too.
    """
    series = Series(motion.time, motion.q, motion.joint_names)
    if part is None and not series.stand_for_gaps.any():
        return motion
    kept, q = series._complete(file, fill, part)
    time = motion.time[kept]
    trunk = motion.trunk
    if trunk is not None:
        there = ~series.stand_for_gaps.any(axis=1)
        if there.all():
            trunk = FrameMotion(trunk.rotations[kept], trunk.positions[kept])
        else:
            known = FrameMotion(trunk.rotations[there], trunk.positions[there])
            trunk = known.interpolated(motion.time[there], time)
    return replace(motion, time=time, q=q, trunk=trunk)
