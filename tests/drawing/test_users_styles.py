"""Plots of pages look the same whatever style the user has chosen, and leave it as it is."""

from __future__ import annotations

import threading
from itertools import combinations
from typing import Any

import matplotlib as mpl
import matplotlib.style
import numpy as np
import pytest

from geodesic_ocp.drawing.plots import draw_plot
from geodesic_ocp.drawing.scene import SECONDS, Curve, Plot, Span
from geodesic_ocp.drawing.styles import ROLES, SURROUNDINGS, mixed, own_style
from geodesic_ocp.figures import added_style

TIME = np.linspace(0.0, 1.0, 21)
CURVES = (Curve("a_$1", TIME, TIME, "observed"), Curve("b & c", TIME, TIME**2))
PLOT = Plot("q [rad]", CURVES, "a_title")
SPANS = (Span("a", 0.0, 0.4), Span("b", 0.4, 1.0))
STYLES: dict[str, Any] = {
    "LaTeX": {"text.usetex": True},
    "dark": "dark_background",
    "tight": {"savefig.bbox": "tight", "savefig.facecolor": "black"},
    "layout": {"figure.autolayout": True},
    "lines": {"lines.marker": "o", "axes.grid": True, "xtick.labelsize": 20, "font.size": 20},
}


# Of linear red, green and blue, at full severity: Machado, Oliveira and Fernandes, IEEE TVCG 2009.
VISION = {
    "usual": np.eye(3),
    "protanopia": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "deuteranopia": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "tritanopia": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}
_TOGETHER = [("obstacle", "gap", "overlap"), "xyz"]
_XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])


def lab(colour: str, vision: Any) -> np.ndarray:
    """CIE L*a*b* of a colour of sRGB as it is seen."""
    red = np.array(mixed(colour))
    linear = np.where(red <= 0.04045, red / 12.92, ((red + 0.055) / 1.055) ** 2.4)
    x, y, z = _XYZ @ np.clip(np.array(vision) @ linear, 0.0, 1.0) / _XYZ.sum(axis=1)
    x, y, z = (np.cbrt(t) if t > 0.008856 else 7.787 * t + 16.0 / 116.0 for t in (x, y, z))
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


@pytest.mark.parametrize("vision", VISION.values(), ids=VISION)
def test_colours_of_what_is_seen_together_differ_for_everybody(vision: Any) -> None:
    roles = [style["color"] for style in ROLES.values()]
    around = [[SURROUNDINGS[name] for name in names] for names in _TOGETHER]
    for colours in (roles, *around):
        seen = [lab(colour, vision) for colour in colours]
        distances = [np.linalg.norm(a - b) for a, b in combinations(seen, 2)]
        assert min(distances) > 15.0  # about six times what is just noticed


@pytest.mark.slow
def test_plots_of_pages_are_the_same_in_every_style() -> None:
    plain = draw_plot(PLOT, (0.0, 1.0), SECONDS, SPANS)
    for style in STYLES.values():
        with matplotlib.style.context(style):
            assert draw_plot(PLOT, (0.0, 1.0), SECONDS, SPANS) == plain


def test_settings_are_the_users_again_also_with_threads() -> None:
    """One thread enters, then another; the first leaves before the second."""
    before = dict(mpl.rcParams)
    first_in, second_in, first_out = (threading.Event() for _ in range(3))

    def first() -> None:
        with own_style({"font.size": 3.0}):
            first_in.set()
            second_in.wait(0.2)  # it should not be able to enter
        first_out.set()

    def second() -> None:
        first_in.wait()
        with added_style({"font.size": 4.0}):
            second_in.set()
            first_out.wait()

    threads = [threading.Thread(target=each) for each in (first, second)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert dict(mpl.rcParams) == before


def test_settings_are_defaults_or_the_users_with_some_on_top() -> None:
    default = mpl.rcParamsDefault["lines.linewidth"]
    with mpl.rc_context({"lines.linewidth": 7.0}):
        backend = mpl.rcParams["backend"]
        with own_style({"font.size": 3.0}):
            assert mpl.rcParams["lines.linewidth"] == default
            assert mpl.rcParams["font.size"] == 3.0
            assert mpl.rcParams["backend"] == backend
        with added_style({"font.size": 3.0}):
            assert mpl.rcParams["lines.linewidth"] == 7.0
            assert mpl.rcParams["font.size"] == 3.0
        assert mpl.rcParams["lines.linewidth"] == 7.0
