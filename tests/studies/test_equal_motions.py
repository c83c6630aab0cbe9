"""Equal motions are found as by comparing every motion with every other."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from geodesic_ocp.studies.result_files import MotionsByProbes

STEP = 0.4e-6  # [rad]; two steps are within the tolerance of 1e-6 rad, three are not
STEPS = st.lists(st.integers(-4, 4), min_size=3, max_size=3)


@given(
    offset=st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3),
    steps=st.lists(STEPS, max_size=30),
)
def test_the_first_equal_motion_is_found(offset: list[float], steps: list[list[int]]) -> None:
    motions, kept = MotionsByProbes(), dict[str, list[int]]()
    for number, own in enumerate(steps):
        equal = [
            name
            for name, other in kept.items()
            if max(abs(a - b) for a, b in zip(own, other, strict=True)) <= 2
        ]
        probes = [a + STEP * b for a, b in zip(offset, own, strict=True)]
        assert motions.add(str(number), "right", 200, probes) == (equal[0] if equal else "")
        if not equal:
            kept[str(number)] = own
    assert repr(motions) == f"MotionsByProbes({len(kept)} motions)"


def test_side_and_numbers_of_samples_and_joints_tell_motions_apart() -> None:
    motions = MotionsByProbes()
    for name, side, samples, probes in (
        ("a", "right", 200, np.zeros(56)),
        ("b", "left", 200, np.zeros(56)),
        ("c", "right", 201, np.zeros(56)),
        ("d", "right", 200, np.zeros(72)),
    ):
        assert not motions.add(name, side, samples, probes)
    assert motions.add("e", "right", 200, np.full(56, 1e-7)) == "a"


def test_few_motions_are_compared_with_each_other() -> None:
    """Movements forth and back about one posture, of the same mean, are still told apart."""
    motions, phase = MotionsByProbes(), np.linspace(0.0, 2.0 * np.pi, 56, endpoint=False)
    for number in range(500):
        amplitude = 0.5 + 0.001 * number
        assert not motions.add(str(number), "right", 200, amplitude * np.sin(phase))
    assert max(map(len, motions._known.values())) == 1
