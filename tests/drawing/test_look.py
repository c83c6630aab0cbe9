"""People and kinematic chains as they are drawn."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
import scipy
import trimesh
from gadget import urdf
from known_models import free_rotor, planar_arm, random_tree

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.meshes import meshes
from geodesic_ocp.model.anthropometry import Side


def at_rest(model: go.Model, *links: str) -> Array:
    """All vertices of links (all by default) at q = 0 in the base frame."""
    points = []
    for mesh in meshes(model):
        if not links or mesh.link in links:
            rotation, position = model.frame_pose(mesh.link, np.zeros(model.dof))
            points.append(mesh.vertices @ rotation.T + position)
    return np.concatenate(points)


def apart(points: Array, others: Array) -> float:
    """Largest distance [m] of a point from the nearest of the others, either way."""
    ways = (points, others), (others, points)
    return float(max(scipy.spatial.cKDTree(a).query(b)[0].max() for a, b in ways))


@pytest.mark.parametrize("model", [go.human_arm("left"), go.human_upper_body()], ids=repr)
def test_every_part_of_a_person_is_closed_and_faces_outward(model: go.Model) -> None:
    for mesh in meshes(model):
        solid = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
        assert np.isfinite(mesh.vertices).all()
        assert solid.is_watertight
        assert solid.volume > 0.0


def test_a_person_is_symmetric() -> None:
    points = at_rest(go.human_upper_body())
    assert apart(points * [-1.0, 1.0, 1.0], points) < 1e-6


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_hand_ends_at_the_fingertips_with_the_thumb_in_front(side: Side) -> None:
    arm = go.human_arm(side, height=1.6)
    wrist = arm.frame_pose(f"{side} hand", np.zeros(7))[1]
    hand = at_rest(arm, f"{side} hand") - wrist
    assert hand[:, 2].min() == pytest.approx(-0.108 * 1.6, rel=1e-9)  # Winter
    assert hand[:, 1].max() > 1.2 * -hand[:, 1].min()
    inward = {"right": -1.0, "left": 1.0}[side]  # where the palm is, and fingers bend to
    assert inward * hand[np.argmin(hand[:, 2]), 0] > 0.0


@pytest.mark.slow
def test_a_person_grows_with_height_and_mass() -> None:
    small, tall = go.human_upper_body(1.5, 50.0), go.human_upper_body(1.8, 50.0 * 1.2**3)
    assert apart(at_rest(tall), 1.2 * at_rest(small)) < 1e-6
    crown = at_rest(small, "head")[:, 2].max()
    assert crown == pytest.approx((0.040 + 0.060 + 0.188 + 0.182) * 1.5)  # Master Motor Map


def test_both_arms_combined_look_as_each_does() -> None:
    arms = go.human_arm("right"), go.human_arm("left")
    both = go.model.combine(*arms, placements=[(0.2, 0.0, 1.4), (-0.2, 0.0, 1.4)])
    for arm, x in zip(arms, (0.2, -0.2), strict=True):
        links = {mesh.link for mesh in meshes(arm)}
        assert apart(at_rest(both, *links), at_rest(arm) + np.array([x, 0.0, 1.4])) < 1e-6


@pytest.mark.parametrize(
    "model",
    [
        planar_arm((1.0, 0.8), (1.0, 1.0), (0.5, 0.4), (0.1, 0.1)),
        planar_arm((1.0,), (1.0,), (0.5,), (0.1,)),
        free_rotor((1.0, 2.0, 3.0)),
        go.load_model(urdf(), hand="grip"),
    ],
    ids=lambda model: str(model.name),
)
def test_a_model_without_geometry_is_drawn_from_its_chain(model: go.Model) -> None:
    found = meshes(model)
    for mesh in found:
        assert mesh.link in {str(frame.name) for frame in model.pin.frames}
        solid = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
        assert solid.is_watertight
        assert solid.volume > 0.0
    # Each joint moves something that is drawn, unless all joints are at one place.
    joints = {model.joint_of(mesh.link) for mesh in found}
    assert len(found) == 1 or joints >= set(range(1, model.pin.njoints))


def test_a_chain_reaches_from_its_first_joint_to_its_hand() -> None:
    points = at_rest(planar_arm((1.0, 0.8), (1.0, 1.0), (0.5, 0.4), (0.1, 0.1)))
    assert -0.1 < points[:, 0].min() < 0.0
    assert 1.8 < points[:, 0].max() < 1.9
    assert np.abs(points[:, 1:]).max() < 0.1


@pytest.mark.parametrize("seed", range(3))
def test_chains_of_trees_with_all_joints_are_finite(seed: int) -> None:
    native = random_tree(np.random.default_rng(seed))
    native.addFrame(pin.Frame("tip", native.njoints - 1, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    model = go.Model(native, "tip")
    assert np.isfinite(at_rest(model)).all()
