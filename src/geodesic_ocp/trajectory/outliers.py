"""What in a recording is no motion: spikes, repeated frames, revolutions, frozen sensors, gaps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.trajectory.gaps import (
    JUMP,
    LEAST,
    NEAR,
    NORMAL_MEDIAN,
    gap_samples,
    smallest_step,
)

ALL_JOINTS = "all joints"
Kind = Literal["spike", "repeated frame", "wrap", "frozen", "gap"]
_WINDOW = 0.5  # [s] to both sides, over which the noise is measured
_WRAP = 0.5  # [rad] by which a step may differ from whole revolutions
_REPEATED = 3  # frames at most that are repeated and then caught up with
_OFTEN = 0.2  # share of frames that repeat the one before, above which it is no exception
_CATCH_UP = 1.5  # times the step before, at least, after a repeated frame
# A sensor is frozen if it repeats a number so long while another joint moves so far.
_FROZEN = 0.1  # [s], [rad or m]
_ELSEWHERE = 0.05  # [s], [rad or m]
_AT_LIMIT = 1e-3  # [rad or m] from the end of a joint's range, where a fit to markers holds it
_ALTERNATING = -0.4  # correlation of successive fourth differences: -0.8 of noise, 1 of a curve


@dataclass(frozen=True, repr=False)
class Outlier(ShortRepr):
    """Samples of a recording that are no motion, and what was done about them.

    Attributes:
        kind: "spike", one sample that is far from its neighbours; "repeated frame", equal to the
            one before in all joints and caught up with afterwards; "wrap", a step by whole
            revolutions; "frozen", a joint that repeats a number while others move, or beside a
            jump; "gap", a number to which a joint jumps and back (`gap_samples`).
        joint: name of the joint; of a repeated frame "all joints".
        start, stop: times of the first and the last such sample [s].
        size: how far a spike is from its neighbours, or a wrap [rad]; else 0.
    """

    kind: Kind
    joint: str
    start: float
    stop: float
    size: float = 0.0

    def __str__(self) -> str:
        """Return what it is, when, and what was done, as a phrase."""
        at = f"{self.joint} at {self.start:.3f} s"
        if self.kind == "spike":
            return f"{at} is {abs(self.size):.2g} rad off its neighbours (spike, interpolated)"
        if self.kind == "wrap":
            turns = round(self.size / (2.0 * np.pi))
            return f"{at} steps by {360 * turns:+d} deg (wrap, undone)"
        if self.kind == "repeated frame":
            return f"{at} repeat the frame before (interpolated)"
        span = f"{self.joint} from {self.start:.3f} to {self.stop:.3f} s"
        kept = "kept: cut the recording there, or leave it out"
        if self.kind == "gap":
            return f"{span} jumps to a number and back (gap, {kept})"
        return f"{span} repeats one number while others move or beside a jump (frozen, {kept})"


def without_outliers(
    time: Array, q: Array, names: Sequence[str]
) -> tuple[Array, tuple[Outlier, ...]]:
    """Return coordinates without spikes, repeated frames and wraps, and what was found.

    A spike is told by its distance from the cubic through two neighbours on each side, a fourth
    difference: ten times the standard deviation of these distances around it and in the whole
    recording, and 0.08 rad or more. A frozen sensor is not told from a joint at the end of its
    range, nor from one that stands still within the resolution of its numbers, and a recording of
    fewer than nine samples is taken as it is.

    Args:
        time: (k,) [s].
        q: (k, n) [rad or m].
        names: of the n joints.
    """
    if len(time) < 9:
        return q, ()
    resolutions = [smallest_step(column) for column in q.T]
    q = np.array(q)
    found = list[Outlier]()
    for column, name in enumerate(names):
        found += _unwrap(time, q[:, column], name)
    missing = np.zeros(q.shape, dtype=bool)
    for first, last in _repeated(q, float(np.linalg.norm(resolutions))):
        missing[first : last + 1] = True
        found.append(Outlier("repeated frame", ALL_JOINTS, time[first], time[last]))
    _interpolate(time, q, missing)
    gaps = gap_samples(q[:, :, None], np.inf)
    found += _gaps(time, gaps, names)
    half = max(4, round(_WINDOW * (len(time) - 1) / float(time[-1] - time[0])))
    missing[:] = False
    for column, name in enumerate(names):
        away = _off_neighbours(q[:, column])
        noise = _local_noise(away, half)
        for sample in _spikes(q[:, column], away, noise):
            missing[sample, column] = True
            found.append(Outlier("spike", name, time[sample], time[sample], float(away[sample])))
        stands = [*_frozen(time, q, column, away, noise, resolutions[column])]
        found += [
            Outlier("frozen", name, time[first], time[last])
            for first, last in stands
            if not gaps[first, column]
        ]
    _interpolate(time, q, missing)
    return q, tuple(sorted(found, key=lambda each: each.start))


def turns_between(angle: Array) -> Array:
    """Return the whole revolutions (k - 1,) by which angles (k,) step, 0 where steps are others."""
    steps = np.diff(angle)
    turns = np.round(steps / (2.0 * np.pi))
    turns[np.abs(steps - 2.0 * np.pi * turns) > _WRAP] = 0.0
    return turns


def _unwrap(time: Array, angle: Array, name: str) -> Iterator[Outlier]:
    """Yield steps by whole revolutions, and take them out of the angle in place."""
    turns = turns_between(angle)
    for sample in np.flatnonzero(turns):
        size = float(2.0 * np.pi * turns[sample])
        yield Outlier("wrap", name, time[sample + 1], time[sample + 1], size)
    if np.any(turns):
        ahead = np.concatenate([[0.0], np.cumsum(turns)])
        usual = scipy.stats.mode(ahead).mode  # most samples stay as they are
        angle -= 2.0 * np.pi * (ahead - usual)


def _runs(flags: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return first indices of runs of true flags, and those after their ends (r, 2)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return edges.reshape(-1, 2)


def _repeated(q: Array, resolution: float) -> Iterator[tuple[int, int]]:
    """Yield first and last frames that repeat the one before, if the next one catches up.

    Coarse sensors repeat frames as well: there the next one is a step or two of each off.
    """
    steps = np.linalg.norm(np.diff(q, axis=0), axis=1)
    if np.mean(steps == 0.0) > _OFTEN:  # it rests, or every sample is there twice
        return
    for first, after in _runs(steps == 0.0):
        if first == 0 or after == len(steps) or after - first > _REPEATED:
            continue
        # Joints move before and after, as far as in the frames that are lost.
        before = steps[first - 1]
        next_one = steps[after]
        usual = np.median(steps[max(0, first - 5) : after + 6])
        explained = max(_CATCH_UP * max(before, usual), 2.0 * resolution)
        if next_one > explained and before > 0.0:
            yield int(first + 1), int(after)


def _off_neighbours(values: Array) -> Array:
    """Return distances from the cubic through two neighbours on each side; 0 at the four ends."""
    off = np.zeros(len(values))
    near = values[1:-3] + values[3:-1]
    far = values[:-4] + values[4:]
    off[2:-2] = values[2:-2] - (4.0 * near - far) / 6.0
    return off


def _local_noise(away: Array, half: int) -> Array:
    """Return standard deviations of these distances around every sample, which no spike changes."""
    size = min(2 * half + 1, len(away) // 2 * 2 - 1)
    medians = scipy.ndimage.median_filter(np.abs(away[2:-2]), size=size, mode="mirror")
    # A joint that stands still, or is held at a limit, has no noise for a while.
    medians = np.maximum(medians, np.median(np.abs(away[2:-2])))
    return np.pad(np.asarray(medians, dtype=float), 2, mode="edge") / NORMAL_MEDIAN


def _spikes(values: Array, away: Array, noise: Array) -> list[int]:
    """Return samples that stick out of both neighbours, and are the worst within two samples."""
    found = []
    for sample in np.flatnonzero(np.abs(away) > np.maximum(JUMP * noise, LEAST)):
        sides = values[sample] - values[[sample - 1, sample + 1]]
        worst = np.abs(away[sample - 2 : sample + 3]).max()
        # Of a step, both sides differ in sign; of a fast turn, they are much less than the rest.
        if sides.prod() > 0.0 and np.abs(sides).min() > 0.5 * worst == 0.5 * abs(away[sample]):
            found.append(int(sample))
    return found


def _gaps(time: Array, gaps: NDArray[np.bool_], names: Sequence[str]) -> Iterator[Outlier]:
    """Yield gaps (k, n), those of all joints as one."""
    common: NDArray[np.bool_] = np.all(gaps, axis=1)
    columns = {ALL_JOINTS: common, **dict(zip(names, (gaps & ~common[:, None]).T, strict=True))}
    if len(names) == 1:
        columns = {names[0]: common}
    for name, column in columns.items():
        for first, after in _runs(column):
            yield Outlier("gap", name, time[first], time[after - 1])


def _frozen(
    time: Array, q: Array, column: int, away: Array, noise: Array, resolution: float
) -> Iterator[tuple[int, int]]:
    """Yield first and last samples of spans in which a joint repeats a number while another moves.

    A joint whose noise is small against the resolution of its numbers repeats them wherever it
    stands still, or moves by less than that. It is frozen where it repeats one for longer than it
    would by chance, once in twenty recordings, or beside a jump, whether others move or not.
    """
    values = q[:, column]
    for first, after in _runs(np.diff(values) == 0.0):
        span = slice(first, after + 1)
        if after - first < NEAR or time[after] - time[first] < _FROZEN:
            continue
        if np.ptp(values) < LEAST:
            continue
        if min(values[first] - values.min(), values.max() - values[first]) < _AT_LIMIT:
            continue
        edges = [edge for edge in (first, first + 1, after, after + 1) if edge < len(values)]
        jumps = np.abs(away[edges]) > np.maximum(JUMP * noise[edges], max(LEAST, 2.0 * resolution))
        beyond = [edge for edge in (first - 2, after + 2) if 0 <= edge < len(values)]
        stays_away = np.abs(values[beyond] - values[first]).max() > LEAST  # which no spike does
        if jumps.any() and stays_away:
            yield int(first), int(after)
            continue
        if np.ptp(q[span], axis=0).max() < _ELSEWHERE:
            continue
        others = np.delete(away[2:-2], np.s_[max(first - 4, 0) : after + 1])
        noisy = others.size > 8 and others[1:] @ others[:-1] < _ALTERNATING * (others @ others)
        chance = _stay(np.abs(others), resolution) if noisy else 1.0
        by_chance = len(values) * chance ** float(after + 1 - first)
        if by_chance < 0.05:
            yield int(first), int(after)


def _stay(away: Array, resolution: float) -> float:
    """Return the largest probability of one number, where the true value is in the middle of a
    step: erf(r / sqrt(8) s), with the resolution r and the noise s apart from that of rounding; 1
    where s is less than r, as the steps themselves look like such noise.

    Args:
        away: distances (m,) from the cubic, which also have 4/6 of the noise of two neighbours and
            1/6 of that of two more.
        resolution: [rad or m].
    """
    noise = float(np.median(away)) / NORMAL_MEDIAN * 6.0 / 70.0**0.5
    own = math.sqrt(max(0.0, noise**2 - resolution**2 / 12.0))
    return math.erf(resolution / (math.sqrt(8.0) * own)) if own > resolution else 1.0


def _interpolate(time: Array, q: Array, missing: NDArray[np.bool_]) -> None:
    """Replace missing samples (k, n) by the cubic spline through the others, in place."""
    for column in np.flatnonzero(missing.any(axis=0)):
        there = ~missing[:, column]
        spline = scipy.interpolate.CubicSpline(time[there], q[there, column])
        q[~there, column] = spline(time[~there])
