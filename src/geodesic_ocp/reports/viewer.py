"""Animated 3D scenes of moving arms, side by side on a self-contained HTML page."""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, as_rotation, as_vector
from geodesic_ocp.model.geometry.meshes import Mesh, meshes
from geodesic_ocp.model.model import Model

RATE = 25.0  # [frames / s], at most
HAND, TARGET = "#1b3a5c", "#e07b00"  # distinguishable also with colour blindness

_STYLE = """
.viewer-scenes { display: flex; flex-wrap: wrap; gap: 0.8rem; }
.viewer-scenes figure { flex: 1 1 17rem; margin: 0; min-width: 0; }
.viewer-scenes figcaption { font-weight: 600; margin-bottom: 0.3rem; }
.viewer-scenes figcaption span { color: #555; font-weight: 400; }
.viewer-scenes canvas { aspect-ratio: 1 / 1; border: 1px solid #d5dae0; border-radius: 4px;
  cursor: grab; display: block; touch-action: pan-y; width: 100%; }
.viewer-bar { align-items: center; display: flex; gap: 0.8rem; margin: 0.6rem 0 0.3rem; }
.viewer-bar button { font: inherit; min-width: 4.6rem; padding: 0.2rem 0.6rem; }
.viewer-bar input { flex: 1; }
.viewer-bar output { font-variant-numeric: tabular-nums; min-width: 4.5rem; text-align: right; }
.viewer-legend { color: #444; font-size: 0.88rem; margin: 0.2rem 0 0; }
.viewer-legend i { border-top: 3px solid; display: inline-block; margin: 0 0.3rem 0.22rem 0;
  width: 1.8rem; }
.viewer-legend b { font-weight: inherit; margin-right: 1.2rem; white-space: nowrap; }
.viewer [hidden] { display: none !important; }
@media print { .viewer-bar, .viewer-legend span { display: none; }
  .viewer figure { break-inside: avoid; } }
""".strip()

_PAGE = """
:root { color-scheme: light; }
body { background: #fff; color: #1c1f23; font: 16px/1.5 system-ui, -apple-system, "Segoe UI",
  Roboto, "Helvetica Neue", Arial, sans-serif; margin: 2rem auto; max-width: 72rem;
  padding: 0 1.2rem; }
h1, h2, h3 { line-height: 1.25; margin: 1.6em 0 0.5em; }
h1 { margin-top: 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: 0.8rem 0; }
th, td { border-bottom: 1px solid #d5dae0; padding: 0.25rem 0.8rem 0.25rem 0; text-align: left; }
th { border-bottom-color: #1c1f23; }
img, svg { height: auto; max-width: 100%; }
pre, code { font-family: ui-monospace, Menlo, Consolas, monospace; font-size: 0.9em; }
pre { overflow-x: auto; }
@media print { body { font-size: 10.5pt; margin: 0; max-width: none; padding: 0; }
  h1, h2, h3 { break-after: avoid; } table, figure, img, svg { break-inside: avoid; } }
""".strip()


@dataclass(frozen=True, eq=False, repr=False)
class Actor:
    """A model that moves in a scene, whose x axis points right, y forward and z up.

    Attributes:
        title: shown above the scene.
        model: drawn with its meshes, see `meshes`.
        q: configurations (k, n) [rad or m], at the viewer's times.
        rotation, position: of the model's base in the scene, (3, 3) and (3,) [m].
        trail: positions (m, 3) [m] of the hand in the scene, drawn as a line; None: those of the
            model's hand.
        target: positions (m, 3) [m] of the hand's target path in the scene, if any.
        hidden: links that are not drawn.

    If a trail or a target has k positions, a dot marks the one at the current time.

    Raises:
        ValueError: wrong shapes, or numbers that are not finite.
    """

    title: str
    model: Model
    q: Array
    rotation: Array = field(default_factory=lambda: np.eye(3))
    position: Array = field(default_factory=lambda: np.zeros(3))
    trail: Array | None = None
    target: Array | None = None
    hidden: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        object.__setattr__(self, "q", _rows("q", self.q, self.model.dof))
        object.__setattr__(self, "rotation", as_rotation("rotation", self.rotation))
        object.__setattr__(self, "position", as_vector("position", self.position, 3))
        trail = self.trail
        if trail is None:
            trail = self.model.hand_pose(self.q)[1] @ self.rotation.T + self.position
        object.__setattr__(self, "trail", _rows("trail", trail, 3))
        if self.target is not None:
            object.__setattr__(self, "target", _rows("target", self.target, 3))

    def __repr__(self) -> str:
        return f"Actor({self.title!r}, {self.model!r}, {len(self.q)} configurations)"

    def poses(self, link: str, q: Array) -> Array:
        """Axes and position of a link in the scene at configurations (k, n): (k, 4, 3)."""
        rotations, positions = self.model.frame_pose(link, q)
        axes = (self.rotation @ rotations).transpose(0, 2, 1)
        positions = positions @ self.rotation.T + self.position
        return np.asarray(np.concatenate([axes, positions[:, None]], axis=1))


