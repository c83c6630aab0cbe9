"""Equal motions among many recordings, recognised by some of their angles."""

from __future__ import annotations

from typing import Any

import numpy as np

_SAME = 1e-6  # [rad]; formats print angles with at least this precision


class MotionsByProbes:
    """Recorded motions by their probes: the angles at some samples.

    Motions are equal if they are of the same side, have as many samples, and differ by at most
    1e-6 rad in every probe. Each is kept under its weighted mean angle, rounded to twice that, so
    that an equal one is found under the same or a neighbouring value, without a look at the others.
    """

    def __init__(self) -> None:
        self._known: dict[tuple[Any, ...], list[tuple[int, str, Any]]] = {}
        self._count = 0

    def __repr__(self) -> str:
        return f"MotionsByProbes({self._count} motions)"

    def add(self, name: str, side: str, samples: int, probes: Any) -> str:
        """Add a motion; returns the name of the first one equal to it, or "" if there is none.

        A motion that equals an earlier one is not added.
        """
        angles = np.asarray(probes, dtype=float)
        # Unequal weights: the mean of a movement forth and back is that of any other.
        mean = np.average(angles, weights=np.linspace(1.0, 2.0, angles.size))
        place = float(np.floor(mean / (2.0 * _SAME)))
        equal = [
            (number, other)
            for near in (place - 1.0, place, place + 1.0)
            for number, other, known in self._known.get((side, samples, angles.size, near), ())
            if np.all(np.abs(angles - known) <= _SAME)
        ]
        if equal:
            return min(equal)[1]
        own = self._known.setdefault((side, samples, angles.size, place), [])
        own.append((self._count, name, angles))
        self._count += 1
        return ""
