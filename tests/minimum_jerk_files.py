"""Files of short synthetic recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import geodesic_ocp as go


def write_stroke(
    file: Path, seed: int, notes: Sequence[str] = (), side: str = "right", duration: float = 0.5
) -> Path:
    """One stroke of minimum jerk between postures that the seed chooses, at 100 Hz."""
    arm = go.human_arm("right" if side == "right" else "left")
    random = np.random.default_rng(seed)
    middle, half = (arm.lower + arm.upper) / 2.0, (arm.upper - arm.lower) / 2.0
    start, stop = middle + 0.4 * half * random.uniform(-1.0, 1.0, (2, arm.dof))
    time = np.arange(round(100 * duration)) / 100.0
    s = time / time[-1]
    q = start + np.outer(10 * s**3 - 15 * s**4 + 6 * s**5, stop - start)
    lines = ["# unit: rad", *notes, ",".join(["time", *arm.joint_names])]
    lines += [",".join(f"{value:.9f}" for value in row) for row in np.column_stack([time, q])]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join(lines) + "\n")
    return file
