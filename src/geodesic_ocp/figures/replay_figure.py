"""Errors and torques of a simulated robot over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.arrays import Array
from geodesic_ocp.figures.new_figure import new_figure
from geodesic_ocp.figures.styles import BASELINE, OBSERVED, PREDICTED, line_styles

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_replay(
    time: Array,
    joint_names: Sequence[str],
    units: Sequence[str],
    error: Array,
    hand_errors: tuple[Array, Array],
    torque_shares: Array,
) -> Figure:
    """Three panels over time (k,) [s].

    Args:
        time: of the samples.
        joint_names, units: of the n joints.
        error: of positions (k, n) [rad or m].
        hand_errors: of position [m] and orientation [rad], (k,) each.
        torque_shares: torques over their limits (k, n).
    """
    figure = new_figure(9.0, 8.0)
    joints, hand, torques = figure.subplots(3, 1, sharex=True)
    styles = line_styles(len(joint_names))
    for name, column, share, style in zip(
        joint_names, error.T, torque_shares.T, styles, strict=True
    ):
        joints.plot(time, 1e3 * column, **style, label=name)
        torques.plot(time, 100.0 * share, **style)
    shown = "mrad" if set(units) == {"rad"} else "mm" if set(units) == {"m"} else "mrad or mm"
    joints.set_ylabel(f"joint error [{shown}]")
    hand.plot(time, 1e3 * hand_errors[0], **OBSERVED, label="position [mm]")
    hand.plot(time, 1e3 * hand_errors[1], **PREDICTED, label="orientation [mrad]")
    hand.set_ylabel("hand error")
    hand.legend(loc="best", fontsize="small")
    hand.set_ylim(bottom=0.0)
    torques.set_ylabel("torque, share of its limit [%]")
    torques.set_xlabel("time [s]")
    if np.abs(torque_shares).max() > 0.5:
        for side in (-100.0, 100.0):
            torques.axhline(side, **BASELINE)
    figure.legend(*joints.get_legend_handles_labels(), loc="outside right upper", fontsize="small")
    return figure
