"""The rest of a person beside the model of an arm."""

from __future__ import annotations

import numpy as np
import pytest
import scipy
import trimesh
from gadget import urdf
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.actors import Actor, model_actor, rest_of_person
from geodesic_ocp.drawing.meshes import meshes
from geodesic_ocp.model.anthropometry import Sex


def points(actor: Actor, *links: str) -> Array:
    """Vertices of links in the scene."""
    return np.concatenate(
        [
            mesh.vertices @ actor.rotations[mesh.link][0].T + actor.positions[mesh.link][0]
            for mesh in actor.meshes
            if not links or mesh.link in links
        ]
    )


def apart(points: Array, others: Array) -> float:
    """Largest distance [m] of a point from the nearest of the others, either way."""
    ways = (points, others), (others, points)
    return float(max(scipy.spatial.cKDTree(a).query(b)[0].max() for a, b in ways))


def rest(model: go.Model) -> Actor:
    (found,) = rest_of_person(model)
    return found


@pytest.mark.slow
def test_an_arm_and_the_rest_are_the_whole_person() -> None:
    arm, whole = go.human_arm("right", 1.8, 80.0), go.human_upper_body(1.8, 80.0)
    shoulder = whole.frame_pose("RSx_joint", np.zeros(20))[1]
    person, beside = model_actor(whole, np.zeros((1, 20))), rest(arm)
    for links in (("thorax",), ("head",), ("left upper arm",), ("left forearm",), ("left hand",)):
        assert apart(points(beside, *links) + shoulder, points(person, *links)) < 1e-6
    assert not [mesh for mesh in beside.meshes if mesh.link.startswith("right")]


def test_left_and_right_are_mirror_images() -> None:
    right, left = (rest(go.human_arm(side)) for side in ("right", "left"))
    assert apart(points(left) * [-1.0, 1.0, 1.0], points(right)) < 1e-6


@pytest.mark.parametrize("sex", ["male", "female"])
def test_the_other_arm_has_the_lengths_of_the_table(sex: Sex) -> None:
    arm = go.human_arm("left", 1.7, 65.0, table="de_leva", sex=sex)
    own = points(model_actor(arm, np.zeros((1, 7))))
    assert points(rest(arm))[:, 2].min() == pytest.approx(own[:, 2].min(), abs=1e-9)


def test_the_rest_is_solid() -> None:
    for mesh in rest(go.human_arm("right")).meshes:
        solid = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
        assert solid.is_watertight
        assert solid.volume > 0.0


@pytest.mark.parametrize("half", [0.17, 0.22])
def test_a_trunk_is_as_wide_as_the_shoulders_of_both_arms(half: float) -> None:
    arms = go.human_arm("left"), go.human_arm("right")
    both = go.model.combine(*arms, placements=[(-half, 0.0, 1.4), (half, 0.0, 1.4)])
    trunk = rest(both)
    chest = points(trunk, "thorax")
    assert_allclose(chest[:, 0].min(), -chest[:, 0].max(), atol=1e-9)
    assert 0.7 * half < chest[:, 0].max() < half
    assert points(trunk, "head")[:, 2].min() > 1.4 - 0.05
    assert not [mesh for mesh in trunk.meshes if "arm" in mesh.link or "hand" in mesh.link]


def test_other_models_have_no_rest() -> None:
    arm = go.human_arm("right")
    assert not rest_of_person(go.human_upper_body())
    assert not rest_of_person(go.load_model(urdf(), hand="grip"))
    assert not rest_of_person(go.model.combine(arm, go.human_arm("left")))  # shoulders coincide
    assert not rest_of_person(go.model.combine(arm, arm, placements=[(0, 0, 0), (1, 0, 0)]))
    assert not rest_of_person(arm.with_bodies(go.Ball((0, 0, 0), 0.1, "right hand")))
    assert meshes(arm)
