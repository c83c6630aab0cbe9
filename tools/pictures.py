"""Make the pictures of the documentation: docs/show.gif, robots.webp, panda.png, and two of
evidence.

Usage:  python tools/pictures.py [--out FOLDER] [show.gif] [robots.webp] [panda.png]
        python tools/pictures.py --recordings FILE:SIDE [FILE:SIDE ...] -- scores.png inertia.png

show.gif is the bundled recording beside its retargeting on the Panda; panda.png the figure of the
same; robots.webp the recording on three robots. It needs the extras robots and show, and a
Chromium, and takes a few minutes. The same files follow from the same versions of all these.
scores.png has the errors of all methods relative to straight lines, inertia.png those of geodesics
by their joint inertia, on the given recordings and the bundled one.
"""

from __future__ import annotations

import argparse
import textwrap
from collections.abc import Callable
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.stats import gmean

import geodesic_ocp as go
from geodesic_ocp.drawing.playback_of import playback_of
from geodesic_ocp.drawing.save_video import save_video
from geodesic_ocp.drawing.styles import new_figure

DOCS = Path(__file__).resolve().parents[1] / "docs"
HEIGHT = 1.78  # [m], of the person, as the recording states
DPI = 150.0
ROBOTS = ("panda", "armar6-left", "g1-left-arm")  # in robots.webp


def main() -> None:
    """Run the command line."""
    makers = {
        "show.gif": make_show,
        "robots.webp": make_robots,
        "panda.png": make_figure,
    }
    figures = {"scores.png": draw_scores, "inertia.png": draw_inertia}
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=DOCS, help="folder (default: docs)")
    parser.add_argument("--recordings", nargs="+", default=[], metavar="FILE:SIDE")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join([*makers, *figures]))
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in {**makers, **figures}]
    if unknown:
        parser.error(f"{unknown[0]} must be one of {', '.join([*makers, *figures])}")
    for name in options.names or makers:
        path = options.out / name
        if name in makers:
            makers[name](path)
        else:
            figure = new_figure(7.5, 3.4)
            figures[name](figure, read(options.recordings))
            figure.savefig(path, dpi=DPI)
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


MEASURES = {
    "joint_mean": "joints",
    "position_mean": "hand position",
    "rotation_angle": "orientation",
}
LINES = "straight lines"


def read(recordings: list[str]) -> list[go.trajectory.Recording]:
    """The given recordings and the bundled one."""
    sources = [*recordings, f"{files('geodesic_ocp') / 'data' / 'climb.csv'}:left"]
    parts = [text.rpartition(":") for text in sources]
    return [
        each
        for path, _, side in parts
        for each in go.recordings.read_recordings(path, "left" if side == "left" else "right")
    ]


def draw_scores(figure: Figure, recordings: list[go.trajectory.Recording]) -> None:
    """Errors of the methods relative to straight lines, a point for each recording."""
    comparison = go.studies.compare_methods(recordings)
    methods = [name for name in comparison.methods if name != LINES]
    places = np.arange(len(methods))[::-1]
    panels = figure.subplots(1, 3, sharey=True)
    for axes, (measure, label) in zip(panels, MEASURES.items(), strict=True):
        table = comparison.by_recording(measure)
        ratios = table[methods].div(table[LINES], axis=0)
        axes.plot(ratios.T.to_numpy(), places, "o", color="0.55", fillstyle="none", markersize=4.0)
        axes.plot(ratios.apply(gmean), places, "D", color="#1f3a5f", markersize=5.0)
        axes.axvline(1.0, color="0.3", linewidth=0.8, linestyle="--")
        axes.set(xscale="log", xlabel=f"error of {label}\n/ that of straight lines")
        axes.set_xticks([0.25, 0.5, 1.0, 2.0, 4.0], ["¼", "½", "1", "2", "4"])
        axes.minorticks_off()
    panels[0].set_yticks(places, [textwrap.fill(name, 24) for name in methods])


def draw_inertia(figure: Figure, recordings: list[go.trajectory.Recording]) -> None:
    """Errors of geodesics relative to straight lines by joint inertia, a line a recording."""
    default = 0.03
    shares = (default, 0.0, 0.003, 0.006, 0.012, 0.06, 0.12, 0.25, 0.5)  # the first cuts

    def metric(share: float) -> Callable[[go.Model], go.Metric]:
        def of(arm: go.Model) -> go.Metric:
            inertia = share / default * go.manifold.default_joint_inertia(arm)
            return go.KineticEnergy(arm.with_armature(inertia))

        return of

    metrics = {str(share): metric(share) for share in shares}
    comparison = go.studies.compare_methods(
        recordings, metrics | {LINES: lambda arm: go.Euclidean(arm.dof)}
    )
    panels = figure.subplots(1, 3, sharey=True)
    for axes, (measure, label) in zip(panels, MEASURES.items(), strict=True):
        table = comparison.by_recording(measure)
        ratios = table[[str(share) for share in sorted(shares)]].div(table[LINES], axis=0).T
        x = np.maximum(sorted(shares), 0.0015)
        axes.plot(x, ratios, color="0.7", linewidth=0.8)
        axes.plot(x, ratios.apply(gmean, axis=1), "o-", color="#1f3a5f", markersize=3.5)
        axes.axhline(1.0, color="0.3", linewidth=0.8, linestyle="--")
        axes.axvline(default, color="#d98c1f", linewidth=0.8, linestyle=":")
        axes.set(xscale="log", yscale="log", xlabel="joint inertia $a/(m r^2)$", title=label)
        axes.set_xticks([0.0015, 0.01, default, 0.1, 0.5], ["0", "0.01", "0.03", "0.1", "0.5"])
        axes.set_yticks([0.5, 1.0, 2.0, 4.0], ["½", "1", "2", "4"])
        axes.minorticks_off()
    panels[0].set_ylabel("error / that of straight lines")


def make_show(path: Path) -> None:
    """The person and the Panda side by side."""
    playback = playback_of(retargeted())
    scenes = tuple(replace(scene, note="") for scene in playback.scenes)
    save_video(replace(playback, scenes=scenes, title="", plots=()), path, width=800, rate=12.5)


def make_robots(path: Path) -> None:
    """The person, a Panda, an arm of ARMAR-6, and an arm of G1."""
    every = [playback_of(retargeted(robot)) for robot in ROBOTS]
    scenes = (every[0].scenes[0], *(playback.scenes[1] for playback in every))
    scenes = tuple(replace(scene, note="") for scene in scenes)
    save_video(replace(every[0], scenes=scenes, title="", plots=()), path, width=1000, rate=12.5)


def make_figure(path: Path) -> None:
    """The figure of the retargeting with the default settings."""
    go.plot(retargeted()).savefig(path, dpi=DPI)


def retargeted(robot: str = "panda") -> go.retargeting.Retargeting:
    """The bundled recording on a robot."""
    recording = str(files("geodesic_ocp") / "data" / "climb.csv")
    arm = go.human_arm("left", height=HEIGHT)
    motion = go.read_motion(recording, joints=arm.joint_names).filtered()
    analysis = go.analyse(arm, motion)
    return go.retarget(analysis, go.load_model(robot), throw=False)


if __name__ == "__main__":
    main()
