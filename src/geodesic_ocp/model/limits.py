"""Limits of joints that are given anew, all or some by name."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array


def changed(
    name: str,
    given: ArrayLike | Mapping[str, float] | None,
    old: Array,
    joint_names: Sequence[str],
) -> Array:
    """The limits (n,) as given, or the old ones where none is.

    Raises:
        ValueError: a joint that is not there, or not n numbers; names the argument.
    """
    if given is None:
        return old
    if isinstance(given, Mapping):
        for joint in given:
            if joint not in joint_names:
                known = ", ".join(joint_names)
                raise ValueError(f"{name}: {joint!r} is not one of the joints {known}")
        given = [given.get(joint, value) for joint, value in zip(joint_names, old, strict=True)]
    try:
        new = np.array(given, dtype=float)
    except (TypeError, ValueError):
        new = np.zeros(0)
    if new.shape != old.shape or np.any(np.isnan(new)):
        raise ValueError(f"{name} must be {old.size} numbers, got {given!r}")
    return new
