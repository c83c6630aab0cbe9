"""The interactive page as a file: complete, small, and with names that are only text."""

from __future__ import annotations

import base64
import json
import re
from html.parser import HTMLParser
from typing import Any

import hypothesis
import hypothesis.extra.numpy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.drawing.actors import model_actor
from geodesic_ocp.drawing.page import described, document, fragment, packed
from geodesic_ocp.drawing.scene import (
    PARAMETER,
    Curve,
    EllipsoidTrack,
    FrameTrack,
    Gap,
    Playback,
    Plot,
    PointCloud,
    Scene,
    Solid,
    Span,
    Trail,
)
from geodesic_ocp.drawing.viewer import Viewer

EVIL = '</script><script>alert("&1")</script>'
TETRAHEDRON = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
ARM = go.human_arm("right")


def moving_arm(count: int = 30) -> tuple[np.ndarray, np.ndarray]:
    time = np.linspace(0.0, 2.0, count)
    return time, np.sin(time[:, None] + np.arange(ARM.dof)) * 0.5


def everything(name: str = "name", count: int = 30) -> Playback:
    """A playback with one of everything, all of whose names are the same."""
    time, q = moving_arm(count)
    rotations, hand = ARM.hand_pose(q)
    scene = Scene(
        name,
        time,
        actors=(
            model_actor(ARM, q, name=name),
            model_actor(ARM, q + 0.1, name=name, role="baseline", translucent=True, layer=name),
        ),
        trails=(Trail(name, hand, "observed", hand), Trail(name, hand[::3], "predicted")),
        solids=(Solid(name, TETRAHEDRON, FACES), Solid(name, TETRAHEDRON, FACES, unbounded=True)),
        frames=(FrameTrack(name, rotations, hand),),
        ellipsoids=(EllipsoidTrack(name, hand, 0.1 * rotations),),
        gaps=(Gap(name, hand, hand + 0.1, np.full(count, 0.17)),),
        clouds=(PointCloud(name, hand[:, None], (name,)),),
        note=name,
    )
    plot = Plot(name, (Curve(name, time, hand[:, 0], "observed"), Curve(name, time, hand[:, 1])))
    spans = {name: (Span(name, 0.0, 1.0, name), Span(name, 1.0, 2.0))}
    return Playback(name, (scene,), spans, (plot,))


