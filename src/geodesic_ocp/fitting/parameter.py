"""Parameters of a metric that are estimated from recordings."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from geodesic_ocp.arrays import as_number, settle
from geodesic_ocp.manifold.metric import Metric

_VALUES = (int, float, np.number, tuple, list, np.ndarray)


@dataclass(frozen=True)
class Parameter:
    """A parameter to be estimated: a field of a metric, or some entries of it.

    >>> go.fitting.Parameter("armature", 0.05, joints=("?S?_joint",)).name  # three joints
    'armature ?S?_joint'

    Attributes:
        field: field of the metric, such as "armature".
        start: initial value, positive; it also sets the scale.
        lower, upper: bounds.
        joints: for a field with one entry a joint, patterns of the names of the joints that share
            this value ("?E*" matches RExr_joint and LEx_joint); empty: all joints.
        name: for tables; by default the field and the joints.

    Raises:
        ValueError: the start is not positive, or not between the bounds.
    """

    field: str
    start: float
    lower: float = 0.0
    upper: float = np.inf
    joints: Sequence[str] = ()
    name: str = ""

    def __post_init__(self) -> None:
        if isinstance(self.joints, str):
            raise ValueError(f"joints must be a tuple of patterns, got {self.joints!r}")
        start = as_number(f"start of {self.field}", self.start)
        if not (start > 0.0 and self.lower <= start <= self.upper):
            raise ValueError(
                f"start of {self.field} must be positive and between its bounds {self.lower:g} and "
                f"{self.upper:g}, got {start:g}"
            )
        settle(self, joints=tuple(self.joints))
        default = " ".join((self.field, *self.joints))
        settle(self, name=self.name or default)


JOINT_INERTIA = Parameter("joint_inertia", 0.03, lower=1e-5, upper=100.0)


def as_parameters(parameters: Any) -> tuple[Parameter, ...]:
    """Return the argument as a tuple; ValueError if it is empty or two parameters share a name."""
    listed = (parameters,) if isinstance(parameters, Parameter) else tuple(parameters)
    if not listed or not all(isinstance(each, Parameter) for each in listed):
        raise ValueError(f"parameters must be one or more fitting.Parameter, got {parameters!r}")
    names = [each.name for each in listed]
    if len(set(names)) < len(names):
        raise ValueError(f"parameters must have different names, got {', '.join(names)}")
    return listed


def with_parameters(metric: Metric, parameters: Sequence[Parameter], values: Any) -> Metric:
    """Return the metric with these values, numbers or CasADi expressions, of its parameters.

    Raises:
        ValueError: the metric is not a dataclass, it has no such field, or no joint matches.
    """
    record: Any = metric
    if not hasattr(record, "__dataclass_fields__"):
        raise ValueError(f"{type(metric).__name__} must be a dataclass, its fields the parameters")
    known = [
        each.name
        for each in fields(record)
        if each.init and isinstance(getattr(record, each.name), _VALUES)
    ]
    changed: dict[str, Any] = {}
    taken: dict[str, set[int]] = defaultdict(set)
    for parameter, value in zip(parameters, values, strict=True):
        name = parameter.field
        if name not in known:
            raise ValueError(
                f"{type(metric).__name__} has no number {name!r}; it has "
                f"{', '.join(known) or 'none'}"
            )
        before = changed.get(name, getattr(metric, name))
        if isinstance(before, (tuple, list, np.ndarray)):
            chosen = _matching(parameter, metric.joint_names or (), len(before))
            if taken[name] & chosen:
                raise ValueError(
                    f"{parameter.name}: some of its joints have another parameter as well"
                )
            taken[name] |= chosen
            changed[name] = tuple(value if k in chosen else each for k, each in enumerate(before))
        elif parameter.joints:
            raise ValueError(f"{parameter.name}: {name} is one number; it takes no joints")
        elif name in changed:
            raise ValueError(f"{name} is a parameter twice")
        else:
            changed[name] = value
    result: Metric = replace(record, **changed)
    return result


def _matching(parameter: Parameter, joint_names: Sequence[str], count: int) -> set[int]:
    """Return indices of the joints that share a parameter's value; ValueError if a pattern has
    none.
    """
    if not parameter.joints:
        return set(range(count))
    chosen: set[int] = set()
    for pattern in parameter.joints:
        found = {k for k, name in enumerate(joint_names) if fnmatchcase(name, pattern)}
        if not found:
            raise ValueError(
                f"{parameter.name}: no joint matches {pattern!r}; there are "
                f"{', '.join(joint_names)}"
            )
        chosen |= found
    return chosen
