"""The body that a recorded motion is a motion of, where its joints tell."""

from __future__ import annotations

from typing import get_args

from geodesic_ocp.model.anthropometry import Side, trunk
from geodesic_ocp.model.combine import combine
from geodesic_ocp.model.human import DEFAULT_HEIGHT, human_arm, human_upper_body
from geodesic_ocp.model.model import Model
from geodesic_ocp.trajectory.motion import Motion


def body_of(motion: Motion) -> tuple[Model, str]:
    """The person's arm, both arms, or upper body whose joints a motion has, and a note on it.

    Joints are known by their names, those of the Master Motor Map (RSx_joint, ...). The height is
    that of the subject.

    Raises:
        ValueError: the motion has the joints of no arm of a person.
    """
    height = motion.subject.height or DEFAULT_HEIGHT
    names = set(motion.joint_names)
    whole = human_upper_body(height)
    arms = [human_arm(side, height) for side in get_args(Side)]
    found = [arm for arm in arms if names.issuperset(arm.joint_names)]
    if names.issuperset(whole.joint_names):
        model = whole
    elif len(found) == 2:
        across = trunk().half_width * height
        model = combine(*found, placements=[(across, 0.0, 0.0), (-across, 0.0, 0.0)])
    elif found:
        model = found[0]
    else:
        raise ValueError(
            "the motion's joints are not those of a person's arm (RSx_joint, ...): give its model "
            f"after it; its joints are {', '.join(motion.joint_names)}"
        )
    known = "" if motion.subject.height else ", the height is not known"
    return model, f"assumed: {model.name} of {height:.2f} m{known}"
