"""The replay of a trajectory by a simulated robot, to be looked at."""

from __future__ import annotations

from dataclasses import replace

from geodesic_ocp.execution.replay import Replay
from geodesic_ocp.scenes.actor import model_actor
from geodesic_ocp.scenes.motions.joint_plots import joint_plots
from geodesic_ocp.scenes.motions.model_scene import hand_trails
from geodesic_ocp.scenes.motions.of_motion import motion_playback
from geodesic_ocp.scenes.motions.of_trajectory import torque_plots
from geodesic_ocp.scenes.motions.shown_samples import shown_samples
from geodesic_ocp.scenes.playback import Curve, Playback, Plot

_ERRORS = {"rad": "joint errors [rad]", "m": "prismatic joint errors [m]"}


def replay_playback(replay: Replay, *, title: str = "") -> Playback:
    """The simulated robot, and the trajectory that it follows as an overlay.

    Args:
        replay: of a trajectory.
        title: of the playback; the model's name by default.
    """
    model = replay.model
    playback = motion_playback(replay.motion, model, title=title, note=replay.controller)
    (scene,) = playback.scenes
    shown, _ = shown_samples(replay.motion.time)
    time, wanted = replay.motion.time[shown], replay.reference.positions[shown]
    overlay = model_actor(
        model, wanted, name="trajectory", role="predicted", translucent=True, layer="trajectory"
    )
    trails = hand_trails(model, wanted, "predicted", name="trajectory", layer="trajectory")
    scene = replace(scene, actors=(*scene.actors, overlay), trails=(*scene.trails, *trails))
    distance = Curve("hand", time, 1000.0 * replay.position_error[shown])
    plots = (
        *joint_plots(model, time, replay.error[shown], _ERRORS),
        Plot("hand error [mm]", (distance,)),
        *torque_plots(model, time, replay.torques[shown], replay.torque_limits),
    )
    return replace(playback, scenes=(scene,), plots=plots)
