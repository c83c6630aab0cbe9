"""Figures of a fit: the least error as a function of one parameter."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from geodesic_ocp.drawing.styles import OBSERVED, new_figure
from geodesic_ocp.fitting.error_profile import ErrorProfile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw_profile(axes: Axes, profile: ErrorProfile) -> None:
    """Draw the curves of the recordings and of their mean."""
    label = profile.recordings[0]
    if len(profile.recordings) > 1:
        single, *_ = axes.plot(profile.values, profile.errors, color="0.65", linewidth=1.0)
        single.set_label("single recordings")
        label = "all"
    axes.plot(profile.values, profile.mean, **OBSERVED, marker="o", markersize=4, label=label)
    label = f"estimate {profile.estimate:.3g}"
    axes.axvline(profile.estimate, color="0.2", linestyle=":", linewidth=1.3, label=label)
    axes.set_xscale("log")
    units = {"m r^2": " [$m r^2$]", "kg m^2": " [kg m$^2$]", "": ""}
    name = profile.name.replace("joint_inertia", "joint inertia")
    axes.set_xlabel(name + units.get(profile.unit, f" [{profile.unit}]"))
    axes.set_ylabel(f"rms error [{profile.error_unit}]")
    axes.legend()


def profiles_figure(profiles: Sequence[ErrorProfile]) -> Figure:
    """Draw profiles side by side."""
    figure = new_figure(6.5 * len(profiles), 4.2)
    for axes, profile in zip(np.ravel(figure.subplots(1, len(profiles))), profiles, strict=True):
        draw_profile(axes, profile)
    return figure
