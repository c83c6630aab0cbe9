"""Viewer: a playback that can be looked at in a browser or a notebook, or saved."""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from geodesic_ocp.scenes.playback import Playback


@dataclass(frozen=True, eq=False, repr=False)
class Viewer:
    """An animated view of a playback.

    Attributes:
        playback: what is shown.
        height: of the frame in a notebook [px].
    """

    playback: Playback
    height: int = 760

    def html(self) -> str:
        """A self-contained page, which opens from disk without a network."""
        raise NotImplementedError

    def save(self, file: str | PathLike[str], **options: float) -> Path:
        """Write a page (.html), a video (.mp4), an animation (.gif, .webp) or a picture (.png)."""
        raise NotImplementedError

    def open(self) -> Path:
        """Write the page to a temporary file and open it in a browser."""
        raise NotImplementedError
