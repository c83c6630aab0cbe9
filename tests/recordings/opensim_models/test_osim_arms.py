"""Tables read by the model that they were computed with: the angles of the arm that made them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from recordings.opensim_models.osim_files import (
    ARM,
    TRUNK,
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

Array = NDArray[np.float64]
SIDES = st.sampled_from(["right", "left"])


def angles_of(side: str, count: int = 60, seed: int = 0) -> Array:
    """Smooth angles (k, 7) within the limits of the arm, the elbow flexed."""
    arm = go.human_arm(side)  # type: ignore[arg-type]
    rng = np.random.default_rng(seed)
    waves = np.sin(np.linspace(0.0, 3.0, count)[:, None] * rng.uniform(1, 3, 7) + rng.uniform(0, 6))
    angles = 0.5 * (arm.lower + arm.upper) + 0.35 * (arm.upper - arm.lower) * waves
    angles[:, 3] = np.clip(angles[:, 3], 0.7, None)
    return np.asarray(angles)


def columns_of(side: str, angles: Array, hanging: float = 0.0, supinated: float = 0.0) -> Array:
    """The coordinates of `arm_links` with these angles."""
    return angles - np.array([0.0, 0.0, hanging, 0.0, supinated, 0.0, 0.0])


def names_of(*sides: str) -> list[str]:
    return [f"{name}_{side[0]}" for side in sides for name in ARM]


def write_model(folder: Path, links: list[Link], version: int = 4, extra: str = "") -> Path:
    file = folder / "model.osim"
    file.write_text(osim_text(links, version, extra))
    return file


@pytest.mark.slow
@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize("degrees", [False, True])
def test_the_angles_of_both_arms_come_back(version: int, degrees: bool, tmp_path: Path) -> None:
    links = [trunk_link(), *arm_links("right"), *arm_links("left")]
    model = write_model(tmp_path, links, version)
    angles = np.hstack([angles_of("right"), angles_of("left", seed=1)])
    trunk = np.tile([0.1, 0.2, 0.3, 1.0, 2.0, 3.0], (60, 1))
    table = np.hstack([angles, trunk])
    if degrees:
        table[:, -3:] = np.radians(table[:, -3:])  # metres are no degrees
    names = [*names_of("right", "left"), *TRUNK]
    file = write_table(tmp_path / "t.mot", names, table, degrees)
    joints = [*go.human_arm("right").joint_names, *go.human_arm("left").joint_names]
    motion = go.read_motion(file, joints, convention=str(model))
    assert motion.q == pytest.approx(angles, abs=1e-6)
    assert motion.trunk is not None
    thorax = motion.trunk.rotations[0]
    # lean about z (right), then tilt about x (forward), then turn about y (up)
    turns = [(0.1, (0, 0, 1)), (0.2, (1, 0, 0)), (0.3, (0, 1, 0))]
    rotation = np.eye(3)
    for angle, axis in turns:
        x, y, z = axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turned = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        rotation = rotation @ turned
    change = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])  # right, forward, up
    assert thorax == pytest.approx(change @ rotation @ change.T)
    place = np.array([1.0, 2.0, 3.0]) + rotation @ [0.01, 0.4, 0.0]
    assert motion.trunk.positions[0] == pytest.approx(change @ place)


@pytest.mark.slow
@given(side=SIDES, seed=st.integers(0, 1000), turned=st.integers(0, 1000))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_axes_of_bodies_and_the_zero_pose_do_not_matter(
    side: str, seed: int, turned: int, tmp_path: Path
) -> None:
    """Arms drawn with any axes, a zero pose with arms to the side, or with palms forward."""
    rng = np.random.default_rng(turned)
    bodies = [f"{name}_{side[0]}" for name in ("humerus", "ulna", "radius", "hand")]
    axes = {body: tuple(rng.uniform(-1.4, 1.4, 3)) for body in bodies}
    sign = 1.0 if side == "right" else -1.0
    hanging, supinated = -sign * np.pi / 2, -sign * np.pi / 2
    links = [
        trunk_link(),
        *arm_links(side, hanging=hanging, supinated=supinated, body_axes=axes),
    ]
    model = write_model(tmp_path, links)
    angles = angles_of(side, seed=seed)
    columns = columns_of(side, angles, hanging, supinated)
    file = write_table(tmp_path / "t.mot", names_of(side), columns)
    motion = go.read_motion(file, convention=model)
    assert motion.joint_names == go.human_arm(side).joint_names  # type: ignore[arg-type]
    assert motion.q == pytest.approx(angles, abs=1e-6)
    assert motion.trunk is None


@pytest.mark.parametrize("side", ["right", "left"])
def test_standing_with_hanging_arms_is_zero(side: str, tmp_path: Path) -> None:
    """Also, within 12 degrees, where the elbow is 1 cm forward and 2 cm beside the line."""
    links = arm_links(side)
    model = write_model(tmp_path, [trunk_link(), *links])
    file = write_table(tmp_path / "t.mot", names_of(side), np.zeros((2, 7)))
    assert go.read_motion(file, convention=model).q == pytest.approx(np.zeros((2, 7)), abs=1e-6)
    links[1] = replace(links[1], at=(0.01, -0.29, 0.02))
    model = write_model(tmp_path, [trunk_link(), *links])
    assert np.abs(go.read_motion(file, convention=model).q).max() < np.radians(12.0)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_place_of_a_hinge_along_its_axis_does_not_matter(side: str, tmp_path: Path) -> None:
    """It does not change how the bodies move."""
    links = arm_links(side)
    links[1] = replace(links[1], at=(0.0, -0.29, 0.05), at_child=(0.0, 0.0, 0.05))
    model = write_model(tmp_path, [trunk_link(), *links])
    angles = angles_of(side)
    file = write_table(tmp_path / "t.mot", names_of(side), angles)
    assert go.read_motion(file, convention=model).q == pytest.approx(angles, abs=1e-6)


@pytest.mark.parametrize("suffix", [True, False])
@pytest.mark.parametrize("side", ["right", "left"])
def test_the_side_of_bodies_without_a_side_is_that_of_the_shoulder(
    side: str, suffix: bool, tmp_path: Path
) -> None:
    model = write_model(tmp_path, [trunk_link(), *arm_links(side, suffix=suffix)])
    file = write_table(tmp_path / "t.mot", names_of(side), angles_of(side))
    motion = go.read_motion(file, convention=model)
    assert motion.joint_names == go.human_arm(side).joint_names  # type: ignore[arg-type]


def test_the_pose_with_palms_inwards_can_be_stated(tmp_path: Path) -> None:
    """Without a wrist that flexes the model does not show it."""
    links = arm_links("right", supinated=-0.5)
    links[3] = Link("radius_r", "hand_r", "WeldJoint", at=(0.0, -0.23, 0.0))
    model = write_model(tmp_path, [trunk_link(), *links])
    angles = angles_of("right")
    columns = columns_of("right", angles, supinated=-0.5)[:, :5]
    file = write_table(tmp_path / "t.mot", names_of("right")[:5], columns)
    with pytest.raises(go.RecordingError, match=r"where the right palm is, .* neutral="):
        go.read_motion(file, convention=model)
    stated = OsimConvention(model, neutral={"Ez_r": np.degrees(0.5)})
    motion = go.read_motion(file, convention=stated)
    assert motion.q[:, :5] == pytest.approx(angles[:, :5], abs=1e-6)
    assert motion.select(["RWx_joint", "RWy_joint"]).q == pytest.approx(0.0, abs=1e-6)


def test_a_palm_far_from_the_range_of_the_forearm_is_asked_about(tmp_path: Path) -> None:
    """As where the coordinate named flexion is one of deviation."""
    links = arm_links("right")
    links[2] = replace(links[2], ranges=((0.9, 1.6),))
    model = write_model(tmp_path, [trunk_link(), *links])
    file = write_table(tmp_path / "t.mot", names_of("right"), angles_of("right"))
    with pytest.raises(go.RecordingError, match=r"where 'Ez_r' is -?0 degrees, far outside its"):
        go.read_motion(file, convention=model)


def test_a_rotation_with_the_name_of_a_translation_is_asked_about(tmp_path: Path) -> None:
    text = osim_text([trunk_link(), *arm_links("right")]).replace("Sz_r", "shoulder_tz")
    (tmp_path / "m.osim").write_text(text)
    names = [name.replace("Sz_r", "shoulder_tz") for name in names_of("right")]
    file = write_table(tmp_path / "t.mot", names, angles_of("right"), degrees=True)
    with pytest.raises(go.RecordingError, match="shoulder_tz would be read in metres by its name"):
        go.read_motion(file, convention=tmp_path / "m.osim")


def test_bodies_can_be_named_in_a_json_file(tmp_path: Path) -> None:
    text = osim_text([trunk_link(), *arm_links("right")])
    for old, new in (("humerus_r", "bone1"), ("radius_r", "bone2"), ("thorax", "chest")):
        text = text.replace(old, new)
    (tmp_path / "m.osim").write_text(text)
    angles = angles_of("right")
    file = write_table(tmp_path / "t.mot", names_of("right"), angles)
    with pytest.raises(
        go.RecordingError, match=r"thorax nor as upper arm .* bodies of the model are chest, bone1"
    ):
        go.read_motion(file, convention=tmp_path / "m.osim")
    record: dict[str, Any] = {
        "model": "m.osim",
        "bodies": {"thorax": "chest", "right upper arm": "bone1", "right forearm": "bone2"},
    }
    mine = tmp_path / "mine.json"
    mine.write_text(json.dumps(record))
    assert go.read_motion(file, convention=mine).q == pytest.approx(angles, abs=1e-6)
    for change, message in (
        ({"bodies": {"thorax": "nobody"}}, "there is no body 'nobody' for the thorax; bodies of"),
        ({"bodies": {"chest": "chest"}}, "there is no segment 'chest'"),
        (
            {"body": {}},
            "has the keys model, bodies, neutral, of which 'model' is required, not 'body'",
        ),
        ({"neutral": {"x": 1.0}}, "there is no coordinate 'x' for the neutral pose"),
        ({"neutral": {"Ez_r": "x"}}, "neutral Ez_r must be a finite number"),
        ({"model": 1}, "model must be a file"),
    ):
        mine.write_text(json.dumps(record | change))
        with pytest.raises(go.RecordingError, match=message):
            go.read_motion(file, convention=mine)


def test_a_carrying_angle_of_its_own_is_no_flexion(tmp_path: Path) -> None:
    """An elbow with a second coordinate across the arm, of small range, at 5 degrees."""
    links = arm_links("right")
    elbow = links[1]
    names = ("carrying_r", *elbow.coordinates)
    axes = (*elbow.axes, Axis("rotation", (1.0, 0.0, 0.0), names[0]))
    ranges = ((0.0, 0.3), *elbow.ranges)
    links[1] = replace(elbow, coordinates=names, axes=axes, ranges=ranges, defaults=(0.0, 0.0))
    model = write_model(tmp_path, [trunk_link(), *links])
    angles = angles_of("right")
    carrying = np.full((60, 1), np.radians(5.0))
    file = write_table(
        tmp_path / "t.mot", [*names_of("right"), names[0]], np.hstack([angles, carrying])
    )
    motion = go.read_motion(file, convention=model)
    assert motion.q[:, 3] == pytest.approx(angles[:, 3], abs=np.radians(1.0))
    assert np.abs(motion.q - angles).max() < np.radians(15.0)


def test_a_coupled_scapula_turns_the_arm(tmp_path: Path) -> None:
    """The scapula tilts by a third of the first angle of the shoulder, by a coupler."""
    links = arm_links("right")
    tilt = (Axis("rotation", (0.0, 0.0, 1.0), "tilt_scapula"),)
    scapula = Link("thorax", "scapula", "CustomJoint", ("tilt_scapula",), axes=tilt)
    links[0] = replace(links[0], parent="scapula")
    extra = coupler("tilt_scapula", "Sx_r", 1.0 / 3.0)
    model = write_model(tmp_path, [trunk_link(), scapula, *links], extra=extra)
    angles = angles_of("right")
    file = write_table(tmp_path / "t.mot", names_of("right"), angles)
    motion = go.read_motion(file, convention=model)
    assert motion.q[:, 0] == pytest.approx(4.0 / 3.0 * angles[:, 0], abs=1e-6)
    assert motion.q[:, 1:] == pytest.approx(angles[:, 1:], abs=1e-6)


def test_columns_that_are_missing_are_told(tmp_path: Path) -> None:
    model = write_model(tmp_path, [trunk_link(), *arm_links("right")])
    names, angles = names_of("right"), angles_of("right")
    file = write_table(tmp_path / "t.mot", names[:5], angles[:, :5])
    motion = go.read_motion(file, convention=model)
    assert motion.joint_names == go.human_arm("right").joint_names[:5]
    assert motion.q == pytest.approx(angles[:, :5], abs=1e-6)
    with pytest.raises(go.RecordingError, match="right hand: there is no column Wx_r, Wy_flex_r"):
        go.read_motion(file, ["RWx_joint"], convention=model)
    file = write_table(tmp_path / "t.mot", names[1:], angles[:, 1:])
    with pytest.warns(RuntimeWarning, match=r"no column Sx_r; the default values of model\.osim"):
        motion = go.read_motion(file, convention=model)
    assert motion.q[:, 0] == pytest.approx(0.0, abs=1e-6)
    assert motion.q[:, 1:] == pytest.approx(angles[:, 1:], abs=1e-6)
    file = write_table(tmp_path / "t.mot", [*names, "box"], np.column_stack([angles, angles[:, 0]]))
    with pytest.warns(RuntimeWarning, match="columns box are no coordinates of model"):
        go.read_motion(file, convention=model)
    file = write_table(tmp_path / "t.mot", ["box"], angles[:, :1])
    with pytest.raises(go.RecordingError, match=r"columns box are no coordinates of .*; those are"):
        go.read_motion(file, convention=model)


def test_the_trunk_is_known_where_all_its_columns_are(tmp_path: Path) -> None:
    model = write_model(tmp_path, [trunk_link(), *arm_links("right")])
    angles = angles_of("right")
    table = np.hstack([angles, np.full((60, 3), 0.1)])
    file = write_table(tmp_path / "t.mot", [*names_of("right"), *TRUNK[:3]], table)
    with pytest.warns(RuntimeWarning, match="no column move_x, move_y, move_z; the default values"):
        motion = go.read_motion(file, convention=model)
    assert motion.trunk is None
    assert motion.q == pytest.approx(angles, abs=1e-6)


def test_locked_coordinates_need_no_columns(tmp_path: Path) -> None:
    links = arm_links("right")
    links[3] = replace(links[3], locked=True, defaults=(0.1, 0.2))
    model = write_model(tmp_path, [replace(trunk_link(), locked=True), *links])
    angles = angles_of("right")
    file = write_table(tmp_path / "t.mot", names_of("right")[:5], angles[:, :5])
    motion = go.read_motion(file, convention=model)
    assert motion.q[:, :5] == pytest.approx(angles[:, :5], abs=1e-6)
    assert motion.q[:, 5:] == pytest.approx(np.tile([0.1, 0.2], (60, 1)), abs=1e-6)
    assert motion.trunk is None


@pytest.mark.filterwarnings("ignore:.*its header says")
def test_the_box_lift_asks_for_its_model(shared: Path) -> None:
    file = shared / "data" / "opensim" / "inverse_kin.mot"
    with pytest.raises(go.RecordingError, match=r"the file of the model \(\.osim\)"):
        go.read_motion(file, ["RSx_joint"])
