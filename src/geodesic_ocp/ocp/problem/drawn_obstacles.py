"""drawn_obstacles: the obstacles of a problem, if that is what its attribute holds."""

from __future__ import annotations

import warnings
from typing import Any

from geodesic_ocp.model.primitives import Ball, Capsule, HalfSpace, Obstacle


def drawn_obstacles(problem: Any) -> tuple[Obstacle, ...]:
    """The obstacles of a problem, which are drawn.

    A class may have an attribute `obstacles` that holds something else: then a warning says that
    nothing is drawn, and there are none.
    """
    given = problem.obstacles
    listed = isinstance(given, list | tuple)
    if listed and all(isinstance(each, Ball | Capsule | HalfSpace) for each in given):
        return tuple(given)
    warnings.warn(
        f"{type(problem).__name__}.obstacles are not drawn: they must be a list of go.Ball, "
        f"go.Capsule and go.HalfSpace, got {given!r}; an attribute that means something else needs "
        "another name",
        stacklevel=2,
    )
    return ()
