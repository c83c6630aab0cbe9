"""Axes of joints, and the configuration in which a robot stands upright."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import geodesic_ocp as go
from geodesic_ocp.model.joint_axes import upright


def _joint(parent: str, child: str, kind: str, axis: str, limits: tuple[float, float]) -> str:
    return (
        f'<joint name="{child} joint" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/><axis xyz="{axis}"/>'
        f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="9" velocity="1"/></joint>'
        f'<link name="{child}"><inertial><mass value="1"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    )


@pytest.mark.parametrize(
    ("axis", "limits", "raised"),
    [
        ("0 0 1", (0.0, 0.35), 0.35),
        ("0 0 -1", (-0.2, 0.1), -0.2),
        ("1 0 0", (-0.2, 0.1), 0.0),  # it does not lift anything
    ],
)
def test_the_lift_of_a_body_is_raised(
    axis: str, limits: tuple[float, float], raised: float
) -> None:
    parts = ['<link name="base"/>', _joint("base", "lift", "prismatic", axis, limits)]
    parts += [_joint("lift", side, "revolute", "0 0 1", (0.5, 2.0)) for side in ("right", "left")]
    text = f'<robot name="body">{"".join(parts)}</robot>'
    body = go.load_model(text, hand=["right", "left"])
    assert_array_equal(upright(body), [raised, 0.5, 0.5])
    unlimited = {"lift joint": -np.inf}, {"lift joint": np.inf}
    assert_array_equal(upright(body.with_limits(*unlimited)), [0.0, 0.5, 0.5])
    arm = go.load_model(text, hand="right")  # whose lift is one of its joints
    assert_array_equal(upright(arm), [0.0, 0.5])
