"""What a check of a trajectory found."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.table import Table

_SHOWN = 140  # characters of the first violation


@dataclass(frozen=True, eq=False, repr=False)
class TrajectoryCheck:
    """What a check of a trajectory found.

    Attributes:
        violations: one sentence for each joint and condition that does not hold, with the worst
            time, value and limit; none if all hold.
        usage: largest fraction of each limit that a joint takes (n,), by "position" (0 in the
            middle of the range, 1 at its ends), "velocity", "acceleration", "jerk" and "torque";
            0 where there is no limit.
        largest: largest magnitudes (n,), by "velocity", "acceleration", "jerk" and "torque", of
            samples and of means between samples [rad or m, per second..., N m or N].
        consistency: largest contradiction between samples over its bound (n,), by "velocity"
            (against positions) and "acceleration" (against velocities).
        joint_names: of the n joints.
        clearance: least of the distances to be kept [m]; None: not checked.
    """

    violations: tuple[str, ...]
    usage: Mapping[str, Array]
    largest: Mapping[str, Array]
    consistency: Mapping[str, Array]
    joint_names: tuple[str, ...]
    clearance: float | None = None

    @property
    def passed(self) -> bool:
        """Whether all conditions hold."""
        return not self.violations

    def __repr__(self) -> str:
        shown = "passed"
        if not self.passed:
            first = textwrap.shorten(self.violations[0], _SHOWN)
            others = f", and {len(self.violations) - 1} more" if len(self.violations) > 1 else ""
            shown = f"{first}{others}"
        peaks = ", ".join(f"{name} {np.max(use):.0%}" for name, use in self.usage.items())
        return f"TrajectoryCheck({shown}; of the limits: {peaks})"

    def __str__(self) -> str:
        return "\n".join([str(self.table()), "", *(self.violations or ("all conditions hold",))])

    def table(self) -> Table:
        """Largest magnitudes and fractions of limits, by joint."""
        header = ["joint", "position [limit]"]
        columns: list[list[float]] = [self.usage["position"].tolist()]
        for name, unit in (
            ("velocity", "rad/s, m/s"),
            ("acceleration", "rad/s^2, m/s^2"),
            ("jerk", "rad/s^3, m/s^3"),
            ("torque", "N m, N"),
        ):
            header += [f"{name} [{unit}]", f"{name} [limit]"]
            columns += [self.largest[name].tolist(), self.usage[name].tolist()]
        return Table(tuple(header), tuple(zip(self.joint_names, *columns, strict=True)))

    def _repr_markdown_(self) -> str:
        found = self.violations or ("all conditions hold",)
        return self.table().markdown() + "\n" + "\n".join(f"- {each}" for each in found) + "\n"
