"""Synergies that analyse and retarget wrote."""

from __future__ import annotations

import argparse
from pathlib import Path

from geodesic_ocp.cli.show.recordings import recordings
from geodesic_ocp.cli.show.shown_robot import is_installed, shown_robot
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.human import DEFAULT_HEIGHT, human_arm, human_upper_body
from geodesic_ocp.model.model import Model
from geodesic_ocp.scenes.playback import Playback
from geodesic_ocp.scenes.recorded.of_saved_synergies import saved_synergies_playback
from geodesic_ocp.synergies.synergy import SavedSynergies, read_saved_synergies


def synergies_file(
    file: Path, options: argparse.Namespace, recorded: Path | None = None
) -> Playback:
    """The motion that synergies predict, over the recorded one if that is given.

    Raises:
        RecordingError: the file is not one of synergies, it is not known whose they are, or the
            recording has other joints.
    """
    saved = read_saved_synergies(file)
    names = set(saved.motion.joint_names)
    title = f"{file.parent.name}/{file.name}" if file.parent.name else file.name
    if recorded is None:
        return saved_synergies_playback(saved, _model(file, saved, options), title=title)
    if options.side is None:
        options.side = "left" if names <= set(human_arm("left").joint_names) else "right"
    (recording, *_) = recordings(recorded, options)
    if set(recording.model.joint_names) != names:
        raise RecordingError(
            f"{file}: its joints {', '.join(saved.motion.joint_names)} are not those of "
            f"{recorded}, which are {', '.join(recording.model.joint_names)}"
        )
    name = f"{recording.name}: {len(saved.spans)} geodesic synergies"
    return saved_synergies_playback(saved, recording.model, recording.motion, title=name)


def _model(file: Path, saved: SavedSynergies, options: argparse.Namespace) -> Model:
    """The model that the file names, or the person whose joints they are, or --robot."""
    if options.robot is not None:
        return shown_robot(options.robot[0], options.hand, options.base)
    names = set(saved.motion.joint_names)
    height = options.height or saved.height
    assumed = DEFAULT_HEIGHT if height is None else height
    people = (human_arm("right"), human_arm("left"), human_upper_body())
    person = next((each for each in people if set(each.joint_names) == names), None)
    if person is not None:
        if height is None:
            print(f"note: {file}: assumed height {assumed} m; --height gives another")
        if person.dof > 7:
            return human_upper_body(assumed)
        return human_arm("left" if "left" in person.name else "right", assumed)
    if is_installed(saved.model):
        return shown_robot(saved.model, options.hand, options.base)
    of = f" of {saved.model!r}" if saved.model else ""
    raise RecordingError(f"{file}: has synergies{of}; say which robot it is: --robot NAME or FILE")