class Outline(HTMLParser):
    """Elements of a page and the text in them, as a browser would see them."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.text.append(data)

    def count(self, tag: str) -> int:
        return sum(name == tag for name, _ in self.elements)


def unpacked(data: dict[str, Any]) -> np.ndarray:
    codes = np.frombuffer(base64.b64decode(data["data"]), "<i2").astype(float)
    codes[codes == -32768] = np.nan
    rows = codes.reshape(-1, len(data["middle"]))
    return rows * np.array(data["step"]) + np.array(data["middle"])


@hypothesis.given(
    hypothesis.extra.numpy.arrays(
        float,
        hypothesis.extra.numpy.array_shapes(min_dims=2, max_dims=2, max_side=6),
        elements=hypothesis.strategies.floats(-1e3, 1e3) | hypothesis.strategies.just(np.nan),
    )
)
def test_packed_numbers_are_off_by_half_a_step_at_most(values: np.ndarray) -> None:
    data = packed(values)
    restored = unpacked(data)
    np.testing.assert_array_equal(np.isnan(restored), np.isnan(values))
    off = np.abs(restored - values)
    assert np.all(np.isnan(off) | (off <= 0.5001 * np.array(data["step"]) + 1e-12))
    spans = [np.ptp(column[~np.isnan(column)], axis=0) if (~np.isnan(column)).any() else 0.0
             for column in values.T]  # fmt: skip
    np.testing.assert_allclose(data["step"], np.array(spans) / 65534.0, rtol=1e-9, atol=1e-15)


def test_no_numbers_are_packed_as_none() -> None:
    assert unpacked(packed(np.zeros((0, 3)))).shape == (0, 3)


def test_poses_are_the_actors_and_their_quaternions_do_not_jump() -> None:
    # A whole turn, over which quaternions change their sign.
    angles = np.linspace(0.0, 4.0 * np.pi, 50)
    q = np.zeros((50, ARM.dof))
    q[:, 0] = angles
    actor = model_actor(ARM, q)
    scene = Scene("", angles, actors=(actor,))
    (described_actor,) = described(Playback("", (scene,), {}))["scenes"][0]["actors"]
    for link in described_actor["links"]:
        turns = unpacked(link["turns"])
        np.testing.assert_allclose(matrices(turns), actor.rotations[link["name"]], atol=2e-4)
        places = unpacked(link["positions"])
        np.testing.assert_allclose(places, actor.positions[link["name"]], atol=1e-4)
        assert np.all(np.sum(turns[1:] * turns[:-1], axis=1) > 0.9)


def matrices(turns: np.ndarray) -> np.ndarray:
    return np.asarray(Rotation.from_quat(turns).as_matrix())


def test_a_mesh_is_stored_once_however_often_it_is_shown() -> None:
    time, q = moving_arm()
    once = described(Playback("", (Scene("", time, (model_actor(ARM, q),)),), {}))
    both = (model_actor(ARM, q), model_actor(ARM, -q, role="observed"))
    often = described(Playback("", (Scene("", time, both), Scene("", time, both[:1])), {}))
    assert often["bodies"] == once["bodies"]
    assert len(often["scenes"][0]["actors"]) == 2


def test_trails_are_even_and_keep_their_ends() -> None:
    resting = np.array([[0.0, 0, 0]] * 100 + [[0.3, 0, 0]] * 100 + [[0.3, 0.4, 0]])
    scene = Scene("", np.zeros(1), trails=(Trail("", resting, "observed"),))
    data = described(Playback("", (scene,), {}))["scenes"][0]["trails"][0]
    points = unpacked(data["points"])
    np.testing.assert_allclose(points[[0, -1]], resting[[0, -1]], atol=1e-5)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert steps.max() < 0.005
    assert np.sum(steps < 0.9 * steps.max()) <= 1  # at the corner


def test_what_the_view_must_hold_spans_the_scene() -> None:
    playback = everything()
    (scene,) = playback.scenes
    (data,) = described(playback)["scenes"]
    points = unpacked(data["extremes"])
    lower, upper = scene.bounds()
    assert np.all(points >= lower - 1e-4)
    assert np.all(points <= upper + 1e-4)
    hand = scene.trails[0].points
    assert np.all(points.min(axis=0) <= hand.min(axis=0) + 1e-4)
    assert np.all(points.max(axis=0) >= hand.max(axis=0) - 1e-4)


def test_layers_are_on_unless_the_playback_hides_them() -> None:
    on = dict(described(everything())["layers"])
    assert [name for name in on if on[name]] == ["name", "hand path", "obstacles", "markers"]
    assert [name for name in on if not on[name]] == ["clearances", "frames", "mobility ellipsoids"]


def test_a_path_parameter_has_no_unit() -> None:
    playback = everything()
    assert not described(playback)["parameter"]
    over_path = Playback("", playback.scenes, {}, time_label=PARAMETER)
    assert described(over_path)["parameter"]


@pytest.mark.slow
def test_names_are_text_and_never_elements() -> None:
    plain, evil = (
        Outline(document("t", fragment(everything()))),
        Outline(document(EVIL, fragment(everything(EVIL)))),
    )
    assert [name for name, _ in plain.elements] == [name for name, _ in evil.elements]
    assert evil.count("script") == 3  # the data, three.js, and the page's own
    assert EVIL in evil.text  # the page's title and the scene's
    labels = [attributes.get("aria-label") for _, attributes in evil.elements]
    assert labels.count(EVIL) == 2


@pytest.mark.slow
def test_the_data_hold_names_as_they_are_without_closing_their_script() -> None:
    page = fragment(everything(EVIL))
    (data,) = re.findall(r'<script type="application/json">(.*?)</script>', page, re.DOTALL)
    assert "<" not in data
    found = json.loads(data)
    assert found["scenes"][0]["solids"][0]["name"] == EVIL
    assert found["spans"] == [[EVIL, [[EVIL, 0.0, 1.0, EVIL, None], [EVIL, 1.0, 2.0, "", None]]]]


def test_a_document_refers_to_nothing_outside_and_says_so() -> None:
    page = Outline(document("t", fragment(everything())))
    for tag, attributes in page.elements:
        assert tag not in ("link", "iframe", "object", "embed", "base")
        for name in ("src", "href", "srcset", "data", "action"):
            assert (attributes.get(name) or "data:").startswith("data:")
    policies = [a["content"] for tag, a in page.elements if tag == "meta" and "http-equiv" in a]
    assert policies[0].startswith("default-src 'none'")


@pytest.mark.slow
def test_several_fragments_share_one_library() -> None:
    one = fragment(everything())
    alone, twice = document("t", one), document("t", f"{one}<p>between</p>{one}")
    assert len(twice) - len(alone) == len(one) + len("<p>between</p>")
    assert "three.js authors" in alone  # licence of what the page contains


@pytest.mark.slow
def test_twenty_seconds_of_both_arms_at_100_hz_stay_small() -> None:
    person = go.human_upper_body()
    time = np.arange(2001) / 100.0
    q = 0.3 * np.sin(time[:, None] * 2.0 + np.arange(person.dof))
    hand = person.hand_pose(q)[1]
    scene = Scene("", time, (model_actor(person, q),), (Trail("", hand, "observed", hand),))
    plots = tuple(Plot("x [m]", (Curve("x", time, column, "observed"),)) for column in hand.T)
    # With the 0.6 MB of three.js, and a robot of 1 MB, below 3 MB.
    assert len(fragment(Playback("", (scene,), {}, plots))) < 1.0e6


@pytest.mark.slow
def test_names_that_no_file_can_hold_are_made_plain() -> None:
    shown = everything("a\0b\u202ec\udce9")
    page = Viewer(shown).html()
    assert "a b c\ufffd" in page
    assert not any(each in page for each in ("\0", "\u202e", "\udce9", "u202e", "udce9", "u0000b"))
    page.encode()
