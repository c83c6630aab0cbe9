"""Equal motions are found as by comparing every motion with every other."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from geodesic_ocp.studies.result_files import equal_motions

STEP = 0.4e-6  # [rad]; two steps are within the tolerance of 1e-6 rad, three are not
STEPS = st.lists(st.integers(-4, 4), min_size=3, max_size=3)


def motion(side: str, samples: int, probes: Any) -> tuple[str, int, list[float]]:
    return side, samples, np.asarray(probes).tolist()


@given(
    offset=st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3),
    steps=st.lists(STEPS, max_size=30),
)
def test_the_first_equal_motion_is_found(offset: list[float], steps: list[list[int]]) -> None:
    kept, expected = dict[int, list[int]](), {}
    for number, own in enumerate(steps):
        equal = [
            first
            for first, other in kept.items()
            if max(abs(a - b) for a, b in zip(own, other, strict=True)) <= 2
        ]
        if equal:
            expected[number] = equal[0]
        else:
            kept[number] = own
    q = [np.add(offset, STEP * np.array(own)) for own in steps]
    assert equal_motions([motion("right", 200, each) for each in q]) == expected


def test_side_and_numbers_of_samples_and_joints_tell_motions_apart() -> None:
    motions = [
        motion("right", 200, np.zeros(56)),
        motion("left", 200, np.zeros(56)),
        motion("right", 201, np.zeros(56)),
        None,
        motion("right", 200, np.zeros(72)),
        motion("right", 200, np.full(56, 1e-7)),
    ]
    assert equal_motions(motions) == {5: 0}
