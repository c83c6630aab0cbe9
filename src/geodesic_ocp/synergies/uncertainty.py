"""How sure the synergies of a recording are: a bootstrap under the recording's own noise."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from geodesic_ocp.arrays import Array, ShortRepr, as_choice, as_integer
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.manifold.metric import Metric
from geodesic_ocp.model.model import Model
from geodesic_ocp.progress import Progress, no_progress
from geodesic_ocp.synergies.scores import motion_errors
from geodesic_ocp.synergies.segment_costs import SegmentCosts
from geodesic_ocp.tables import markdown, new_table
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.noise import Noise, RecordingNoise, surrogate

if TYPE_CHECKING:
    from pandas import DataFrame

Pair = tuple[int, int]
#: How a motion is cut: metric and motion to (start, stop) sample indices.
Cutting = Callable[[Metric, Motion], Sequence[Pair]]

_SAME = 0.1  # [s] within which the nearest cut of a replicate is the same one: the shortest segment
_NEAR = 0.03  # [s] within which a stable cut comes back
_STABLE = 0.9  # in this share of the replicates
_MEASURES = ("joint", "position", "orientation")


@dataclass(frozen=True, eq=False, repr=False)
class Uncertainty(ShortRepr):
    """Spread of the synergies of a recording under its own noise, from `Analysis.uncertainty`.

    A replicate is the motion with noise of the recording's spectrum (`RecordingNoise`), or with
    errors of a fit to markers (`FitNoise`), filtered and cut again by the settings of the analysis
    (parametric bootstrap; Efron, Tibshirani, "An Introduction to the Bootstrap", 1993, chapter 6).
    Its noise comes on top of what the filter left in the recording, so that the spread is rather
    too large than too small.

    Attributes:
        count: number of synergies of the analysis.
        own_errors: mean errors of the analysis (3,), as in `errors`.
        times: times of its c cuts, both ends of the motion left out (c,) [s].
        counts: number of synergies in each of r replicates (r,).
        shares: share of the replicates in which each cut comes back within 0.1 s (c,).
        near: share of those in which it comes back within 0.03 s (c,).
        spreads: standard deviation of its time in the replicates in which it comes back (c,) [s].
        errors: mean errors of the replicates (r, 3), of the joints [rad], of the hand's position
            [m] and orientation [rad]; NaN where no geodesic was found.
    """

    count: int
    own_errors: Array
    times: Array
    counts: NDArray[np.int64]
    shares: Array
    near: Array
    spreads: Array
    errors: Array

    _shown = ("count", "counts", "times", "near")

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Which cuts come back within 0.03 s in at least 90 % of the replicates (c,)."""
        return self.near >= _STABLE

    @property
    def marks(self) -> list[Literal["stable", "doubtful"]]:
        """What each cut is said to be (c,)."""
        return ["stable" if each else "doubtful" for each in self.stable]

    @property
    def count_range(self) -> tuple[int, int]:
        """Least and largest number of synergies, see `error_range`."""
        low, high = _range(self.counts, self.count)
        return int(np.floor(low + 0.5)), int(np.ceil(high - 0.5))

    def error_range(self, measure: str) -> tuple[float, float]:
        """Return errors between which 90 % of the replicates lie, as they are and shifted so that
        their median is the error of the analysis: "joint" [rad], "position" [m] or "orientation"
        [rad].

        A replicate is filtered twice, so that its error may be smaller or larger as a rule.
        """
        column = _MEASURES.index(as_choice("measure", measure, _MEASURES))
        return _range(self.errors[:, column], float(self.own_errors[column]))

    def __str__(self) -> str:
        """Return the number, the errors and the stable cuts in sentences."""
        low, high = self.count_range
        joint = self.error_range("joint")
        position = self.error_range("position")
        return (
            f"Under the recording's own noise (90 % of {len(self.counts)} replicates): {low} to "
            f"{high} synergies, joints to {joint[0]:.3f} to {joint[1]:.3f} rad, hand to "
            f"{1e3 * position[0]:.0f} to {1e3 * position[1]:.0f} mm. {int(self.stable.sum())} of "
            f"{len(self.times)} cuts are stable: they come back within {1e3 * _NEAR:.0f} ms in at "
            f"least {100.0 * _STABLE:.0f} % of the replicates."
        )

    def table(self) -> DataFrame:
        """Return for every cut how often it comes back, its spread, and whether it is stable."""
        columns = (100.0 * self.shares, 100.0 * self.near, 1e3 * self.spreads)
        numbers = (each.tolist() for each in (self.times, *columns))
        rows = zip(*numbers, self.marks, strict=True)
        header = ("cut [s]", "within 0.1 s [%]", "within 0.03 s [%]", "spread [ms]", "cut is")
        return new_table(header, list(rows), str(self))

    def _repr_markdown_(self) -> str:
        return markdown(self.table())