def viewer(
    time: ArrayLike,
    scenes: Sequence[tuple[str, Sequence[Actor]]],
    *,
    view: tuple[float, float] = (50.0, 22.0),
    target: str = "target",
) -> str:
    """HTML of scenes side by side, with one play button and one slider for all of them.

    The HTML contains its data and its script, and may appear on a page several times. All scenes
    have the same scale; the initial view shows everything that moves; the mouse rotates and zooms
    all scenes together. At most 25 samples per second are shown.

    Args:
        time: (k,) [s], increasing.
        scenes: titles and actors.
        view: initial azimuth and elevation of the camera [deg]; at azimuth 0 it faces the models,
            positive angles are to their right.
        target: name of the actors' targets in the legend.

    Raises:
        ValueError: wrong shapes, or a time that does not increase.
    """
    clock = np.array(time, dtype=float)
    if clock.ndim != 1 or not len(clock) or not np.isfinite(clock).all():
        raise ValueError(f"time must be finite, of shape (k,), got {clock.shape}")
    if np.any(np.diff(clock) <= 0.0):
        raise ValueError("time must increase")
    for _, actors in scenes:
        for actor in actors:
            if len(actor.q) != len(clock):
                raise ValueError(f"{actor.title}: q has {len(actor.q)} rows, time {len(clock)}")
    frames = _frames(clock)
    everyone = [actor for _, actors in scenes for actor in actors]
    models = list({id(actor.model): actor.model for actor in everyone}.values())
    bodies = [meshes(model) for model in models]
    numbers = {id(model): number for number, model in enumerate(models)}
    data = {
        "time": _packed(clock[frames], "<f8"),
        "view": [float(angle) for angle in view],
        "bodies": [[_part(mesh) for mesh in body] for body in bodies],
        "scenes": [
            _scene(actors, [numbers[id(actor.model)] for actor in actors], bodies, frames)
            for _, actors in scenes
        ],
    }
    figures = "\n".join(_figure(title, actors) for title, actors in scenes)
    legend = f'<b><i style="border-color: {HAND}"></i>path of the hand</b>'
    if any(actor.target is not None for actor in everyone):
        line = f"border-color: {TARGET}; border-top-style: dashed"
        legend += f'<b><i style="{line}"></i>{html.escape(target)}</b>'
    start, end = (repr(float(value)) for value in clock[[0, -1]])
    script = (files("geodesic_ocp") / "data" / "viewer.js").read_text(encoding="utf-8")
    return f"""<div class="viewer">
<style>{_STYLE}</style>
<div class="viewer-scenes">
{figures}
</div>
<div class="viewer-bar"><button type="button">Play</button>
<input type="range" min="{start}" max="{end}" step="any" value="{start}" aria-label="time in s">
<output>{clock[0]:.2f} s</output></div>
<p class="viewer-legend">{legend}<span>Drag to rotate, wheel to zoom, double-click to reset.
All scenes have one scale; squares of the floor are 0.25 m wide.</span></p>
<p class="viewer-missing" hidden>The animation needs WebGL, which this browser does not support
or has disabled.</p>
<noscript>The animation needs JavaScript, which is disabled here.</noscript>
<script type="application/json">{_json(data)}</script>
<script>{script}</script>
</div>"""


