"""Videos and pictures of playbacks, shot by a browser without a screen."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from PIL import Image, ImageSequence

from geodesic_ocp.drawing import browser
from geodesic_ocp.drawing import save_video as writers
from geodesic_ocp.drawing.actors import Actor
from geodesic_ocp.drawing.look import Mesh
from geodesic_ocp.drawing.save_video import save_video
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

CORNERS = np.array(np.meshgrid([-0.1, 0.1], [-0.1, 0.1], [-0.1, 0.1])).reshape(3, -1).T
# Of the cube, counter-clockwise seen from outside.
FACES = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
NASTY = "$x_ \\alpha^{ <script>&\x00\n"
SMALL = {"width": 240, "rate": 5.0}


@pytest.fixture(scope="module")
def started() -> Iterator[Any]:
    """One browser for all pictures of this file."""
    try:
        chromium = browser.chromium()
        one = chromium.__enter__()
    except ImportError as reason:
        pytest.skip(str(reason))
    yield one
    chromium.__exit__(None, None, None)


@pytest.fixture(autouse=True)
def shared(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Slow tests shoot pictures; the others need no browser."""
    if not request.node.get_closest_marker("slow"):
        yield
        return
    thread, program = request.getfixturevalue("started")
    monkeypatch.setattr(browser, "chromium", lambda: nullcontext((thread, program)))
    yield
    for context in program.contexts:
        thread.submit(context.close).result()


def cube() -> NDArray[np.int64]:
    """Triangles of `CORNERS`, all of them outward."""
    faces = np.array([[a, b, c] for w in FACES for a, b, c in (w[:3], [w[0], *w[2:]])])
    sides = CORNERS[faces]
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    inward = (normals * sides.mean(axis=1)).sum(axis=1) < 0.0
    faces[inward] = faces[inward, ::-1]
    return faces


def moving(stop: float = 1.0, name: str = "cube", samples: int = 11) -> Playback:
    """A red cube that moves along x, in 1 s."""
    time = np.linspace(0.0, stop, samples)
    path = np.column_stack([np.linspace(0.0, 1.0, samples), np.zeros((samples, 2))])
    mesh = Mesh("link", CORNERS, cube(), (0.9, 0.1, 0.1))
    actor = Actor(name, (mesh,), {"link": np.eye(3)[None]}, {"link": path})
    scene = Scene(name, time, (actor,), (Trail(name, path, "observed", path),), note=name)
    plot = Plot(f"{name} [m]", (Curve(name, time, time), Curve("_b", time, 1.0 - time)), name)
    spans = (Span(name, 0.0, stop / 2.0), Span("second", stop / 2.0, stop))
    return Playback(name, (scene,), {name: spans, "other": spans}, (plot,))


def standing() -> Playback:
    playback = moving(samples=1, stop=0.0)
    return replace(playback, spans={}, plots=())


def pictures(file: Path) -> list[NDArray[np.uint8]]:
    with Image.open(file) as image:
        return [np.array(each.convert("RGB")) for each in ImageSequence.Iterator(image)]


def durations(file: Path) -> list[int]:
    with Image.open(file) as image:
        found = []
        for each in ImageSequence.Iterator(image):
            each.load()
            found.append(int(each.info["duration"]))
    return found


def red(picture: NDArray[np.uint8]) -> float:
    """The mean column of red pixels."""
    colours = picture.astype(int)
    found = (colours[..., 0] > 90) & (colours[..., 1:].max(axis=-1) < colours[..., 0] // 2)
    return float(np.nonzero(found)[1].mean())


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["gif", "webp"])
def test_an_animation_lasts_as_long_as_the_motion_and_half_a_second(
    tmp_path: Path, suffix: str
) -> None:
    file = save_video(moving(), tmp_path / f"cube.{suffix}", **SMALL)
    frames, times = pictures(file), durations(file)
    assert len(frames) == 6
    assert sum(times) == 1700  # 6 frames of 0.2 s, and half a second
    assert frames[0].shape[1] == 240
    if suffix == "gif":
        assert all(np.all(frame[0] == 255) for frame in frames)  # its paper is white
    with Image.open(file) as image:
        assert image.info["loop"] == 0


@pytest.mark.slow
def test_the_cube_moves_and_the_last_frame_is_the_end(tmp_path: Path) -> None:
    # Seen from the front, x points to the left.
    playback = replace(moving(), azimuth=0.0)
    frames = pictures(save_video(playback, tmp_path / "cube.webp", **SMALL))
    places = [red(frame) for frame in frames]
    assert np.all(np.diff(places) < 0.0)
    still = save_video(playback, tmp_path / "end.png", width=240, at=1.0)
    (end,) = pictures(still)
    assert abs(red(end) - places[-1]) < 1.0
    assert np.abs(end.astype(int) - frames[-1]).mean() < 5.0


