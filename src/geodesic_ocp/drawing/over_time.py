"""Figures of coordinates over time: motions, trajectories, replays and markers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.styles import BASELINE, OBSERVED, PREDICTED, line_styles, new_figure
from geodesic_ocp.execution.replay import Replay
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.trajectory.joint_trajectory import JointTrajectory
from geodesic_ocp.trajectory.motion import Motion
from geodesic_ocp.trajectory.timed_motion import TimedMotion

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SAMPLES = 201
_ROW = 7.0 / 3.0  # [inch]


def draw_over_time(
    time: Array, rows: Mapping[str, Array], names: Sequence[str], title: str
) -> Figure:
    """Draw quantities of the same joints over time, one below the other.

    Args:
        time: (k,) [s].
        rows: values (k, n) by the label of their axis, with the unit.
        names: of the n joints.
        title: title of the figure.
    """
    figure = new_figure(8.0, max(3.2, _ROW * len(rows)))
    panels = figure.subplots(len(rows), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (label, values) in zip(panels, rows.items(), strict=True):
        for column, style in zip(values.T, line_styles(len(names)), strict=True):
            axes.plot(time, column, **style)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
    panels[0].legend(names, loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    panels[-1].set_xlabel("time [s]")
    figure.suptitle(title)
    return figure


def motion_figure(motion: Motion) -> Figure:
    """Draw angles, and velocities if they are known, over time."""
    rows = {"q [rad or m]": motion.q}
    if motion.velocity is not None:
        rows["velocity [per s]"] = motion.velocity
    title = f"motion of {motion.duration:.3g} s"
    return draw_over_time(motion.time, rows, motion.joint_names, title)


def trajectory_figure(trajectory: JointTrajectory) -> Figure:
    """Draw positions, velocities and accelerations over time."""
    rows = {
        "q [rad or m]": trajectory.positions,
        "velocity [per s]": trajectory.velocities,
        "acceleration [per s$^2$]": trajectory.accelerations,
    }
    title = f"trajectory of {trajectory.time[-1] - trajectory.time[0]:.3g} s"
    return draw_over_time(trajectory.time, rows, trajectory.joint_names, title)


def timed_figure(motion: TimedMotion, title: str = "") -> Figure:
    """Draw coordinates, velocities and torques over time."""
    t = np.linspace(motion.times[0], motion.times[-1], _SAMPLES)
    rows = {
        "q [rad or m]": motion(t),
        "velocity [per s]": motion(t, 1),
        "torque [N m or N]": motion.torques(t),
    }
    problem = getattr(motion, "problem", None)
    name = type(motion if problem is None else problem).__name__
    objective = getattr(motion, "objective", None)
    named = name if objective is None else f"{name}: objective {objective:.4g}"
    return draw_over_time(t, rows, motion.metric.coordinate_names, title or named)


def markers_figure(markers: Markers) -> Figure:
    """Draw the coordinates of all markers over time."""
    rows = {f"{axis} [m]": markers.positions[:, :, k] for k, axis in enumerate("xyz")}
    return draw_over_time(markers.time, rows, markers.names, f"{len(markers.names)} markers")


def replay_figure(replay: Replay) -> Figure:
    """Draw tracking errors of the joints, errors of the hand and shares of torques over time."""
    figure = new_figure(9.0, 8.0)
    joints, hand, torques = figure.subplots(3, 1, sharex=True)
    time = replay.motion.time
    names = replay.model.joint_names
    shares = replay.torques / replay.torque_limits
    for name, error, share, style in zip(
        names, replay.error.T, shares.T, line_styles(len(names)), strict=True
    ):
        joints.plot(time, 1e3 * error, **style, label=name)
        torques.plot(time, 100.0 * share, **style)
    units = set(replay.model.units)
    shown = "mrad" if units == {"rad"} else "mm" if units == {"m"} else "mrad or mm"
    joints.set_ylabel(f"joint error [{shown}]")
    hand.plot(time, 1e3 * replay.position_error, **OBSERVED, label="position [mm]")
    hand.plot(time, 1e3 * replay.orientation_error, **PREDICTED, label="orientation [mrad]")
    hand.set_ylabel("hand error")
    hand.legend(loc="best", fontsize="small")
    hand.set_ylim(bottom=0.0)
    torques.set_ylabel("torque, share of its limit [%]")
    torques.set_xlabel("time [s]")
    if np.abs(shares).max() > 0.5:
        for side in (-100.0, 100.0):
            torques.axhline(side, **BASELINE)
    figure.legend(*joints.get_legend_handles_labels(), loc="outside right upper", fontsize="small")
    return figure
