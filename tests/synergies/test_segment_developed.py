"""Cuts of a whole motion by its development."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import geodesic_ocp as go
from geodesic_ocp.manifold.exp import sample_geodesic
from geodesic_ocp.synergies.segment import development
from geodesic_ocp.synergies.segment_developed import chord_costs, least_cost_cuts

_LENGTH = 0.4  # sqrt(kg) m


def along_geodesics(metric: go.KineticEnergy, count: int, seed: int) -> tuple[go.Motion, list]:
    """Geodesics of 0.6 s into random directions, all as long, at one constant speed."""
    rng, model = np.random.default_rng(seed), metric.model
    middle, width = (model.lower + model.upper) / 2.0, 0.3 * (model.upper - model.lower)
    points = [middle]
    for _ in range(count):
        toward = middle + width * rng.uniform(-1.0, 1.0, middle.size) - points[-1]
        toward *= _LENGTH / metric.norm(points[-1], toward)
        points += [*sample_geodesic(metric, points[-1], toward, np.linspace(0.0, 1.0, 61))[0][1:]]
    time = np.arange(len(points)) / 100.0
    motion = go.Motion(time, np.array(points), model.joint_names)
    return motion, [0.6 * k for k in range(1, count)]


@pytest.fixture(scope="module")
def metric(arm: go.Model) -> go.KineticEnergy:
    return go.KineticEnergy(arm.with_armature(0.07))


def test_the_development_of_a_geodesic_is_straight_and_as_long(metric: go.KineticEnergy) -> None:
    motion, _ = along_geodesics(metric, 1, 0)
    curve = CubicSpline(motion.time, motion.q)
    moving = go.Motion(motion.time, motion.q, motion.joint_names, curve(motion.time, 1))
    seen = development(metric, moving)
    chord = seen.points[-1] - seen.points[0]
    length = go.distance(metric, motion.q[0], motion.q[-1])
    assert np.linalg.norm(chord) == pytest.approx(length, rel=1e-5)
    along = np.outer(seen.points @ chord / (chord @ chord), chord)
    assert np.abs(seen.points - along).max() < 1e-5 * length


@pytest.mark.slow
def test_a_chain_of_geodesics_is_cut_where_they_meet(metric: go.KineticEnergy) -> None:
    """To the sample without a filter, which rounds the corners over a tenth of a second."""
    for seed in range(3):
        motion, corners = along_geodesics(metric, 5, seed)
        steps = np.diff(motion.q, axis=0) / 0.01
        exact = replace(motion, velocity=np.vstack([steps, steps[-1:]]))
        noise = 2e-3 * np.random.default_rng(seed).normal(size=motion.q.shape)
        noisy = replace(motion, q=motion.q + noise).filtered()
        for seen, within in ((exact, 0.011), (noisy, 0.1)):
            found = go.synergies.segment_developed(metric, seen)
            cuts = seen.time[[start for start, _ in found[1:]]]
            assert cuts == pytest.approx(corners, abs=within)


def test_a_rest_is_a_segment() -> None:
    """Two reaches of one second with bell-shaped speeds, in one direction, and a pause between."""
    time = np.arange(300) / 100.0
    first, second = np.clip(time, 0.0, 1.0), np.clip(time - 2.0, 0.0, 1.0)
    x = sum(z**3 * (10.0 - 15.0 * z + 6.0 * z**2) for z in (first, second))
    motion = go.Motion(time, np.column_stack([x, 0.5 * x]), ("x", "y")).filtered(cutoff=8.0)
    found = go.synergies.segment_developed(go.Euclidean(2), motion, deviation=0.1)
    cuts = [time[start] for start, _ in found]
    assert cuts == pytest.approx([0.0, 1.0, 2.0], abs=0.1)
    merged = go.synergies.segment_developed(go.Euclidean(2), motion, deviation=0.5, rest=0.0)
    assert len(merged) == 2  # of at most two seconds


def test_a_larger_price_never_buys_more_cuts(metric: go.KineticEnergy) -> None:
    motion, _ = along_geodesics(metric, 5, 7)
    motion = motion.filtered()
    counts = [
        len(go.synergies.segment_developed(metric, motion, deviation=price))
        for price in (0.01, 0.04, 0.1, 1.0)
    ]
    assert counts == sorted(counts, reverse=True)
    with pytest.raises(ValueError, match="deviation must be positive"):
        go.synergies.segment_developed(metric, motion, deviation=0.0)
    with pytest.raises(ValueError, match="max_duration must be twice min_duration"):
        go.synergies.segment_developed(metric, motion, min_duration=1.5)


def test_costs_are_integrals_of_squared_distances_from_the_chord() -> None:
    rng = np.random.default_rng(0)
    points, step = np.cumsum(rng.normal(size=(40, 3)), axis=0), 0.02
    speeds = rng.uniform(0.0, 200.0, 40)
    costs = chord_costs(points, speeds, step, 25)
    assert costs.shape == (40, 25)
    for stop, d in ((10, 1), (20, 7), (39, 25), (25, 25)):
        start = stop - d
        chord, z = points[stop] - points[start], np.arange(d + 1) / d
        length = np.linalg.norm(chord)
        ends = np.minimum(speeds[[start, stop]] * d * step, 3.0 * length)
        hermite = np.column_stack([z - 2 * z**2 + z**3, z**3 - z**2])
        law = length * (3 * z**2 - 2 * z**3) + hermite @ ends
        away = points[start : stop + 1] - points[start] - np.outer(law, chord / length)
        assert costs[stop, d - 1] == pytest.approx(step * np.sum(away**2), rel=1e-9)
    assert np.isinf(costs[3, 3:]).all()


def test_cuts_are_the_best_of_all() -> None:
    costs = np.random.default_rng(1).uniform(0.0, 1.0, (9, 8))
    for penalty in (0.0, 0.1, 1.0):
        totals = {
            (0, *inner, 8): sum(
                costs[stop, stop - start - 1] + penalty for start, stop in pairwise((0, *inner, 8))
            )
            for count in range(8)
            for inner in combinations(range(1, 8), count)
        }
        assert tuple(least_cost_cuts(costs, penalty)) == min(totals, key=totals.__getitem__)
