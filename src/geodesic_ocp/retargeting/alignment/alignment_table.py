"""An alignment in words."""

from __future__ import annotations

import numpy as np

from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.alignment.arm_alignment import Alignment
from geodesic_ocp.retargeting.alignment.axis_names import axis_name
from geodesic_ocp.table import Table


def alignment_table(robot: Model, aligned: Alignment) -> Table:
    """Shoulder, axes, length, side, elbow and wrist of an alignment, in words."""
    base, hand = np.asarray(aligned.base), np.asarray(aligned.hand)
    across = {"right": "back of the hand", "left": "palm"}.get(aligned.side or "", "hand's right")
    position = ", ".join(f"{entry:.3f}" for entry in np.asarray(aligned.shoulder) + 0.0)
    rows = (
        ("shoulder", f"at ({position}) m in the base frame"),
        ("person's right", axis_name(base[:, 0], "the base")),
        ("person's forward", axis_name(base[:, 1], "the base")),
        ("person's up", axis_name(base[:, 2], "the base")),
        ("fingers", axis_name(hand[2], robot.hand)),
        (across, axis_name(hand[0], robot.hand)),
        ("length", f"{aligned.length:.3f} m from the shoulder to the hand"),
        ("side", aligned.side or "either"),
        ("elbow", aligned.elbow or "not known"),
        ("wrist", aligned.wrist or "not known"),
    )
    return Table(("alignment", robot.name), rows)
