"""Viewer and page contain the given data and are self-contained."""

from __future__ import annotations

import base64
import html.parser
import json
import re
import shutil
import subprocess
from importlib.resources import as_file, files
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.model.geometry.meshes import meshes
from geodesic_ocp.reports.viewer import HAND, RATE, TARGET, Actor, page, viewer

ROTATION = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
FLOAT = 1e-6  # of single precision, for positions of about a metre


@pytest.fixture(scope="module")
def time() -> np.ndarray:
    return np.linspace(2.0, 3.0, 101)


@pytest.fixture(scope="module")
def actor(arm: go.Model, time: np.ndarray) -> Actor:
    fraction = np.linspace(0.0, 1.0, len(time))[:, None]
    q = arm.lower + (0.2 + 0.5 * fraction) * (arm.upper - arm.lower)
    target = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]])
    return Actor("right arm", arm, q, ROTATION, np.array([0.1, 0.2, 1.4]), target=target)


def read(fragment: str) -> dict[str, Any]:
    found = re.findall(r'<script type="application/json">(.*?)</script>', fragment, re.S)
    assert len(found) == 1
    return json.loads(found[0])


def unpacked(text: str, kind: str = "<f4", columns: int = 3) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), dtype=kind).reshape(-1, columns)


def test_poses_are_those_of_the_links(actor: Actor, time: np.ndarray) -> None:
    data = read(viewer(time, [("arm", [actor])]))
    shown = unpacked(data["time"], "<f8", 1)[:, 0]
    frames = np.searchsorted(time, shown)
    assert np.array_equal(time[frames], shown)
    (shown_actor,) = data["scenes"][0]["actors"]
    assert set(shown_actor["poses"]) == {body.link for body in actor.model.bodies}
    for link, text in shown_actor["poses"].items():
        poses = unpacked(text).reshape(-1, 4, 3)
        rotations, positions = actor.model.frame_pose(link, actor.q[frames])
        columns = ROTATION @ rotations
        assert_allclose(poses[:, :3], columns.transpose(0, 2, 1), rtol=0, atol=FLOAT)
        assert_allclose(poses[:, 3], positions @ ROTATION.T + actor.position, rtol=0, atol=FLOAT)


def test_meshes_are_stored_once_for_each_model(actor: Actor, time: np.ndarray) -> None:
    again = Actor("the same arm", actor.model, actor.q[::-1])
    other = Actor("another", go.human_arm("left"), actor.q)
    data = read(viewer(time, [("one", [actor, again]), ("two", [again, other])]))
    assert [[each["body"] for each in scene["actors"]] for scene in data["scenes"]] == [
        [0, 0],
        [0, 1],
    ]
    for part, mesh in zip(data["bodies"][0], meshes(actor.model), strict=True):
        assert part["link"] == mesh.link
        assert_allclose(unpacked(part["vertices"]), mesh.vertices, rtol=0, atol=FLOAT)
        kind = f"<u{part['bits'] // 8}"
        assert np.array_equal(unpacked(part["triangles"], kind), mesh.triangles)


def test_path_of_the_hand_and_target_are_lines(actor: Actor, time: np.ndarray) -> None:
    data = read(viewer(time, [("arm", [actor])]))
    (shown_actor,) = data["scenes"][0]["actors"]
    path = actor.model.hand_pose(actor.q)[1] @ ROTATION.T + actor.position
    assert_allclose(unpacked(shown_actor["lines"]["hand"]), path, rtol=0, atol=FLOAT)
    assert_allclose(unpacked(shown_actor["lines"]["target"]), actor.target, rtol=0, atol=FLOAT)
    frames = np.searchsorted(time, unpacked(data["time"], "<f8", 1)[:, 0])
    assert_allclose(unpacked(shown_actor["dots"]["hand"]), path[frames], rtol=0, atol=FLOAT)
    assert "target" not in shown_actor["dots"]  # it has no positions at these times
    own = Actor("arm", actor.model, actor.q, trail=np.zeros((0, 3)))
    fragment = viewer(time, [("arm", [own])])
    assert read(fragment)["scenes"][0]["actors"][0]["lines"] == {}
    assert "target</b>" not in fragment