def _range(values: NDArray[np.generic], own: float) -> tuple[float, float]:
    """Return the 5th and 95th percentile, of the values and of those shifted to the own value."""
    low, middle, high = np.nanpercentile(values.astype(float), [5.0, 50.0, 95.0])
    shift = own - middle
    return float(low + min(shift, 0.0)), float(high + max(shift, 0.0))


def bootstrap(
    model: Model,
    metric: Metric,
    motion: Motion,
    segments: Sequence[Pair],
    cutting: Cutting,
    *,
    noise: Noise | None = None,
    replicates: int = 100,
    seed: int = 0,
    progress: Progress | None = None,
) -> Uncertainty:
    """Return the spread of the segments of a filtered motion, see `Uncertainty`.

    Args:
        model: whose hand is measured.
        metric: metric of the segments.
        motion: with velocities.
        segments: (start, stop) sample indices of its own.
        cutting: cuts a replicate.
        noise: of the motion; None: that of the residuals of its filter.
        replicates: their number.
        seed: of the noise.
        progress: called with what is done, the number of replicates so far, and the total.

    Raises:
        ValueError: no noise is known, or of other samples, or fewer than two replicates.
    """
    replicates = as_integer("replicates", replicates, 2)
    random = np.random.default_rng(seed)
    noise = RecordingNoise.of(motion) if noise is None else noise
    report = progress or no_progress
    own = motion.time[[start for start, _ in segments[1:]]]
    counts = np.empty(replicates, dtype=np.int64)
    errors = np.empty((replicates, 3))
    found = np.full((replicates, own.size), np.nan)
    for number in range(replicates):
        report("drawing replicates", number, replicates)
        noisy = surrogate(motion, noise, random)
        pairs = [(int(start), int(stop)) for start, stop in cutting(metric, noisy)]
        counts[number] = len(pairs)
        found[number] = matched(own, noisy.time[[start for start, _ in pairs[1:]]])
        errors[number] = _errors(model, metric, noisy, pairs)
    report("done", replicates, replicates)
    back = np.isfinite(found)
    often = np.maximum(back.sum(axis=0), 1)
    away = np.where(back, found - own, 0.0)
    spreads = np.sqrt(
        np.maximum((away**2).sum(axis=0) / often - (away.sum(axis=0) / often) ** 2, 0)
    )
    near = np.mean(back & (np.abs(away) <= _NEAR * (1.0 + 1e-9)), axis=0)
    own_errors = _errors(model, metric, motion, segments)
    shares = back.mean(axis=0)
    return Uncertainty(len(segments), own_errors, own, counts, shares, near, spreads, errors)


def _errors(model: Model, metric: Metric, motion: Motion, segments: Sequence[Pair]) -> Array:
    """Return mean errors (3,) of the prediction; NaN where no geodesic was found."""
    costs = SegmentCosts(metric, motion, "joint", None)
    costs(segments)
    try:
        predicted = Motion(motion.time, costs.predicted(segments), motion.joint_names)
    except NotConverged:
        return np.full(len(_MEASURES), np.nan)
    return np.array(motion_errors(model, motion, predicted).means)


def matched(cuts: Array, others: Array) -> Array:
    """Return for every cut (c,) [s] the other one that is the same, NaN where there is none.

    Two cuts are the same if each is the nearest to the other, and they are at most 0.1 s apart.
    """
    if not cuts.size or not others.size:
        return np.full(cuts.shape, np.nan)
    distances = np.abs(cuts[:, None] - others)
    nearest = distances.argmin(axis=1)
    back = distances.argmin(axis=0)
    same = back[nearest] == np.arange(cuts.size)
    same &= distances.min(axis=1) <= _SAME * (1.0 + 1e-9)
    return np.where(same, others[nearest], np.nan)