@pytest.mark.slow
def test_the_cursor_moves(tmp_path: Path) -> None:
    early, late = (
        pictures(save_video(moving(), tmp_path / f"{at}.png", width=480, at=at))[0]
        for at in (0.2, 0.8)
    )
    # The plot is to the right of the only pane.
    columns = np.abs(early.astype(int) - late).max(axis=2)[60:200, 290:].max(axis=0)
    assert np.ptp(np.flatnonzero(columns > 100)) > 50


@pytest.mark.slow
def test_the_speed_and_the_parameter_of_a_path_set_the_duration(tmp_path: Path) -> None:
    fast = save_video(moving(), tmp_path / "fast.gif", width=240, rate=10.0, speed=2.0)
    assert sum(durations(fast)) == 1100
    path = replace(moving(), time_label=PARAMETER)
    slow = save_video(path, tmp_path / "path.gif", width=160, rate=1.0)
    assert sum(durations(slow)) == 5500  # 4 s, the frame at the end, and half a second


@pytest.mark.slow
def test_what_stands_still_is_seen_from_all_around(tmp_path: Path) -> None:
    file = save_video(standing(), tmp_path / "cube.webp", width=160, rate=1.0)
    frames = pictures(file)
    assert sum(durations(file)) == 6000
    assert len(frames) == 6
    assert all(np.any(a != b) for a, b in pairwise(frames))
    (still,) = pictures(save_video(standing(), tmp_path / "cube.png", width=160))
    assert still.shape[1] == 160


@pytest.mark.slow
def test_an_mp4_can_be_read(tmp_path: Path) -> None:
    imageio_ffmpeg = pytest.importorskip("imageio_ffmpeg")
    done: list[tuple[int, int]] = []
    file = save_video(
        moving(),
        tmp_path / "cube.mp4",
        width=241,
        rate=10.0,
        progress=lambda _, now, total: done.append((now, total)),
    )
    count, seconds = imageio_ffmpeg.count_frames_and_secs(str(file))
    assert count == 16  # 11, of which the last stays for half a second
    assert seconds == pytest.approx(1.6, abs=0.11)
    assert done == [(index, 11) for index in range(1, 12)]
    assert [each.name for each in tmp_path.iterdir()] == ["cube.mp4"]


def test_without_ffmpeg_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    monkeypatch.setattr(writers.shutil, "which", lambda _: None)
    with pytest.raises(ImportError, match=r"geodesic_ocp\[show\]"):
        save_video(moving(), tmp_path / "cube.mp4", **SMALL)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_narrow_picture_is_the_page_made_smaller_with_fewer_plots(tmp_path: Path) -> None:
    playback = moving()
    two = replace(playback, plots=playback.plots * 2, scenes=playback.scenes * 2)
    shapes = [
        pictures(save_video(two, tmp_path / "x.png", width=width))[0].shape
        for width in (720, 960, 240)
    ]
    assert [width for _, width, _ in shapes] == [720, 960, 240]
    assert all(height % 2 == 0 for height, _, _ in shapes)
    assert shapes[0][0] == pytest.approx(0.75 * shapes[1][0], abs=2)
    assert shapes[2][0] > 240  # panes below each other


@pytest.mark.slow
def test_any_name_can_be_written(tmp_path: Path) -> None:
    file = save_video(moving(name=NASTY), tmp_path / "nasty.png", width=480)
    (nasty,) = pictures(file)
    assert np.ptp(nasty) > 200


@pytest.mark.slow
def test_layers_are_shown_if_asked_for(tmp_path: Path) -> None:
    playback = moving()
    time, turn = playback.scenes[0].time, np.eye(3)[None]
    high = np.tile([0.5, 0.0, 0.4], (len(time), 1))
    scene = replace(
        playback.scenes[0],
        solids=(Solid("box", CORNERS + np.array([0.5, 0.0, 0.5]), cube()),),
        frames=(FrameTrack("frame", turn, high[:1]),),
        ellipsoids=(EllipsoidTrack("ball", high, np.tile(-0.2 * np.eye(3), (len(time), 1, 1))),),
        gaps=(Gap("gap", high, high * 0.0, np.ones(len(time))),),
    )
    scene = replace(scene, clouds=(PointCloud("points", high[:, None], ("a",)),))
    whole = replace(playback, scenes=(scene,))
    seen = []
    for index, name in enumerate(("obstacles", "frames", "mobility ellipsoids", "clearances")):
        file = save_video(whole, tmp_path / f"{index}.png", width=240, layers=[name])
        seen.append(pictures(file)[0])
    assert len({each.tobytes() for each in seen}) == 4
    with pytest.raises(ValueError, match="layers: 'hand'"):
        save_video(whole, tmp_path / "x.png", layers=["hand"])


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("x.avi", {}, r"x\.avi must end in one of \.mp4"),
        ("x.gif", {"rate": 0.0}, "rate must be positive"),
        ("x.gif", {"rate": 60.0}, "rate must be at most 50"),
        ("x.gif", {"width": 12}, "width must be from 160"),
        ("x.gif", {"speed": -1.0}, "speed must be positive"),
        ("x.gif", {"at": 0.5}, r"at is the time of a \.png"),
        ("x.png", {"at": 7.0}, "at must be from 0 to 1"),
    ],
)
def test_wrong_arguments_are_named(
    tmp_path: Path, name: str, options: dict[str, float], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        save_video(moving(), tmp_path / name, **options)  # type: ignore[arg-type]


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="nowhere"):
        save_video(moving(), tmp_path / "nowhere" / "x.png")


