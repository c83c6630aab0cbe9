"""The motion that synergies predict, those of a file among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from geodesic_ocp.model.model import Model
from geodesic_ocp.scenes.actor import Role, model_actor
from geodesic_ocp.scenes.motions.joint_plots import hand_speed_plots
from geodesic_ocp.scenes.motions.model_scene import hand_trails
from geodesic_ocp.scenes.motions.of_motion import motion_playback, of_joints
from geodesic_ocp.scenes.motions.shown_samples import shown_samples
from geodesic_ocp.scenes.paths.of_path import model_of
from geodesic_ocp.scenes.playback import Playback, Span
from geodesic_ocp.synergies.synergy import SavedSynergies, Synergy
from geodesic_ocp.trajectory.motion import Motion

_PREDICTED: Role = "predicted"
_RATE = 100.0  # [Hz]


def synergies_playback(synergies: Sequence[Synergy], model: Model | None = None) -> Playback:
    """The motion that synergies predict, one after the other.

    Args:
        synergies: in the order of their times, at least one; between them the arm rests.
        model: with their joints; None: that of their metric.

    Raises:
        ValueError: none is given, and the metric has none; or it has other joints.
    """
    whole = model_of(synergies[0].path, model)
    if whole is None:
        raise ValueError("synergies are shown with their model: give it after them")
    starts = [synergy.start_time for synergy in synergies]
    spans = tuple((each.start_time, each.start_time + each.duration) for each in synergies)
    count = max(2, 1 + round((spans[-1][1] - starts[0]) * _RATE))
    time = np.linspace(starts[0], spans[-1][1], count)
    owner = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(starts) - 1)
    q = np.empty((count, whole.dof))
    for number, (synergy, span) in enumerate(zip(synergies, spans, strict=True)):
        own = owner == number
        q[own] = synergy(time[own].clip(*span))
    saved = SavedSynergies(Motion(time, q, whole.joint_names), spans, whole.name)
    return saved_synergies_playback(saved, whole)


def saved_synergies_playback(
    saved: SavedSynergies, model: Model, observed: Motion | None = None, *, title: str = ""
) -> Playback:
    """The motion that synergies predict, as an overlay of the observed one if that is given.

    Args:
        saved: from a file.
        model: with their joints.
        observed: the motion from which they are, with velocities.
        title: of the playback; the model's name by default.

    Raises:
        ValueError: the synergies, or the motion, lack joints of the model.
    """
    spans = tuple(
        Span(str(number), *span, f"synergy {number} ({span[1] - span[0]:.2f} s)")
        for number, span in enumerate(saved.spans, 1)
    )
    predicted = replace(saved.motion, velocity=saved.motion(saved.motion.time, 1))
    if observed is None:
        whole = motion_playback(predicted, model, title=title, note="as the synergies predict")
        trails = tuple(replace(trail, role=_PREDICTED) for trail in whole.scenes[0].trails)
        plots = tuple(
            replace(
                plot,
                curves=tuple(
                    replace(curve, role=_PREDICTED if curve.role else None) for curve in plot.curves
                ),
            )
            for plot in whole.plots
        )
        scenes = (replace(whole.scenes[0], trails=trails),)
        return replace(whole, scenes=scenes, plots=plots, spans={"synergies": spans})
    chosen = of_joints(observed, model)
    whole = motion_playback(chosen, model, title=title)
    shown, _ = shown_samples(chosen.time)
    q = of_joints(predicted, model)(chosen.time[shown].clip(*predicted.time[[0, -1]]))
    scene = whole.scenes[0]
    own, *rest = scene.actors
    overlay = model_actor(
        model, q, name=_PREDICTED, role=_PREDICTED, translucent=True, layer=_PREDICTED
    )
    scene = replace(
        scene,
        actors=(replace(own, name="observed", role="observed"), overlay, *rest),
        trails=(*scene.trails, *hand_trails(model, q, _PREDICTED, name=_PREDICTED)),
    )
    both: dict[str, tuple[Motion, Role]] = {
        "observed": (chosen, "observed"),
        _PREDICTED: (of_joints(predicted, model), _PREDICTED),
    }
    plots = tuple(plot for plot in whole.plots if not plot.label.startswith("hand speed"))
    return replace(
        whole,
        scenes=(scene,),
        spans={"synergies": spans},
        plots=(*plots, *hand_speed_plots(model, both)),
    )
