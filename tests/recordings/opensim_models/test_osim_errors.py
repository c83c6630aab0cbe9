"""Malformed OpenSim models are refused by a sentence with the file, the element and the reason."""

from __future__ import annotations

import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from damage import damaged
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from recordings.opensim_models.osim_files import (
    ARM,
    Axis,
    Link,
    arm_links,
    coupler,
    osim_text,
    trunk_link,
    write_table,
)

import geodesic_ocp as go
from geodesic_ocp.recordings.conventions.osim_convention import OsimConvention

LINKS = [trunk_link(), *arm_links("right")]
NAMES = [f"{name}_r" for name in ARM]
GOOD = {version: osim_text(LINKS, version) for version in (3, 4)}
SPLINE = "<SimmSpline><x>0 0</x><y>0 1</y></SimmSpline>"
LINEAR = "<LinearFunction><coefficients>1 0.0</coefficients></LinearFunction>"


@pytest.fixture
def table(tmp_path: Path) -> Path:
    return write_table(tmp_path / "t.mot", NAMES, np.full((3, 7), 0.1))


def refusal(table: Path, text: str) -> str:
    model = table.parent / "m.osim"
    model.write_text(text)
    with pytest.raises(go.RecordingError) as raised:
        go.read_motion(table, convention=model)
    message = str(raised.value)
    assert message.startswith(str(table))
    assert str(model) in message
    return message.removeprefix(f"{table}: ").removeprefix(f"{model}: ")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</Model>", "", "broken XML at line"),
        ("OpenSimDocument", "MMM", "expected <OpenSimDocument> with a <Model>, found <MMM>"),
        (
            "<OpenSimDocument",
            '<!DOCTYPE a [<!ENTITY b "c">]><OpenSimDocument',
            "line 2 defines the entity 'b'",
        ),
        ('encoding="UTF-8"', 'encoding="x"', "broken XML"),
        ("0 -9.80665 0", "0 0 -9.80665", "gravity is [0.0, 0.0, -9.80665], but y of the ground"),
        ("0 -9.80665 0", "0 -9.80665", "<gravity> of <Model> must be 3 numbers, is '0 -9.80665'"),
        ("<gravity>", "<length_units>mm</length_units><gravity>", "must be meters, is 'mm'"),
        (LINEAR, "<Sine/>", "joint 'humerus_r_joint': <TransformAxis name='rotation1'>: the func"),
        (LINEAR, SPLINE, "<SimmSpline> must have as many y as x, at least two, and x must incr"),
        (LINEAR, LINEAR.replace("1 0.0", "1"), "<coefficients> of <LinearFunction> must be 2 num"),
        (LINEAR, LINEAR.replace("1 0.0", "1 x"), "must be numbers, is '1 x'"),
        (LINEAR, LINEAR.replace("1 0.0", "1 nan"), "is not finite or too large: '1 nan'"),
        (LINEAR, "<MultiplierFunction/>", "<MultiplierFunction> must have a function"),
        (LINEAR + "</function>", "</function>", "must have one function"),
        ("<axis>0.0 0.0 1.0</axis>", "<axis>0 0 0</axis>", "has the axis 0 0 0"),
        ("CustomJoint", "EllipsoidJoint", "EllipsoidJoint is not read; known are CustomJoint, W"),
        ("CustomJoint", "PinJoint", "PinJoint must have 1 coordinates, has"),
        ("<reverse>false", "<reverse>true", "it is reversed (from child to parent)"),
        ("<parent_body>thorax", "<parent_body>hand_r", "no joints lead from the body 'ground'"),
        ("<parent_body>thorax<", "<parent_body><", "joint 'humerus_r_joint': <parent_body> is mis"),
        ('Coordinate name="Sz_r"', 'Coordinate name="Sx_r"', "there are two coordinates 'Sx_r'"),
        ('Coordinate name="Sz_r"', 'Coordinate name="S"', "there is no coordinate 'Sz_r'"),
        ("radius_r", "wrist_r", "no body is recognised as upper arm with a forearm; name the bod"),
        ('"radius_r"', '"r_humerus"', "humerus_r and r_humerus may be the right upper arm"),
        (
            "<location_in_parent>0.01 0.4 0.17",
            "<location_in_parent>0.17 0.4 -0.01",
            "the axes of the body 'thorax' are not x forward, y up, z right: the right shoulder",
        ),
        (
            "<location_in_parent>0.0 -0.29 0.0",
            "<location_in_parent>0 0 0",
            "the joint centres of the right upper arm are at one place",
        ),
    ],
)
def test_malformed_models(old: str, new: str, message: str, table: Path) -> None:
    assert old in GOOD[3]
    assert message in refusal(table, GOOD[3].replace(old, new))


