"""Make the animations and the figure of the documentation: docs/show.gif, reach.gif, panda.png.

Usage:  python tools/pictures.py [--out FOLDER] [show.gif] [reach.gif] [panda.png]

show.gif is the bundled recording beside its retargeting on the Panda, in which poses may be missed
by up to 4 cm or 0.04 rad where attaining them takes a detour; panda.png the figure of the same with
the default settings; reach.gif the reach past a lamp of the README. It needs the extras robots and
viewer, and takes about a minute. The same files follow from the same versions of the packages.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import geodesic_ocp as go
from geodesic_ocp.scenes.playback_of import playback_of
from geodesic_ocp.viewer.save_video import save_video

DOCS = Path(__file__).resolve().parents[1] / "docs"
NEAR_MISSES = 0.04  # [m and rad]
HEIGHT = 1.78  # [m], of the person, as the recording states
DPI = 150.0


def main() -> None:
    """Run the command line."""
    makers = {"show.gif": make_show, "reach.gif": make_reach, "panda.png": make_figure}
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--out", type=Path, default=DOCS, help="folder (default: docs)")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(makers))
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in makers]
    if unknown:
        parser.error(f"{unknown[0]} must be one of {', '.join(makers)}")
    for name in options.names or makers:
        path = options.out / name
        makers[name](path)
        print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")


def make_show(path: Path) -> None:
    """The person and the Panda side by side."""
    playback = playback_of(retargeted(near_misses=NEAR_MISSES))
    scenes = tuple(replace(scene, note="") for scene in playback.scenes)
    save_video(replace(playback, scenes=scenes, title="", plots=()), path, width=800, rate=12.5)


def make_reach(path: Path) -> None:
    """A reach past a lamp."""
    arm = go.human_arm(side="right", height=1.75, mass=70.0)
    start = [0.3, 0.1, -0.4, 0.9, 0.1, 0.0, 0.1]  # [rad]
    lamp = go.Ball(centre=(0.20, 0.35, -0.15), radius=0.06, name="lamp")  # [m], from the shoulder
    reach = go.Reach(arm, start, position=(0.10, 0.45, 0.10), obstacles=(lamp,))
    playback = playback_of(go.solve(reach, tolerance=1e-6))
    plots = tuple(plot for plot in playback.plots if not plot.label.startswith("speed"))
    save_video(replace(playback, title="", plots=plots), path, width=800, rate=15.0, speed=1.6)


def make_figure(path: Path) -> None:
    """The figure of the retargeting with the default settings."""
    retargeted().plot().savefig(path, dpi=DPI)


def retargeted(near_misses: float = 0.0) -> go.retargeting.Retargeting:
    """The bundled recording on the Panda."""
    recording = str(files("geodesic_ocp") / "data" / "climb.csv")
    arm = go.human_arm("left", height=HEIGHT)
    motion = go.read_motion(recording, joints=arm.joint_names).filtered()
    analysis = go.analyse(arm, motion)
    settings = go.RetargetingSettings(near_misses=near_misses)
    return go.retarget(analysis, go.load_model("panda"), settings=settings)


if __name__ == "__main__":
    main()
