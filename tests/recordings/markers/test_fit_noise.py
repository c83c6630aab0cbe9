"""Errors of fitted angles, as the markers' errors tell them."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
from marked_motion import HEIGHT, MMM_MARKERS, angles, placed

import geodesic_ocp as go
from geodesic_ocp.recordings.markers.fit_markers import fit_markers
from geodesic_ocp.recordings.markers.markers import Markers


@pytest.mark.slow
def test_drawn_errors_are_as_large_and_as_slow_as_the_true_ones() -> None:
    """Skin that moves by 5 mm within tenths of a second, at markers around an arm."""
    arm, time = go.human_arm("right", HEIGHT), np.arange(100) / 50.0
    q, random = angles(arm, time), np.random.default_rng(0)
    places = {
        name: (segment, HEIGHT * np.array(offset))
        for name, (segment, offset) in MMM_MARKERS.places.items()
        if segment.startswith("right")
    }
    exact = placed(arm, q, places)
    moving = scipy.ndimage.gaussian_filter1d(random.normal(size=exact.shape), 5.0, axis=0)
    skin = 0.005 * moving / moving.std()  # [m]
    fit = fit_markers(arm, Markers(time, tuple(places), exact + skin), base="fixed", estimate=())
    true = fit.motion.q - q
    true -= true.mean(axis=0)  # a constant is not told by changes
    drawn = np.array([fit.noise.draw(random) for _ in range(20)])
    ratio = drawn.std(axis=(0, 1)) / true.std(axis=0)
    assert np.exp(np.mean(np.log(ratio))) == pytest.approx(1.0, abs=0.35)
    speeds = [np.gradient(each, time, axis=-2).std() for each in (drawn, true)]
    assert speeds[0] == pytest.approx(speeds[1], rel=0.4)