@pytest.mark.parametrize(("rate", "seconds"), [(100.0, 3.0), (240.0, 0.5), (30.0, 2.0)])
def test_frames_are_evenly_spaced_at_the_viewers_rate(
    arm: go.Model, rate: float, seconds: float
) -> None:
    time = np.arange(round(rate * seconds) + 1) / rate
    q = np.repeat(arm.lower[None], len(time), axis=0)
    shown = unpacked(read(viewer(time, [("", [Actor("", arm, q)])]))["time"], "<f8", 1)[:, 0]
    assert len(shown) == round(seconds * RATE) + 1
    assert shown[[0, -1]].tolist() == time[[0, -1]].tolist()
    assert np.abs(np.diff(shown) - 1.0 / RATE).max() <= 1.0 / rate + 1e-9


def test_all_samples_of_slow_recordings_are_shown(arm: go.Model) -> None:
    for count in (1, 2, 8):
        time = np.arange(count) / 10.0
        actor = Actor("", arm, np.repeat(arm.lower[None], count, axis=0))
        shown = unpacked(read(viewer(time, [("", [actor])]))["time"], "<f8", 1)[:, 0]
        assert_allclose(shown, time, rtol=0, atol=0)


def test_view_contains_all_moving_points_above_the_floor(actor: Actor, time: np.ndarray) -> None:
    (scene,) = read(viewer(time, [("arm", [actor])]))["scenes"]
    extremes = unpacked(scene["extremes"])
    vertices = []
    for mesh in meshes(actor.model):
        poses = actor.poses(mesh.link, actor.q)
        vertices.append((mesh.vertices @ poses[:, :3] + poses[:, 3:]).reshape(-1, 3))
    moved = np.concatenate([*vertices, actor.trail, actor.target])
    # Extremes are those of boxes around the meshes in many directions, right to a few mm.
    assert np.all(extremes.min(axis=0) <= moved.min(axis=0) + 0.01)
    assert np.all(extremes.max(axis=0) >= moved.max(axis=0) - 0.01)
    assert scene["floor"] <= moved[:, 2].min() + 0.01


class Tags(html.parser.HTMLParser):
    """Open tags, and attributes of all tags."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: dict[str, list[dict[str, str | None]]] = {}

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.setdefault(tag, []).append(dict(attrs))
        if tag not in ("meta", "input"):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_page_is_well_formed_and_self_contained(actor: Actor, time: np.ndarray) -> None:
    scenes = [("a < b & c", [actor]), ("</script><b>", [actor])]
    text = page('"1 < 2"', "<h1>Arms</h1>" + viewer(time, scenes) + viewer(time, scenes[:1]))
    assert "http://" not in text
    assert "https://" not in text
    tags = Tags()
    tags.feed(text)
    tags.close()
    assert tags.open == []
    assert len(tags.seen["canvas"]) == 3
    assert len(tags.seen["script"]) == 4
    assert "b" in tags.seen  # of the legends
    assert len(tags.seen["title"]) == len(tags.seen["html"]) == 1
    assert not any("src" in each or "href" in each for all_ in tags.seen.values() for each in all_)
    assert "<title>&quot;1 &lt; 2&quot;</title>" in text
    assert "a &lt; b &amp; c" in text
    assert HAND in text
    assert TARGET in text
    assert "WebGL" in text


def test_equal_scenes_give_equal_html(actor: Actor, time: np.ndarray) -> None:
    assert viewer(time, [("arm", [actor])]) == viewer(time, [("arm", [actor])])


def test_wrong_arguments_are_named(arm: go.Model, actor: Actor, time: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"q must be finite, of shape \(k, 7\)"):
        Actor("", arm, np.zeros((3, 6)))
    with pytest.raises(ValueError, match="rotation must be a rotation"):
        Actor("", arm, np.zeros((3, 7)), rotation=np.ones((3, 3)))
    with pytest.raises(ValueError, match="target must be finite"):
        Actor("", arm, np.zeros((3, 7)), target=np.full((2, 3), np.nan))
    with pytest.raises(ValueError, match="right arm: q has 101 rows, time 100"):
        viewer(time[1:], [("arm", [actor])])
    with pytest.raises(ValueError, match="time must increase"):
        viewer(time[::-1], [("arm", [actor])])
    with pytest.raises(ValueError, match=r"time must be finite, of shape \(k,\)"):
        viewer([], [("arm", [actor])])


def test_script_is_valid_javascript() -> None:
    if (node := shutil.which("node")) is None:
        pytest.skip("node is not installed")
    with as_file(files("geodesic_ocp") / "data" / "viewer.js") as script:
        run = subprocess.run([node, "--check", str(script)], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    assert "</" not in script.read_text(encoding="utf-8")  # nothing that closes its element
