"""What users are told of a solve that failed, or that met its conditions at the nodes alone."""

from __future__ import annotations

import warnings

from geodesic_ocp.ipopt import STOPPED
from geodesic_ocp.ocp.nlp.violations import NEGLIGIBLE
from geodesic_ocp.ocp.solve.solution import Solution

_LISTED = 3  # violations in a message


def describe_failure(solution: Solution) -> str:
    """Why there is no solution, which conditions are violated, and what to try."""
    stats = solution.stats
    large = [each for each in solution.violations if each.amount > NEGLIGIBLE][:_LISTED]
    violated = f": {'; '.join(map(str, large))}" if large else ""
    advice = (
        ". Are its conditions compatible? If so, try another guess (guess(s) or solve(..., "
        "guess=path)) or a finer grid"
    )
    advice = "" if stats.status == STOPPED or len(stats.mesh_history) > 1 else advice
    return (
        f"{type(solution.problem).__name__} was not solved: {stats.status}, after "
        f"{stats.iterations} iterations{violated}{advice}."
    )


def warn_of_violations(solution: Solution, allowed: float, *, given_grid: bool) -> None:
    """Warn, on behalf of the caller's caller, if a solution violates a condition by more.

    Args:
        solution: whose conditions hold at the nodes.
        allowed: largest violation without a warning.
        given_grid: whether the grid was the user's choice.
    """
    if not solution.stats.success or solution.stats.max_path_violation <= allowed:
        return
    advice = "leave grid out, or set tolerance" if given_grid else "give a finer grid"
    warnings.warn(
        f"{type(solution.problem).__name__} meets its conditions at the nodes, but between them "
        f"{solution.violations[0]}; {advice}",
        RuntimeWarning,
        stacklevel=3,
    )
