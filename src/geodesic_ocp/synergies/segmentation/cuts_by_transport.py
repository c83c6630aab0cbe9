"""Times at which an observed motion has turned from the geodesic on which it started."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from geodesic_ocp.arrays import Array, evaluate
from geodesic_ocp.manifold.metric import Metric

MOVING, AT_REST, IN_LONG_REST = range(3)  # states of an instant


def cuts_by_transport(
    metric: Metric,
    times: Array,
    curve: Array,
    velocity: Array,
    state: np.ndarray,
    threshold: float,
    hysteresis: float,
    duration: float,
) -> tuple[Array, float, int]:
    """Interpreted, what `Kernels.segment` does; the rule is in the docstring of `segment`."""
    observed = _Observed(metric, times, curve, velocity, state)
    resting = state == IN_LONG_REST
    inner = np.flatnonzero(np.diff(resting[:-1].astype(int))) + 1
    cuts: list[float] = []
    for start, stop in pairwise([0, *inner.tolist(), times.size - 1]):
        cuts.append(times[start])
        if not resting[start]:
            cuts += observed.cuts_within(start, stop, threshold, hysteresis, duration)
    return np.array([*cuts, times[-1]]), observed.change, observed.worst


class _Observed:
    """A curve with the metric along it, and the error of the transports so far."""

    def __init__(
        self, metric: Metric, times: Array, curve: Array, velocity: Array, state: np.ndarray
    ) -> None:
        n = metric.dim
        self.metric, self.times, self.curve, self.state = metric, times, curve, state
        self.velocity = velocity
        tensors = evaluate(metric._matrix_function.map(times.size), curve[::2, :n].T)
        self.tensors = tensors.reshape(n, times.size, n).swapaxes(0, 1)
        self.turns = self._turns()
        self.change, self.worst = 0.0, 0

    def _step(self, vector: Array, i: int) -> Array:
        """The vector, transported from instant i - 1 to i."""
        size = self.times[i] - self.times[i - 1]
        points = self.curve[2 * i - 2 : 2 * i + 1].T
        return np.asarray(self.metric.transport_step(vector, points, size).full()[:, 0])

    def _turns(self) -> Array:
        """Angles by which the velocity turns from the instant before (m,); 0 for the first."""
        steps, rows = np.diff(self.times), 2 * np.arange(self.times.size - 1)[:, None]
        points = self.curve[(rows + np.arange(3)).ravel()].T
        transport = self.metric.transport_step.map(steps.size)
        before = evaluate(transport, self.velocity[:-1].T, points, steps[None]).T
        with np.errstate(invalid="ignore", divide="ignore"):  # next to a velocity of zero
            turns = map(_angle, self.tensors[1:], before, self.velocity[1:])
            return np.array([0.0, *turns])

    def steadiest(self, start: int, first: int, stop: int, until: float) -> int | None:
        """The moving instant in [first, stop) until this time whose velocity turns most slowly.

        If none moves until then, it is the first that does.
        """
        moving = [i for i in range(first, stop) if self.state[i] == MOVING]
        soon = [i for i in moving if self.times[i] <= until] or moving[:1]
        return min(soon, key=lambda i: self._turning_rate(start, i), default=None)

    def _turning_rate(self, start: int, i: int) -> float:
        """[rad/s], from both neighbours of an instant in a stretch that begins at `start`."""
        before = max(i - 1, start)
        turn = self.turns[i + 1] + (self.turns[i] if i > start else 0.0)
        rate = turn / (self.times[i + 1] - self.times[before])
        return float(rate) if np.isfinite(rate) else np.inf

    def cuts_within(
        self, start: int, stop: int, threshold: float, hysteresis: float, duration: float
    ) -> list[float]:
        """Cuts in a stretch between long rests."""
        cuts: list[float] = []
        last = begin = float(self.times[start])
        first = start
        while (reference := self.steadiest(start, first, stop, begin + duration)) is not None:
            crossing = self.crossing(reference, stop, threshold, hysteresis)
            if crossing is None:
                break
            if crossing - last >= duration and self.times[stop] - crossing >= duration:
                cuts.append(crossing)
                last = crossing
            begin = crossing
            first = max(reference + 1, int(np.searchsorted(self.times, crossing)))
        return cuts

    def crossing(
        self, reference: int, stop: int, threshold: float, hysteresis: float
    ) -> float | None:
        """When the angle to the velocity at `reference` rises above the threshold for good.

        That is, without falling back below it before it exceeds threshold + hysteresis.
        """
        transported = self.velocity[reference]
        norm = _norm(self.tensors[reference], transported)
        previous: float | None = 0.0
        above: float | None = None
        for i in range(reference + 1, stop):
            transported = self._step(transported, i)
            now = _norm(self.tensors[i], transported)
            relative = abs(now - norm) / norm
            if not (relative <= self.change or np.isnan(self.change)):
                self.change, self.worst = relative, i
            norm = now
            if self.state[i] != MOVING:
                previous = None
                continue
            angle = _angle(self.tensors[i], transported, self.velocity[i])
            if not angle > threshold:
                above = None
            else:
                if above is None:
                    above = float(self.times[i])
                    if previous is not None:
                        part = (angle - threshold) / (angle - previous)
                        above -= part * float(self.times[i] - self.times[i - 1])
                if angle > threshold + hysteresis:
                    return above
            previous = angle
        return None


def _norm(tensor: Array, v: Array) -> float:
    return float(np.sqrt(v @ tensor @ v))


def _angle(tensor: Array, u: Array, v: Array) -> float:
    """As in `Metric.angle`, with NaN where the metric is not defined."""
    unit_u, unit_v = u / _norm(tensor, u), v / _norm(tensor, v)
    return float(2.0 * np.arctan2(_norm(tensor, unit_u - unit_v), _norm(tensor, unit_u + unit_v)))