def page(title: str, body: str) -> str:
    """A complete HTML document with a stylesheet around the given body; nothing is downloaded."""
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{html.escape(title)}</title>
<style>{_PAGE}</style>
</head>
<body>
{body}
</body>
</html>
"""


def _rows(name: str, value: Any, columns: int) -> Array:
    array = np.array(value, dtype=float)
    if array.ndim != 2 or array.shape[1] != columns or not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, of shape (k, {columns}), got {array.shape}")
    return array


def _frames(time: Array) -> list[int]:
    """Indices of samples at a rate close to `RATE`, including the first and the last."""
    count = int(np.floor((time[-1] - time[0]) * RATE + 1e-9)) + 1
    ideal = np.linspace(time[0], time[-1], count) if count > 1 else time[[0, -1]]
    after = np.clip(np.searchsorted(time, ideal), 1, max(1, len(time) - 1))
    if len(time) == 1:
        return [0]
    nearer = ideal - time[after - 1] < time[after] - ideal
    return sorted({int(index) for index in after - nearer})


def _figure(title: str, actors: Sequence[Actor]) -> str:
    names = dict.fromkeys(actor.title for actor in actors if actor.title not in ("", title))
    note = f" <span>{html.escape(', '.join(names))}</span>" if names else ""
    label = html.escape(title)
    return (
        f"<figure><figcaption>{label}{note}</figcaption>"
        f'<canvas role="img" aria-label="{label}"></canvas></figure>'
    )


def _scene(
    actors: Sequence[Actor],
    numbers: Sequence[int],
    bodies: Sequence[Sequence[Mesh]],
    frames: Sequence[int],
) -> dict[str, Any]:
    """Actors of a scene, points that bound everything that moves, and the height of the floor."""
    described: list[dict[str, Any]] = []
    moving: list[Array] = []
    still: list[Array] = []
    for actor, number in zip(actors, numbers, strict=True):
        poses = {}
        for mesh in bodies[number]:
            if mesh.link in actor.hidden:
                continue
            moves = actor.model.moves(mesh.link)
            if mesh.link not in poses:
                # One pose is enough for a link that does not move.
                poses[mesh.link] = actor.poses(mesh.link, actor.q[frames if moves else frames[:1]])
            box = np.array([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
            corners = np.array(np.meshgrid(*box.T)).reshape(3, -1).T
            axes, positions = poses[mesh.link][:, :3], poses[mesh.link][:, 3:]
            (moving if moves else still).append((corners @ axes + positions).reshape(-1, 3))
        lines = {"hand": actor.trail, "target": actor.target}
        drawn = {kind: line for kind, line in lines.items() if line is not None and len(line)}
        moving += drawn.values()
        dots = {kind: line[frames] for kind, line in drawn.items() if len(line) == len(actor.q)}
        described.append(
            {
                "body": number,
                "poses": {link: _packed(pose) for link, pose in poses.items()},
                "lines": {kind: _packed(line) for kind, line in drawn.items()},
                "dots": {kind: _packed(line) for kind, line in dots.items()},
            }
        )
    points = np.concatenate(moving or still or [np.zeros((1, 3))])
    floor = min(float(each[:, 2].min()) for each in (points, *still))
    return {"actors": described, "extremes": _packed(_extremes(points)), "floor": floor}


def _extremes(points: Array) -> Array:
    """The points among (k, 3) that are extreme in one of many directions."""
    azimuths = np.linspace(0.0, 2.0 * np.pi, 16, endpoint=False)
    elevations = np.linspace(-np.pi / 2.0, np.pi / 2.0, 9)
    azimuth, elevation = (each.reshape(-1) for each in np.meshgrid(azimuths, elevations))
    level = np.cos(elevation)
    directions = np.array([np.cos(azimuth) * level, np.sin(azimuth) * level, np.sin(elevation)])
    farthest = {int(np.argmax(points @ direction)) for direction in directions.T}
    return points[sorted(farthest)]


def _part(mesh: Mesh) -> dict[str, Any]:
    bits = 16 if len(mesh.vertices) <= 2**16 else 32
    return {
        "link": mesh.link,
        "colour": [round(component, 4) for component in mesh.colour],
        "vertices": _packed(mesh.vertices),
        "triangles": _packed(mesh.triangles, f"<u{bits // 8}"),
        "bits": bits,
    }


def _packed(values: Any, kind: str = "<f4") -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype=kind).tobytes()).decode("ascii")


def _json(data: Any) -> str:
    """JSON without "<", so that it cannot close its script element."""
    return json.dumps(data, separators=(",", ":")).replace("<", "\\u003c")
