"""Weights of the terms that the program minimizes."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ObjectiveWeights:
    """Weights and units of the objective's terms.

    The objective is action / `action` + `stretch` times the time added / `duration`, plus the means
    over the waypoints of `posture` times the mean squared distance of the joints from the middle of
    their ranges, in half ranges, and of `likeness` times the squared distance of the elbow's offset
    from the person's, in lengths of the arm.

    Attributes:
        action: unit of the action [J s].
        duration: of the recording's part [s].
        stretch, posture, likeness: weights.
        detour: weight in the graph alone, of the squared distance of the hand from the person's
            halfway through the movements, mean over these.
    """

    action: float
    duration: float
    stretch: float
    posture: float
    likeness: float
    detour: float
