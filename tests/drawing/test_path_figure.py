"""The figure of a path: arms and obstacles in it, and its file."""

from __future__ import annotations

import re
import zlib
from pathlib import Path

import numpy as np
import pytest
from known_models import planar_arm
from matplotlib.colors import to_rgb

import geodesic_ocp as go
from geodesic_ocp.drawing.path_figure import draw_path
from geodesic_ocp.drawing.styles import ROLES
from geodesic_ocp.figures import save_figure

START, END = np.zeros(7), np.array([0.6, 0.2, -0.3, 0.9, 0.1, 0.0, 0.1])


@pytest.fixture(scope="module")
def path() -> go.Path:
    grid = go.Grid(1, 6)
    nodes = START + grid.nodes[:, None] * (END - START)
    return go.Path(go.KineticEnergy(go.human_arm("right")), grid, nodes)


@pytest.mark.slow
def test_the_arm_is_drawn_along_the_path_and_where_it_is_nearest(path: go.Path) -> None:
    model = path.metric.model  # type: ignore[attr-defined]
    lamp = go.Ball(tuple(model.hand_pose(path(0.37))[1] + [0.0, 0.12, 0.0]), 0.05, name="lamp")
    figure = draw_path(path, "reach", obstacles=[lamp])
    strip, close_up = figure.axes[3:]
    texts = [text.get_text() for text in strip.texts]
    below = [text for text in texts if text.startswith("s = ")]
    assert len(below) == 6
    (nearest,) = [text for text in below if "nearest" in text]
    s = float(re.findall(r"s = ([\d.]+)", nearest)[0])
    distances = [
        min(go.distances.signed_distances(model, path(each), [lamp]).values())
        for each in np.linspace(0.0, 1.0, 101)
    ]
    assert s == pytest.approx(np.argmin(distances) / 100.0)
    least = f"{1000.0 * min(distances):.0f} mm".replace("-", "\u2212")
    assert least in nearest
    assert least in close_up.get_title("left")
    gap = close_up.get_lines()[-2].get_xydata()  # the last line is the scale
    assert np.linalg.norm(gap[1] - gap[0]) <= abs(min(distances)) + 1e-9  # as it is projected
    middle = np.mean([close_up.get_xlim(), close_up.get_ylim()], axis=1)
    assert gap.mean(axis=0) == pytest.approx(middle)
    assert len([each for each in strip.collections if each.get_hatch()]) == 6
    assert len(draw_path(path, "while it is found", arms=False).axes) == 3


@pytest.mark.slow
def test_a_planar_arm_is_drawn_over_itself_in_metres() -> None:
    arm = planar_arm((0.5, 0.2), (1.0, 1.0), (0.2, 0.1), (0.01, 0.01))
    figure = go.plot(go.geodesic(go.KineticEnergy(arm), [0.0, 0.4], [0.8, 1.0]))
    overlay = figure.axes[-1]
    assert (overlay.get_xlabel(), overlay.get_ylabel()) == ("x [m]", "y [m]")
    assert [text.get_text() for text in overlay.texts] == ["0", "0.2", "0.4", "0.6", "0.8", "1"]


def test_a_metric_without_a_model_has_no_arm() -> None:
    figure = go.plot(go.geodesic(go.Euclidean(2), [0.0, 0.0], [1.0, 1.0]))
    assert len(figure.axes) == 2


@pytest.mark.slow
def test_a_file_for_print_is_small_and_has_text(path: go.Path, tmp_path: Path) -> None:
    save_figure(draw_path(path, "reach"), tmp_path)
    written = (tmp_path / "figure.pdf").read_bytes()
    assert len(written) < 500_000
    streams = re.findall(rb"stream\r?\n(.*?)\r?\nendstream", written, re.DOTALL)
    plain = b"".join(map(_inflated, streams))
    assert b"/Type3" not in written
    assert b"/Type3" not in plain
    assert b"TrueType" in written + plain or b"CIDFontType2" in written + plain
    assert not re.search(rb"/Subtype\s*/Image", written)


def test_colours_differ_in_grey() -> None:
    shades = {
        name: np.dot(to_rgb(style["color"]), (0.299, 0.587, 0.114)) for name, style in ROLES.items()
    }
    assert shades["predicted"] - shades["observed"] > 0.25


def _inflated(stream: bytes) -> bytes:
    try:
        return zlib.decompress(stream)
    except zlib.error:
        return b""
