"""How stable number, cuts and errors of synergies are under noise, by ways to cut a recording.

Usage: python benchmarks/stability.py [--seeds N] [--rates HZ ...] [--methods NAME ...] FILE ...

Each recording of a right arm, joint angles or markers, and the bundled one (left arm), is resampled
to each rate and analysed, then again with white noise of 1 and of 2 mrad added to its angles, once
for every seed. A row says for one way to cut: the mean number of synergies and mean joint error
without added noise; in how many of the noisy analyses the number differs by at most one and the
joint error by at most a tenth, and in how many a cut comes back within 30 ms. The last columns are
of the native rate: `Analysis.uncertainty` of the first noisy recording marks cuts as stable and
gives ranges of number and joint error; they say how often its stable cuts come back within 30 ms in
the others and in the one without noise, and how many of these lie in its ranges.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from importlib.resources import files
from pathlib import Path

import numpy as np

import geodesic_ocp as go
from geodesic_ocp.synergies.segment_costs import SegmentCosts
from geodesic_ocp.synergies.uncertainty import bootstrap
from geodesic_ocp.trajectory.motion import bandwidth

Cutting = Callable[[go.Metric, go.Motion], Sequence[tuple[int, int]]]
NOISES = (0.001, 0.002)  # [rad]
NEAR = 0.03 * (1.0 + 1e-9)  # [s]


def priced_by_noise(metric: go.Metric, motion: go.Motion) -> Sequence[tuple[int, int]]:
    """Cut where a cut saves more than the Bayesian information criterion asks for, given the noise.

    The n + 2 parameters of a segment cost (n + 2) log(M n) times the variance of the noise that the
    filter leaves, for M = 2 f T independent samples, each of which lasts 1 / (2 f).
    """
    f, n = bandwidth(motion), len(motion.joint_names)
    variance = float(np.mean(motion.filter.noise**2)) * min(1.0, 2.0 * f / motion.rate)
    price = (n + 2) * np.log(2.0 * f * motion.duration * n) * variance / (2.0 * f)
    return go.synergies.segment_developed(metric, motion, deviation=float(np.sqrt(price)))


METHODS: dict[str, Cutting] = {
    "online": go.segment,
    "developed": go.synergies.segment_developed,
    **{
        f"developed-{deviation}": partial(go.synergies.segment_developed, deviation=deviation)
        for deviation in (0.03, 0.05, 0.06, 0.08)
    },
    "by-noise": priced_by_noise,
    "optimal": partial(go.synergies.segment_optimal, error=0.016),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--rates", type=float, nargs="+", default=[50, 100, 200, 500, 1000])
    parser.add_argument("--methods", nargs="+", choices=METHODS, default=["online", "developed"])
    parser.add_argument("--replicates", type=int, default=50)
    parser.add_argument("--recordings", action="store_true", help="also a row for each recording")
    options = parser.parse_args()
    bundled = Path(str(files("geodesic_ocp") / "data" / "climb.csv"))
    print(
        "| cuts | synergies | joints [rad] | number within 1 | error within 10 % | cuts back | "
        "stable cuts | of them back | number in range | error in range | ms |"
    )
    print("|---" * 11 + "|")
    rows: dict[str, list[np.ndarray]] = defaultdict(list)
    for file, side in [*((file, "right") for file in options.files), (bundled, "left")]:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            recording = go.read_recording(file, side)
        for name in options.methods:
            found = measured(recording, METHODS[name], options)
            rows[name].append(found)
            if options.recordings:
                print(row(f"{name}, {recording.name}", found), flush=True)
    for name, found in rows.items():
        print(row(f"**{name}**", np.nanmean(found, axis=0)))


def row(name: str, values: np.ndarray) -> str:
    count, error, *shares, milliseconds = values
    written = " | ".join(f"{100.0 * share:.0f} %" for share in shares)
    return f"| {name} | {count:.1f} | {error:.4f} | {written} | {milliseconds:.0f} |"


def measured(recording: go.trajectory.Recording, cutting: Cutting, options) -> np.ndarray:
    """Return the entries of a row, for one recording."""
    model = recording.model
    metric = go.KineticEnergy(model.with_armature(go.manifold.default_joint_inertia(model)))
    seen = recording.motion
    raw = go.Motion(
        seen.time, seen.q if seen.unfiltered is None else seen.unfiltered, seen.joint_names
    )
    clean, noisy, uncertain = [], [], []
    for rate in options.rates:
        native = abs(rate - raw.rate) < 25.0
        motion = raw if native else raw.resampled(rate)
        own = cut(metric, motion, cutting)
        clean.append(own)
        for noise in NOISES:
            others = [
                cut(metric, with_noise(motion, noise, seed), cutting)
                for seed in range(options.seeds)
            ]
            noisy.append((own, others))
            if native and options.replicates > 1:
                filtered = with_noise(motion, noise, 0).filtered()
                pairs = cutting(metric, filtered)
                spread = bootstrap(
                    model, metric, filtered, pairs, cutting, replicates=options.replicates
                )
                uncertain.append((spread, [own, *others[1:]]))
    counts = np.mean([len(own[0]) + 1 for own in clean])
    errors = np.mean([own[1] for own in clean])
    within, close, back = [], [], []
    for own, others in noisy:
        within += [abs(len(other[0]) - len(own[0])) <= 1 for other in others]
        close += [abs(other[1] - own[1]) <= 0.1 * own[1] for other in others]
        back += [comes_back(own[0], other[0]).mean() for other in others]
    stable, stable_back, counted, covered = [], [], [], []
    for spread, others in uncertain:
        stable.append(spread.stable.mean())
        low, high = spread.count_range
        least, most = spread.error_range("joint")
        for times, error in others:
            if spread.stable.any():
                stable_back.append(comes_back(spread.times[spread.stable], times).mean())
            counted.append(low <= len(times) + 1 <= high)
            covered.append(least <= error <= most)
    shares = [np.mean(each) if each else np.nan for each in (stable, stable_back, counted, covered)]
    milliseconds = 1e3 * timed(metric, raw.filtered(), cutting)
    return np.array([counts, errors, *map(np.mean, (within, close, back)), *shares, milliseconds])


def with_noise(motion: go.Motion, noise: float, seed: int) -> go.Motion:
    added = noise * np.random.default_rng(seed).normal(size=motion.q.shape)
    return go.Motion(motion.time, motion.q + added, motion.joint_names)


def cut(metric: go.Metric, motion: go.Motion, cutting: Cutting) -> tuple[np.ndarray, float]:
    """Return times of the inner cuts, and the mean joint error of the prediction."""
    filtered = motion.filtered()
    pairs = cutting(metric, filtered)
    costs = SegmentCosts(metric, filtered, "joint", None)
    costs(pairs)
    error = float(np.abs(costs.predicted(pairs) - filtered.q).mean())
    return filtered.time[[start for start, _ in pairs[1:]]], error


def comes_back(cuts: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return which of the cuts have another one within 30 ms."""
    return np.abs(cuts[:, None] - others).min(axis=1, initial=np.inf) <= NEAR


def timed(metric: go.Metric, motion: go.Motion, cutting: Cutting) -> float:
    start = time.process_time()
    cutting(metric, motion)
    return time.process_time() - start


if __name__ == "__main__":
    main()
