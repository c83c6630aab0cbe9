"""Gaps that a recording holds as numbers: rows of zeros, 9999, -3.7e28."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array

# A jump is this many standard deviations of the noise, and at least so far [rad or m].
JUMP = 10.0
LEAST = 0.08
NORMAL_MEDIAN = 0.6745  # median of the absolute value of a standard normal variable
NEAR = 5  # values to each side, by which the steps and the noise around a sample are measured


def smallest_step(values: Array) -> float:
    """Return the smallest difference between the numbers (k,) of a column: its resolution.

    It is that of the sensor, or of the digits in the file; 0 if all numbers are the same.
    """
    levels = np.unique(values[np.isfinite(values)])
    steps = np.diff(levels)
    steps = steps[steps > _rounding(levels[1:])]
    return float(steps.min(initial=np.inf)) if steps.size else 0.0


def _rounding(values: Array) -> Array:
    """Return by how much numbers may differ that were converted from one, in a few operations."""
    return 8.0 * np.spacing(np.abs(values))


def gap_samples(series: Array, impossible: float) -> NDArray[np.bool_]:
    """Return where numbers stand for a gap (k, n).

    Such a number is repeated, exactly, and the series jumps to it and back from it: by more than a
    motion explains that is as fast as the one before and after, by more than the noise there, and
    by more than one step of the sensor. At the beginning or the end of a recording one jump is
    enough. A series that comes to rest moves there smoothly, and does not jump; one that is held at
    a limit arrives by a step no larger than those before.

    A number that is not repeated is a gap if no motion can lead there and back in one sample, or if
    it is that of all series in the first or the last sample.

    Args:
        series: (k, n, c), such as n joints of one coordinate or n markers of three; NaN where a
            sample is known to be missing.
        impossible: distance that nothing moves in one sample [rad or m].
    """
    count, n, _ = series.shape
    gaps = np.zeros((count, n), dtype=bool)
    if count < 2:
        return gaps
    same_ends = _all_same(series)
    with np.errstate(over="ignore"):  # damaged files have numbers of any size
        runs = [_runs(series[:, index], impossible, same_ends) for index in range(n)]
    found = {run for each in runs for run, is_gap in each.items() if is_gap}
    for first, last in found:
        for index, each in enumerate(runs):
            # Series that are equal for just as long are part of the same gap, without a jump too.
            gaps[first : last + 1, index] |= (first, last) in each
    return gaps


def _all_same(series: Array) -> NDArray[np.bool_]:
    """Return which of the first and the last sample is one number in all of several series (2,)."""
    ends = series[[0, -1]].reshape(2, -1)
    several = series.shape[1] > 1
    result: NDArray[np.bool_] = several & np.all(ends == ends[:, :1], axis=1)
    return result


def _runs(
    values: Array, impossible: float, same_ends: NDArray[np.bool_]
) -> dict[tuple[int, int], bool]:
    """Return whether runs of one value (k, c) are a gap, by the first and the last sample of each.

    Runs of one sample are left out, but for gaps and for ends that all series have in common.
    """
    distances = np.linalg.norm(np.diff(values, axis=0), axis=1)
    sizes = np.linalg.norm(values, axis=1)
    changes = np.flatnonzero(~(distances <= _rounding(sizes[1:])))  # NaN is a change
    starts = np.concatenate([[0], changes + 1])
    lasts = np.concatenate([changes, [len(values) - 1]])
    repeated = lasts > starts
    if len(starts) > 1:
        repeated[[0, -1]] |= same_ends
    bounds = zip(starts[repeated].tolist(), lasts[repeated].tolist(), strict=True)
    result = dict.fromkeys(bounds, False)
    if len(starts) == 1:
        return result
    levels = values[starts]
    steps = np.linalg.norm(np.diff(levels, axis=0), axis=1)  # NaN beside a missing sample
    outer = np.full(1, np.nan)
    smaller = np.fmin(np.concatenate([outer, steps]), np.concatenate([steps, outer]))
    candidates = np.flatnonzero((repeated & (smaller > LEAST)) | (smaller > impossible)).tolist()
    if not candidates:
        return result
    lengths = lasts - starts
    kept = np.ones(len(levels), dtype=bool)
    # Beside a gap a joint at rest jumps, too; without the gap it does not. Two jumps tell more than
    # one, and gaps are shorter than rests.
    ends = (0, len(levels) - 1)
    for run in sorted(candidates, key=lambda each: (each in ends, lengths[each])):
        wide = 2 * NEAR  # every second of these values may be a gap
        near = slice(max(run - wide, 0), run), slice(run + 1, run + 1 + wide)
        before, after = (levels[part][kept[part]] for part in near)
        usual = np.median(np.concatenate([lengths[part] for part in near]))
        explained = max(_explained(levels[run], before[::-1], after), LEAST)
        if lengths[run] <= usual and (lengths[run] or not repeated[run]):
            explained = max(explained, impossible)  # every sample is there as often
        jumps = np.linalg.norm(np.vstack([before[-1:], after[:1]]) - levels[run], axis=1)
        if np.isnan(jumps).all():
            continue
        if np.nanmin(jumps) > explained and np.nanmin(jumps) > _step_of(levels, levels[run]):
            kept[run] = False
            result[int(starts[run]), int(lasts[run])] = True
    return result


def _step_of(levels: Array, level: Array) -> float:
    """Return half more than one step of the sensor that other levels (m, c) have; infinite if these
    are one, as of a switch.
    """
    others = levels[np.any(levels != level, axis=1)]
    resolution = float(np.linalg.norm([smallest_step(column) for column in others.T]))
    return 1.5 * resolution if resolution else float("inf")


def _explained(level: Array, before: Array, after: Array) -> float:
    """Return how far a motion and its noise take a series from the values around a level to it.

    Args:
        level: (c,).
        before, after: values (m, c), the nearest first; the same level does not count.

    Returns:
        A distance, infinite if there are too few values.
    """
    steps: list[float] = []
    turns: list[float] = []
    for part in (before, after):
        others = part[np.any(part != level, axis=1)][:NEAR]
        steps += np.linalg.norm(np.diff(others, axis=0), axis=1).tolist()
        turns += np.linalg.norm(np.diff(others, n=2, axis=0), axis=1).tolist()
    if np.isfinite(steps).sum() < NEAR - 1:  # of one side
        return np.inf
    # The variance of a second difference is six times that of the noise.
    noise = float(np.nanmedian(turns)) if np.isfinite(turns).any() else 0.0
    # From rest, with constant acceleration, the second step is three times the first.
    fastest = 3.0 * float(np.nanmedian(steps))
    return max(fastest, JUMP * noise / (NORMAL_MEDIAN * float(np.sqrt(6.0))))
