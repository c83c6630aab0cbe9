"""HTML that shows one playback, as a part of a document."""

from __future__ import annotations

from geodesic_ocp.scenes.playback import Playback


def fragment(playback: Playback) -> str:
    """HTML of panes, playback bar and plots, to be put into the body of a `document`.

    It may stand there several times, among other HTML; it has no heading of its own.
    """
    raise NotImplementedError
