"""report: a page with a person and robots in motion, tables, and the figure."""

from __future__ import annotations

import base64
import html
import io
from os import PathLike
from pathlib import Path

from geodesic_ocp.drawing.page import document, fragment
from geodesic_ocp.drawing.retargeting_scenes import retargeting_playback
from geodesic_ocp.records import write_file
from geodesic_ocp.retargeting.result import Retargeting
from geodesic_ocp.tables import html as html_table


def report(retargeting: Retargeting, file: str | PathLike[str]) -> Path:
    """Write an HTML page of a retargeting: person and robots in motion, tables and the figure.

    The page needs only a browser. It has what `show` has of a retargeting; the paths of the robot's
    hand, of the person's, mapped to the robot, and of inverse kinematics have the colours of the
    figure below.

    Args:
        retargeting: result of `retarget`.
        file: path of the page; its folder must exist.

    Returns:
        Path of the file.

    Raises:
        ImportError: the extra viewer is not installed.
        OSError: the file cannot be written.
    """
    playback = retargeting_playback(retargeting)
    title = playback.title[:1].upper() + playback.title[1:]
    parts = [
        f"<h1>{html.escape(title)}</h1>",
        f"<p>{html.escape(_sentences(retargeting))}</p>",
        fragment(playback),
        "<h2>Compared with inverse kinematics that tracks the whole path of the hand</h2>",
        html_table(retargeting.table()),
        "<h2>The robot's synergies, and the person's synergies from which they are made</h2>",
        html_table(retargeting.synergy_table()),
        f'<p><img alt="hand and joints over time" src="{_picture(retargeting)}"></p>',
    ]
    return write_file(file, document(title, "\n".join(parts)))


def _sentences(retargeting: Retargeting) -> str:
    within_limits = retargeting.settings.within_limits
    held = "within the robot's limits" if within_limits else "without limits"
    formulation = retargeting.settings.formulation
    description = {
        "constrained": "Each synergy is the path of least energy to the hand pose at its end, "
        f"{held}.",
        "geodesic": "Each synergy is the geodesic that brings the hand nearest to the pose at the "
        "person's; joint limits are not considered.",
    }[formulation]
    stretch = retargeting.stretch
    time = (
        f"The robot takes {stretch:.2f} times as long as the person, because of joint speed limits."
        if stretch > 1.0
        else "The robot takes the person's time."
    )
    num_unreachable = sum(len(arm.out_of_reach) for arm in retargeting.arms)
    reach = f" Poses out of reach: {num_unreachable}." if num_unreachable else ""
    return f"{description} {time}{reach}"


def _picture(retargeting: Retargeting) -> str:
    """Return the figure as a data URL."""
    data = io.BytesIO()
    retargeting.plot().savefig(data, format="png", dpi=110)
    return f"data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}"
