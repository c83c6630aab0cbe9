"""`geodesic-ocp show`: what is in files, in three dimensions and in motion."""

from __future__ import annotations

import argparse

from geodesic_ocp.cli.show.destination import check_destination, present
from geodesic_ocp.cli.show.file_playbacks import file_playbacks
from geodesic_ocp.scenes.beside import beside


def show_files(options: argparse.Namespace) -> None:
    """`geodesic-ocp show`.

    Raises:
        ValueError: a file cannot be read or shown, or options do not fit; names the file.
        ImportError: the extra viewer is not installed.
        OSError: the page cannot be written.
    """
    check_destination(options)
    playbacks = file_playbacks(options)
    present(beside(playbacks, title=options.title), options)
