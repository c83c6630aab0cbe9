"""A model alone, to be looked at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.manifold.metrics import KineticEnergy
from geodesic_ocp.model.model import Model
from geodesic_ocp.scenes.motions.model_scene import model_scene
from geodesic_ocp.scenes.motions.of_motion import viewed_from
from geodesic_ocp.scenes.playback import Playback, Span

_HELD = 0.98  # of a second, for which each of several configurations is shown


def model_playback(model: Model, q: ArrayLike | None = None, *, title: str = "") -> Playback:
    """A model in one configuration, or in several, one a second, with the frames of its joints.

    Args:
        model: that is shown.
        q: a configuration (n,) or several (k, n) [rad or m]; by default each joint at zero, or at
            the limit that is nearest to zero.
        title: of the playback; the model's name by default.

    Raises:
        ValueError: q has another shape, is not finite, or seems to be in degrees.
    """
    given = np.clip(0.0, model.lower, model.upper) if q is None else np.array(q, dtype=float)
    rows = np.atleast_2d(given)
    if rows.ndim != 2 or rows.shape[1] != model.dof or not len(rows) or given.ndim == 0:
        raise ValueError(
            f"q must have shape ({model.dof},) or (k, {model.dof}) for {model.name}, got "
            f"{given.shape}"
        )
    if not np.all(np.isfinite(rows)):
        raise ValueError(f"q must be finite, got {given}")
    for row in rows:
        KineticEnergy(model).check_units("q", row)
    time, configurations, spans, note = np.zeros(1), rows, {}, ""
    if len(rows) > 1:
        # Each one is held: what lies between two of them is not known.
        starts = np.arange(len(rows), dtype=float)
        time = np.column_stack([starts, starts + _HELD]).reshape(-1)
        configurations = np.repeat(rows, 2, axis=0)
        each = (Span(str(k + 1), float(k), k + 1.0) for k in range(len(rows) - 1))
        last = Span(str(len(rows)), float(starts[-1]), float(time[-1]))
        spans = {"configurations": (*each, last)}
        note = f"{len(rows)} configurations, one a second"
    scene = model_scene(model, time, configurations, title=title, note=note, joints=True)
    scene = replace(scene, trails=())
    return Playback(scene.title, (scene,), spans, azimuth=viewed_from(model))
