"""The pane of the person of a retargeting."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.model.combine import combine
from geodesic_ocp.model.look import Indices
from geodesic_ocp.model.model import Model
from geodesic_ocp.retargeting.arm_result import RetargetedArm
from geodesic_ocp.scenes.actor import model_actor
from geodesic_ocp.scenes.motions.model_scene import hand_frames, hand_trails, rest_of
from geodesic_ocp.scenes.retargeted.mounting import shoulder
from geodesic_ocp.scenes.retargeted.robot_pane import LONGER
from geodesic_ocp.scenes.scene import Scene
from geodesic_ocp.synergies.analyse import Analysis


def person_pane(arms: Sequence[RetargetedArm], time: Array, shown: Indices) -> Scene:
    """The person in motion, as recorded, with the path of the hand.

    If the times last longer than the recording, the note says so.

    Args:
        arms: of a retargeting, of one arm of the person or of both.
        time: at which the samples are shown (k,) [s].
        shown: indices of the samples (k,).
    """
    analyses = observed(arms)
    model, q = _whole(arms, analyses)
    names = " and ".join(dict.fromkeys(each.model.name for each in analyses))
    return Scene(
        "person",
        time,
        (model_actor(model, q[shown], role="observed"), *rest_of(model)),
        hand_trails(model, q[shown], "observed"),
        frames=hand_frames(model, q[shown]),
        note=names + _slowed(arms, time),
    )


def observed(arms: Sequence[RetargetedArm]) -> tuple[Analysis, ...]:
    """The analyses of the person's motion, each once."""
    return tuple({id(arm.analysis): arm.analysis for arm in arms}.values())


def _slowed(arms: Sequence[RetargetedArm], time: Array) -> str:
    recorded = arms[0].analysis.motion.time
    shown, own = float(time[-1] - time[0]), float(recorded[-1] - recorded[0])
    if shown > LONGER * own:
        return "; slowed to the robot's time"
    if any(float(arm.motion.time[-1] - arm.motion.time[0]) > LONGER * shown for arm in arms):
        return "; as fast as recorded"
    return ""


def _whole(arms: Sequence[RetargetedArm], analyses: Sequence[Analysis]) -> tuple[Model, Array]:
    """One arm, or both as one model, and its configurations (k, n)."""
    if len(analyses) == 1:
        return analyses[0].model, analyses[0].motion.q
    placed = {id(arm.analysis): shoulder(arm, len(analyses)) for arm in arms}
    models = [each.model for each in analyses]
    both = combine(*models, placements=[placed[id(each)] for each in analyses])
    return both, np.hstack([each.motion.q for each in analyses])