def test_malformed_frames_of_opensim_4(table: Path) -> None:
    text = GOOD[4]
    assert "<socket_child_frame> of <CustomJoint> is missing" in refusal(
        table, text.replace("<socket_child_frame>hand_r_offset<", "<socket_child_frame><")
    )
    assert "its child frame is in the ground" in refusal(
        table, text.replace(">/bodyset/thorax<", ">/ground<")
    )
    looped = text.replace(">/bodyset/hand_r<", ">hand_r_offset<")
    assert "the frame 'hand_r_offset' is in no body" in refusal(table, looped)
    joints = "<JointSet>"
    assert "there are no joints" in refusal(
        table, text.replace(joints, "<x>").replace("</JointSet>", "</x>")
    )


def test_couplers_that_cannot_be_computed(table: Path) -> None:
    assert "the coordinate 'Sx_r' is coupled to itself" in refusal(
        table, osim_text(LINKS, extra=coupler("Sx_r", "Sx_r", 1.0))
    )
    assert "there is no coordinate 'nothing'" in refusal(
        table, osim_text(LINKS, extra=coupler("Sx_r", "nothing", 1.0))
    )
    wrong = coupler("Sx_r", "Sz_r", 1.0).replace("LinearFunction", "GCVSpline")
    assert "CoordinateCouplerConstraint '': the function GCVSpline is not read" in refusal(
        table, osim_text(LINKS, extra=wrong)
    )


def test_long_chains_of_couplers_end(table: Path) -> None:
    """Two thousand in a row, and pairs that would double the work at every step."""
    first, last = coupler("Sx_r", "c0", 1.0).split("<CoordinateCouplerConstraint>")[0], "</objects>"
    for count, twice in ((2000, 1), (60, 2)):
        inner = ""
        for i in range(count):
            one = coupler("Sx_r" if i == 0 else f"c{i}", " ".join([f"c{i + 1}"] * twice), 1.0)
            one = one.replace(">1.0 0<", f">{'0.5 ' * twice}0<")
            inner += one[len(first) : one.index(last)]
        text = osim_text(LINKS, extra=f"{first}{inner}{last}</ConstraintSet>")
        message = refusal(table, text)
        assert ("is coupled to itself" if twice == 1 else "no coordinate 'c60'") in message


def test_a_leg_that_cannot_be_read_does_not_matter(table: Path) -> None:
    axes = (Axis("rotation", (1.0, 0.0, 0.0), "knee", "<GCVSpline/>"),)
    leg = Link("thorax", "tibia_r", "CustomJoint", ("knee",), axes=axes)
    (table.parent / "m.osim").write_text(osim_text([*LINKS, leg]))
    assert len(go.read_motion(table, convention=table.parent / "m.osim")) == 3


def test_an_elbow_and_a_wrist_that_do_not_move(table: Path) -> None:
    stiff = replace(LINKS[2], kind="WeldJoint", coordinates=(), axes=(), ranges=())
    links = [*LINKS[:2], stiff, *LINKS[3:]]
    assert "no coordinate flexes the elbow between 'humerus_r' and 'radius_r'" in refusal(
        table, osim_text(links)
    )
    assert "the centre of the wrist is not known: 0 joints follow the body 'radius_r'" in refusal(
        table, osim_text(LINKS[:4])
    )


def test_an_arm_that_cannot_be_read_is_left_out_aloud(table: Path) -> None:
    left = arm_links("left")
    stiff = [*left[:1], replace(left[1], kind="WeldJoint", coordinates=(), axes=(), ranges=())]
    model = table.parent / "m.osim"
    model.write_text(osim_text([*LINKS, *stiff, *left[2:]]))
    with pytest.warns(RuntimeWarning, match="left arm is left out: no coordinate flexes the elb"):
        motion = go.read_motion(table, convention=model)
    assert motion.joint_names == go.human_arm("right").joint_names
    with (
        pytest.warns(RuntimeWarning, match="left out"),
        pytest.raises(go.RecordingError, match="left upper arm: no coordinate flexes the elbow"),
    ):
        go.read_motion(table, ["LSx_joint"], convention=model)


def test_missing_files_and_arguments(table: Path) -> None:
    missing = table.parent / "none.osim"
    with pytest.raises(go.RecordingError, match=r"none\.osim: cannot be read: No such file"):
        go.read_motion(table, convention=missing)
    with pytest.raises(ValueError, match=r"model must be a file \(\.osim\), got 3"):
        OsimConvention(3)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="bodies must be given by name"):
        OsimConvention("m.osim", ["thorax"])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="the body of the thorax must be a name"):
        OsimConvention("m.osim", {"thorax": ""})
    assert repr(OsimConvention("m.osim", {"thorax": "a"})) == "OsimConvention('m.osim', thorax: a)"


@pytest.mark.slow
@pytest.mark.parametrize("version", [3, 4])
@given(data=st.data())
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damaged_models_give_a_motion_or_a_sentence(
    version: int, data: st.DataObject, table: Path
) -> None:
    model = table.parent / "m.osim"
    model.write_bytes(data.draw(damaged(GOOD[version].encode())))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings(
            "ignore", message=".*(default values|no coordinates of|is left out).*"
        )
        try:
            motion = go.read_motion(table, convention=model)
        except go.RecordingError as failure:
            sentence = str(failure)
        else:
            sentence = f"{table}: is read"
            assert np.isfinite(motion.q).all()
    assert sentence.startswith(str(table))
