"""Numbers as compact text."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

_STEPS = 32767  # on either side of the middle, in 16 bits
_UNKNOWN = -32768


def packed(values: ArrayLike) -> dict[str, Any]:
    """Columns of (..., n) numbers, each in 65535 steps between its extremes; NaN stays NaN.

    A motion within 2 m is stored to 0.02 mm.
    """
    array = np.asarray(values, dtype=float)
    rows = array.reshape(-1, array.shape[-1])
    known = np.isfinite(rows)
    # Columns without a known number are all zero.
    least = np.where(known, rows, np.inf).min(axis=0, initial=np.inf)
    most = np.where(known, rows, -np.inf).max(axis=0, initial=-np.inf)
    least, most = (np.where(np.isfinite(extreme), extreme, 0.0) for extreme in (least, most))
    middle, step = (least + most) / 2.0, (most - least) / (2.0 * _STEPS)
    scaled = np.rint((np.where(known, rows, middle) - middle) / np.where(step > 0.0, step, 1.0))
    codes = np.where(known, scaled, _UNKNOWN).astype("<i2")
    return {"middle": middle.tolist(), "step": step.tolist(), "data": encoded(codes)}


def encoded(array: NDArray[Any]) -> str:
    """The bytes of an array in base64."""
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
