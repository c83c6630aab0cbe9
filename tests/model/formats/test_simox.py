"""Simox XML: units, scaling and errors."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go


def simox(node: str, kind: str = "KIT") -> str:
    """A robot with a fixed root and one node."""
    return (
        f'<Robot Type="{kind}" RootNode="root">'
        f'<RobotNode name="root"><Child name="arm"/></RobotNode>'
        f'<RobotNode name="arm">{node}</RobotNode></Robot>'
    )


HINGE = (
    '<Joint type="revolute"><Axis x="0" y="0" z="1"/><Limits lo="-90" hi="90" unit="degree"/>'
    "</Joint>"
)
BODY = (
    '<Physics><Mass value="2" unit="kg"/><CoM x="1" y="2" z="3" unit="m"/><InertiaMatrix>'
    '<row1 c1="1" c2="0" c3="0"/><row2 c1="0" c2="2" c3="0"/><row3 c1="0" c2="0" c3="1.5"/>'
    "</InertiaMatrix></Physics>"
)


def test_units_of_simox_files() -> None:
    place = '<Transform><Translation x="1" y="2" z="3" units="m"/></Transform>'
    model = go.load_model(simox(place + HINGE + BODY), hand="arm")
    assert model.lower == pytest.approx([-np.pi / 2])
    assert model.mass == 2.0
    assert_allclose(model.mass_matrix([0.3]), [[1.5 + 2.0 * (1.0 + 4.0)]], rtol=1e-14)
    assert model.hand_pose([0.3])[1].tolist() == [1.0, 2.0, 3.0]
    small = go.load_model(simox((place + HINGE + BODY).lower()), hand="arm")
    assert np.array_equal(small.mass_matrix([0.3]), model.mass_matrix([0.3]))
    turn = '<Transform><rollpitchyaw roll="90" pitch="0" yaw="0" unitsAngle="degree"/></Transform>'
    rotation, _ = go.load_model(simox(turn + HINGE + BODY), hand="arm").hand_pose([0.0])
    assert_allclose(rotation[:, 1], [0.0, 0.0, 1.0], rtol=0, atol=1e-15)
    endless = HINGE.replace("type", 'limitless="true" type')
    assert go.load_model(simox(endless + BODY), hand="arm").continuous == ("arm",)


ROW = '<row{0} c1="{1}" c2="0" c3="0" c4="0"/>'


@pytest.mark.parametrize(
    ("node", "message"),
    [
        ("<Transform><Quaternion/></Transform>", "<transform> has a <quaternion>, which is not"),
        ("<Transform/><Transform/>", "<robotnode> has more than one <transform>"),
        ("<ChildFromRobot/>", "<robotnode> has a <childfromrobot>, which is not supported"),
        (HINGE.replace("</J", "<PropagateJointValue/></J"), "has a <propagatejointvalue>"),
        (HINGE.replace("type", 'offset="1" type'), "its joint has an offset"),
        (HINGE.replace('hi="90"', 'hi="-100"'), "its lower limit -1.5708 lies above"),
        (HINGE.replace('hi="90"', 'hi="nan"'), "<limits> has a number that is not finite"),
        (HINGE.replace("degree", "turns"), "<limits> is in 'turns', not in radian or"),
        (HINGE.replace('z="1"', 'z="0"'), "its joint has no axis"),
        (HINGE.replace("revolute", "ball"), "its joint is of type 'ball'"),
        (HINGE + BODY.replace('c2="0"', 'c2="5"', 1), "its <InertiaMatrix> is not symmetric"),
        (HINGE + BODY.replace(' value="2"', ""), "<mass> has no value"),
        (HINGE + BODY.replace('x="1"', 'location="VisualizationBBoxCenter" x="1"'), "only meshes"),
        (
            f"<Transform><Matrix4x4>{ROW.format(1, 1)}{ROW.format(2, 1)}</Matrix4x4></Transform>",
            "<matrix4x4> needs row1, row2, row3, has row1, row2",
        ),
        (
            "<Transform><Matrix4x4>"
            + "".join(ROW.format(row, 2) for row in (1, 2, 3))
            + "</Matrix4x4></Transform>",
            "<matrix4x4> is not a rotation",
        ),
        ("<Child name='nobody'/>", "node 'arm' has an unknown child 'nobody'"),
        ("<Child name='root'/>", "node 'root' is reached twice"),
    ],
)  # fmt: skip
def test_errors_in_a_simox_file_are_named(node: str, message: str) -> None:
    with pytest.raises(ValueError, match=message) as failure:
        go.load_model(simox(node), hand="arm")
    assert "the text: node 'arm'" in str(failure.value) or "node 'root'" in str(failure.value)


def test_only_mmm_models_are_scaled() -> None:
    with pytest.raises(ValueError, match="the text is of another type"):
        go.load_model(simox(HINGE + BODY), hand="arm", height=1.7)
    with pytest.raises(ValueError, match="at most 3 m and 1000 kg, got 175 m"):
        go.load_model(simox(HINGE + BODY, "MMM"), hand="arm", height=175)
    half = go.load_model(simox(HINGE + BODY, "MMM"), hand="arm", height=0.5, mass=0.1)
    whole = go.load_model(simox(HINGE + BODY), hand="arm")
    assert_allclose(half.mass_matrix([0.0]), 0.025 * whole.mass_matrix([0.0]), rtol=1e-14)
