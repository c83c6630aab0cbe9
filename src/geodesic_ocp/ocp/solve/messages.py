"""What users are told of a solve that failed."""

from __future__ import annotations

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
    told = stats.status == STOPPED or len(stats.mesh_history) > 1 or "leave grid" in stats.status
    advice = "" if told else advice
    return (
        f"{type(solution.problem).__name__} was not solved: {stats.status}, after "
        f"{stats.iterations} iterations{violated}{advice}."
    )