@pytest.mark.slow
def test_neither_a_screen_nor_a_thread_without_an_event_loop_is_needed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Notebooks run one."""

    async def cell() -> Path:
        return save_video(standing(), tmp_path / "x.png", width=160)

    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert pictures(asyncio.run(cell()))[0].shape[1] == 160


def test_without_playwright_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "playwright.sync_api", None)
    with pytest.raises(ImportError, match=r"pip install 'geodesic_ocp\[show\]'"):
        save_video(moving(), tmp_path / "cube.png", **SMALL)
    assert not list(tmp_path.iterdir())


def test_without_a_chromium_ways_to_get_one_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("playwright.sync_api", reason="needs playwright (extra show)")
    monkeypatch.setattr(browser, "find_chromium", lambda playwright: None)
    with pytest.raises(ImportError, match="playwright install chromium"):
        save_video(moving(), tmp_path / "cube.png", **SMALL)
    monkeypatch.setattr(browser, "find_chromium", lambda playwright: str(tmp_path / "absent"))
    with pytest.raises(ImportError, match="absent does not start"):
        save_video(moving(), tmp_path / "cube.png", **SMALL)
    assert not list(tmp_path.iterdir())


def test_the_chromium_of_the_environment_comes_first(monkeypatch: pytest.MonkeyPatch) -> None:
    own = SimpleNamespace(chromium=SimpleNamespace(executable_path=sys.executable))
    none = SimpleNamespace(chromium=SimpleNamespace(executable_path="/absent"))
    monkeypatch.setattr(browser.shutil, "which", lambda name: f"/bin/{name}")
    monkeypatch.delenv(browser.ENVIRONMENT_VARIABLE, raising=False)
    assert browser.find_chromium(own) == sys.executable
    assert browser.find_chromium(none) == "/bin/chromium"
    monkeypatch.setenv(browser.ENVIRONMENT_VARIABLE, "/mine")
    assert browser.find_chromium(own) == "/mine"
    monkeypatch.delenv(browser.ENVIRONMENT_VARIABLE)
    monkeypatch.setattr(browser.shutil, "which", lambda name: None)
    assert browser.find_chromium(none) is None


@pytest.mark.slow
def test_an_overlay_is_outlined_and_what_has_a_colour_is_seen_through_it(tmp_path: Path) -> None:
    playback = standing()
    scene = playback.scenes[0]
    ball = trimesh.creation.icosphere(radius=0.1)
    mesh = Mesh("link", np.array(ball.vertices), np.array(ball.faces), (0.9, 0.1, 0.1))
    observed = replace(scene.actors[0], meshes=(mesh,), role="observed")
    overlay = replace(observed, role="predicted", translucent=True)
    pair = replace(scene, actors=(observed, overlay), trails=(), title="", note="")
    playback = replace(playback, scenes=(pair,), title="", azimuth=0.0, elevation=0.0)
    (seen,) = pictures(save_video(playback, tmp_path / "pair.png", width=480))
    pane = seen.astype(int)
    orange = (pane[..., 0] - pane[..., 2] > 40).nonzero()
    dark = pane.max(axis=-1) < 110
    blue = (dark & (pane[..., 2] - pane[..., 0] > 10)).nonzero()
    assert blue[0].size > orange[0].size > 0
    for axis in (0, 1):  # around it
        assert orange[axis].min() <= blue[axis].min() <= blue[axis].max() <= orange[axis].max()


def test_a_gif_whose_frames_are_all_alike_lasts_as_long(tmp_path: Path) -> None:
    file = tmp_path / "same.gif"
    frame = np.full((10, 20, 3), 200, dtype=np.uint8)
    frame[2:5, 3:9] = [30, 60, 90]
    writers.write_gif(file, [frame] * 3, [frame], [100, 100, 600])
    assert sum(durations(file)) == 800
    assert all(np.abs(each.astype(int) - frame).max() < 5 for each in pictures(file))
