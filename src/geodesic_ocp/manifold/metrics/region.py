"""Regions of configurations, given by functions that are positive inside."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.model import Model


@dataclass(frozen=True, eq=False)
class Region:
    """The set of q (n,) with all h_i(q) > 0.

    Attributes:
        values: q -> h (m, 1).
        gradients: q -> dh / dq (m, n).
        labels: description of each h_i, for messages.
        joints: index of the joint that h_i limits; empty for functions of a user.
    """

    values: ca.Function
    gradients: ca.Function
    labels: tuple[str, ...]
    joints: tuple[int, ...] = ()


def joint_limit_region(model: Model) -> Region:
    """The region within the finite joint limits of a model: q_j - lower_j and upper_j - q_j.

    The limits of continuous joints are ignored if they are at least one revolution apart.

    Raises:
        ValueError: the model has no finite limit.
    """
    q = ca.SX.sym("q", model.dof)
    rows, labels, joints = [], [], []
    continuous = np.array([name in model.continuous for name in model.joint_names])
    unlimited = continuous & (model.upper - model.lower >= 2.0 * np.pi)
    for side, limits, sign in (("lower", model.lower, 1.0), ("upper", model.upper, -1.0)):
        for joint in np.flatnonzero(np.isfinite(limits) & ~unlimited).tolist():
            rows.append(sign * (q[joint] - limits[joint]))
            name = model.joint_names[joint]
            labels.append(f"the distance of {name} to its {side} limit {limits[joint]:.6g}")
            joints.append(joint)
    if not rows:
        raise ValueError(f"no joint of {model.name!r} has a finite limit: give functions")
    return _region(ca.SX(ca.vertcat(*rows)), q, labels, joints)


def region_of_functions(functions: Callable[[ca.SX], Any], dim: int) -> Region:
    """The region where all of a user's functions, q (n, 1) -> column or list, are positive.

    Raises:
        ValueError: a function is not a CasADi scalar, or does not depend on q alone.
    """
    if not callable(functions):
        raise ValueError(f"functions must be callable with q, got {functions!r}")
    q = ca.SX.sym("q", dim)
    given = functions(q)
    if isinstance(given, ca.SX) and given.shape[1] == 1 and given.shape[0] > 0:
        given = ca.vertsplit(given)
    if not isinstance(given, (list, tuple)) or not given:
        raise ValueError(
            f"functions(q) must be a column or a list of scalars, is {_describe(given)}"
        )
    for index, row in enumerate(given):
        if not isinstance(row, ca.SX) or row.shape != (1, 1):
            raise ValueError(f"functions[{index}] must be a CasADi scalar, is {_describe(row)}")
        if not ca.depends_on(row, q):
            raise ValueError(f"functions[{index}] does not depend on q, is {row}")
        if ca.symvar(ca.substitute(row, q, ca.DM.zeros(dim))):
            raise ValueError(f"functions[{index}] depends on other symbols than q, is {row}")
    labels = [f"functions[{index}]" for index in range(len(given))]
    return _region(ca.SX(ca.vertcat(*given)), q, labels, [])


def _describe(given: Any) -> str:
    return f"of shape {given.shape}" if isinstance(given, (ca.SX, ca.MX, ca.DM)) else repr(given)


def _region(h: ca.SX, q: ca.SX, labels: list[str], joints: list[int]) -> Region:
    gradients = ca.Function("dh", [q], [ca.densify(ca.jacobian(h, q))], ["q"], ["dh"])
    values = ca.Function("h", [q], [ca.densify(h)], ["q"], ["h"])
    return Region(values, gradients, tuple(labels), tuple(joints))


def middle_configuration(model: Model) -> Array:
    """The middle (n,) of the joint limits; of a joint without both limits, the value next to 0."""
    both = np.isfinite(model.lower) & np.isfinite(model.upper)
    configuration = np.clip(0.0, model.lower, model.upper)
    configuration[both] = (model.lower[both] + model.upper[both]) / 2.0
    return np.asarray(configuration)
