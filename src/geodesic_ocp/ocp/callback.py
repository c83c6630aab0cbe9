"""Ipopt's callback in every iteration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca

from geodesic_ocp.ipopt import Relay
from geodesic_ocp.ocp.nlp import NLP
from geodesic_ocp.trajectory.path import Path
from geodesic_ocp.trajectory.timed_motion import TimedMotion


@dataclass(frozen=True, eq=False)
class Iterate:
    """An iterate of Ipopt.

    Attributes:
        number: number of the iteration; the initial guess is number zero.
        objective: energy and running cost.
        violation: largest violation of any condition at the nodes, in the condition's unit.
        path: the path, or the motion.
    """

    number: int
    objective: float
    violation: float
    path: Path | TimedMotion


Callback: TypeAlias = Callable[[Iterate], object]


def relay_paths(nlp: NLP, callback: Callback) -> Relay:
    """Return what passes every iterate to a function, as a path."""

    def pass_on(number: int, values: dict[str, ca.DM]) -> object:
        path = nlp.path(values["x"].full()[:, 0])
        violation, _ = nlp.bounds.worst(path.nodes, values["g"].full()[:, 0])
        objective = float(values["f"]) * nlp.units.scale
        return callback(Iterate(number, objective, violation, path))

    bounds = nlp.bounds
    return Relay(bounds.lower.size, bounds.lower_g.size, nlp.transcription.size_p, pass_on)
