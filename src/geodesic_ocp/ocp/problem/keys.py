"""Hashable keys of values, by which problems share NLPs."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import numpy as np


def _hashable(value: object) -> bool:
    try:
        hash(value)
    except TypeError:
        return False
    return True


@dataclass(frozen=True, eq=False)
class _Identity:
    """Key of a value without a hash: equal only for the identical object."""

    value: object

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Identity) and other.value is self.value

    def __hash__(self) -> int:
        return id(self.value)


def key_of(value: object) -> Hashable:
    """The value itself, the contents of arrays and lists, or the identity of unhashable objects."""
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return ("array", value.shape, value.dtype.str, value.tobytes())
    if isinstance(value, (list, tuple)):
        return (type(value).__name__, *map(key_of, value))
    return value if _hashable(value) else _Identity(value)
