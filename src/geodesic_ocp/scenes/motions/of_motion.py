"""A motion with its model, to be looked at."""

from __future__ import annotations

from dataclasses import replace

from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.scenes.motions.joint_plots import POSITIONS, hand_speed_plots, joint_plots
from geodesic_ocp.scenes.motions.model_scene import model_scene
from geodesic_ocp.scenes.motions.shown_samples import shown_samples
from geodesic_ocp.scenes.playback import Playback
from geodesic_ocp.trajectory.motion import Motion

_NOT_FILTERED = "speed of the recorded motion, without filtering"


def motion_playback(motion: Motion, model: Model, *, title: str = "", note: str = "") -> Playback:
    """A model that follows a motion: the path of the hand, joint angles and hand speed.

    It is shown in axes of the model's base: the arm of a person moves relative to the trunk. Of
    more than 200 samples per second or 12000 altogether every n-th is shown, which the note of the
    scene says.

    >>> import geodesic_ocp as go
    >>> from importlib.resources import files
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv").filtered()
    >>> motion_playback(motion, go.human_arm("left")).scenes[0].trails[0]
    Trail('hand', 840 points)

    Args:
        motion: with the model's joints, by their names; others are left out.
        model: that moves.
        title: of the playback; the model's name by default.
        note: precedes the scene's own.

    Raises:
        ValueError: the motion lacks joints of the model.
    """
    chosen = of_joints(motion, model)
    shown, thinned = shown_samples(chosen.time)
    others = len(motion.joint_names) - model.dof
    notes = [note, f"{others} more joints recorded" if others else "", thinned]
    if chosen.trunk is not None:  # which moved, but the scene is that of the model's base
        notes.insert(1, f"the {'pelvis' if model.pin.existFrame('thorax') else 'trunk'} at rest")
    time, q = chosen.time[shown], chosen.q[shown]
    scene = model_scene(model, time, q, title=title, note="; ".join(filter(None, notes)))
    speeds = hand_speed_plots(model, {"hand": (chosen, "observed")}, shown)
    if chosen.velocity is None:  # the noise of the recording is in the speed
        speeds = tuple(replace(plot, title=_NOT_FILTERED) for plot in speeds)
    plots = (*joint_plots(model, time, q, POSITIONS), *speeds)
    return Playback(scene.title, (scene,), {}, plots, azimuth=viewed_from(model))


def of_joints(motion: Motion, model: Model) -> Motion:
    """The motion of the model's joints.

    Raises:
        ValueError: the motion lacks some, or its angles seem to be degrees.
    """
    missing = [name for name in model.joint_names if name not in motion.joint_names]
    if missing:
        raise ValueError(
            f"the motion has no joint {', '.join(missing)} of {model.name}; it has "
            f"{', '.join(motion.joint_names)}"
        )
    chosen = motion.select(model.joint_names)
    metric = KineticEnergy(model)
    for extremes in (chosen.q.min(axis=0), chosen.q.max(axis=0)):
        metric.check_units("motion", extremes)
    return chosen


def viewed_from(model: Model) -> float:
    """Azimuth of the camera [deg] from which the hands of a model are seen best."""
    sides = {side for hand in model.hands for side in ("left", "right") if side in hand}
    names = {name[:1] for name in model.joint_names if name.endswith("Sx_joint")}
    if names == {"L"} or (not names and sides == {"left"}):
        return -50.0
    return 50.0 if len(names or sides) < 2 else 20.0
