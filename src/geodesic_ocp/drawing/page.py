"""A self-contained HTML document around one or more playbacks."""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from geodesic_ocp.arrays import Array
from geodesic_ocp.drawing.actors import Actor
from geodesic_ocp.drawing.camera import first_view
from geodesic_ocp.drawing.look import Mesh
from geodesic_ocp.drawing.plots import curve_styles, draw_plot
from geodesic_ocp.drawing.scene import PARAMETER, Playback, Plot, Scene, Trail, plain_text
from geodesic_ocp.drawing.styles import NEUTRAL, ROLES, SURROUNDINGS, mixed

_SCRIPTS = ("shapes.js", "drawing.js", "pane.js", "bar.js", "keys.js", "plots.js", "page.js")
# Whatever the body says, the page loads nothing from anywhere, and runs its own scripts alone.
_POLICY = (
    "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data: blob:; "
    "style-src 'unsafe-inline'; script-src"
)


def document(title: str, body: str) -> str:
    """Return a complete page with a stylesheet and the scripts that `fragment`s in its body need.

    Browsers run no other scripts in it, those of the body included.

    Args:
        title: title of the page, as plain text; it is escaped. The body has its own heading.
        body: HTML, such as `f"<h1>{html.escape(title)}</h1>{fragment(playback)}"`.
    """
    style, licence, three = map(web_file, ("page.css", "LICENSE.three", "three.min.js"))
    own = "\n".join(web_file(f"scripts/{name}") for name in _SCRIPTS)
    scripts = f"\n/*!\n{licence}*/\n{three}", f'\n(function () {{\n"use strict";\n{own}}})();\n'
    policy = " ".join([_POLICY, *map(_source, scripts)])
    programs = "\n".join(f"<script>{script}</script>" for script in scripts)
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>{html.escape(plain_text(title))}</title>
<style>
{style}</style>
</head>
<body>
{body}
{programs}
</body>
</html>
"""


def page(playback: Playback) -> str:
    """Return a self-contained page of a playback, under its title if no pane says the same."""
    title = plain_text(playback.title)
    only = plain_text(playback.scenes[0].title) if len(playback.scenes) == 1 else ""
    heading = f"<h1>{html.escape(title)}</h1>\n" if title not in ("", only) else ""
    return document(title, heading + fragment(playback))


def _source(script: str) -> str:
    """Return a script, as a policy names it, https://www.w3.org/TR/CSP3/."""
    digest = hashlib.sha256(script.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def web_file(name: str) -> str:
    """Return the text of a file of the folder web."""
    return (files("geodesic_ocp.drawing") / "web" / name).read_text(encoding="utf-8")


_STEPS = 32767  # on either side of the middle, in 16 bits
_UNKNOWN = -32768


def packed(values: ArrayLike) -> dict[str, Any]:
    """Return columns of (..., n) numbers, each in 65535 steps between its extremes; NaN stays NaN.

    A motion within 2 m is stored to 0.02 mm.
    """
    array = np.asarray(values, dtype=float)
    rows = array.reshape(-1, array.shape[-1])
    known = np.isfinite(rows)
    # Columns without a known number are all zero.
    least = np.where(known, rows, np.inf).min(axis=0, initial=np.inf)
    most = np.where(known, rows, -np.inf).max(axis=0, initial=-np.inf)
    least, most = (np.where(np.isfinite(extreme), extreme, 0.0) for extreme in (least, most))
    middle = (least + most) / 2.0
    step = (most - least) / (2.0 * _STEPS)
    scaled = np.rint((np.where(known, rows, middle) - middle) / np.where(step > 0.0, step, 1.0))
    codes = np.where(known, scaled, _UNKNOWN).astype("<i2")
    return {"middle": middle.tolist(), "step": step.tolist(), "data": encoded(codes)}


def encoded(array: NDArray[Any]) -> str:
    """Return the bytes of an array in base64."""
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")


_CREASE = np.deg2rad(35.0)  # [rad]: edges between faces that differ by more stay sharp
_TINT = 0.12  # of white in the colours of bodies, so that dark ones keep their shading
_FINEST = 0.004  # [m] between points of a drawn trail, and their number
_FEWEST = 8  # [m] between points of a drawn trail, and their number
_MOST = 900  # [m] between points of a drawn trail, and their number

Shapes = dict[tuple[bytes, bytes], int]  # numbers of the meshes that were met so far


def described(playback: Playback) -> dict[str, Any]:
    """Return everything that is drawn in three dimensions, the spans, and the curves of the plots;
    see scripts/page.js.
    """
    shapes: Shapes = {}
    bodies: list[dict[str, Any]] = []
    times: list[dict[str, Any]] = []
    scenes = [_scene(scene, shapes, bodies) for scene in playback.scenes]
    plots = [_curves(plot, times) for plot in playback.plots]
    data = {
        "range": playback.range,
        "parameter": playback.time_label == PARAMETER,
        "axes": first_view(playback.azimuth, playback.elevation).axes.tolist(),
        "layers": [[layer, layer not in playback.hidden] for layer in playback.layers],
        "spans": [
            [name, [[span.name, span.start, span.stop, span.text, span.cut] for span in spans]]
            for name, spans in playback.spans.items()
        ],
        "roles": {role: _look(role, style) for role, style in ROLES.items()},
        "colours": SURROUNDINGS,
        "bodies": bodies,
        "scenes": scenes,
        "times": times,
        "plots": plots,
    }
    return {name: _plain(value) for name, value in data.items()}


def _plain(data: Any) -> Any:
    """Return the same with all texts, most of which are names from files, as `plain_text`."""
    if isinstance(data, str):
        return plain_text(data)
    if isinstance(data, dict):
        return {name: _plain(value) for name, value in data.items()}
    return [_plain(value) for value in data] if isinstance(data, list | tuple) else data


def _curves(plot: Plot, times: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the curves of a plot; several have the same times, which are listed once."""
    found = []
    for curve, look in zip(plot.curves, curve_styles(plot), strict=True):
        if (time := packed(curve.time[:, None])) not in times:
            times.append(time)
        values = packed(np.asarray(curve.values)[:, None])
        mark = {"colour": look["color"], "dash": _dash(look), "layer": curve.layer}
        found.append({**mark, "time": times.index(time), "values": values})
    return found


def _dash(style: Mapping[str, Any]) -> Any:
    """Return lengths of dash and gap in widths of the line; None for a solid line."""
    line = style.get("linestyle", "-")
    return None if line == "-" else line[1]


def _look(role: str, style: Mapping[str, Any]) -> dict[str, Any]:
    """Return colours of lines and bodies, and lengths of dash and gap in widths of the line."""
    body = [round(each, 4) for each in mixed(style["color"], _TINT)]
    return {"colour": style["color"], "body": body, "dash": _dash(style)}


def _scene(scene: Scene, shapes: Shapes, bodies: list[dict[str, Any]]) -> dict[str, Any]:
    def listed(items: Iterable[Any], describe: Callable[[Any], dict[str, Any]]) -> list[Any]:
        return [{"name": each.name, "layer": each.layer, **describe(each)} for each in items]

    return {
        "time": encoded(np.asarray(scene.time, dtype="<f8")),
        "extremes": packed(replace(scene, ellipsoids=()).points()),  # hidden at first
        "actors": listed(scene.actors, lambda each: _actor(each, shapes, bodies)),
        "trails": listed(scene.trails, _trail),
        "solids": listed(
            scene.solids,
            lambda each: {
                "unbounded": each.unbounded,
                "body": _body(each.vertices, each.triangles, shapes, bodies),
            },
        ),
        "frames": listed(scene.frames, lambda each: _poses(each.rotations, each.positions)),
        "ellipsoids": listed(
            scene.ellipsoids,
            lambda each: {
                "positions": packed(each.centres),
                "axes": packed(each.axes.transpose(0, 2, 1).reshape(-1, 9)),
            },
        ),
        "gaps": listed(
            scene.gaps,
            lambda each: {
                "ends": packed(np.concatenate([each.starts, each.ends], axis=1)),
                "distances": packed(each.distances[:, None]),
            },
        ),
        "clouds": listed(
            scene.clouds,
            lambda each: {
                **{"labels": each.labels, "role": each.role},
                "positions": packed(each.positions.reshape(len(each.positions), -1)),
            },
        ),
    }


def _actor(actor: Actor, shapes: Shapes, bodies: list[dict[str, Any]]) -> dict[str, Any]:
    def part(mesh: Mesh) -> dict[str, Any]:
        body = _body(mesh.vertices, mesh.triangles, shapes, bodies)
        return {"body": body, "colour": [round(float(each), 4) for each in mesh.colour]}

    links = {
        link: {
            "name": link,
            **_poses(actor.rotations[link], actor.positions[link]),
            "parts": [part(mesh) for mesh in actor.meshes if mesh.link == link],
        }
        for link in dict.fromkeys(mesh.link for mesh in actor.meshes)
    }
    return {"role": actor.role, "translucent": actor.translucent, "links": list(links.values())}


def _body(vertices: Array, triangles: Any, shapes: Shapes, bodies: list[dict[str, Any]]) -> int:
    """Return number of a body, which is stored once however often it is shown.

    Its faces share vertices where it looks smooth.
    """
    corners = np.asarray(triangles, dtype=np.int64)
    key = (np.asarray(vertices, dtype=float).tobytes(), corners.tobytes())
    if key not in shapes:
        shapes[key] = len(bodies)
        points, faces = _creased(np.asarray(vertices), np.asarray(triangles))
        corners = np.ascontiguousarray(faces, dtype="<u4" if len(points) > 2**16 else "<u2")
        bodies.append(
            {
                "vertices": packed(points),
                "triangles": encoded(corners),
                "bits": 8 * corners.itemsize,
            }
        )
    return shapes[key]


def _creased(vertices: Array, triangles: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices and triangles of a surface that is smooth between its edges."""
    import trimesh

    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    smooth = trimesh.graph.smooth_shade(mesh, angle=_CREASE, facet_minarea=None)
    return np.array(smooth.vertices, dtype=float), np.array(smooth.faces, dtype=np.int64)


def _poses(rotations: Array, positions: Array) -> dict[str, Any]:
    """Return positions, and unit quaternions (x, y, z, w) whose signs do not jump."""
    turns = Rotation.from_matrix(rotations).as_quat()
    flips = np.where(np.sum(turns[1:] * turns[:-1], axis=1) < 0.0, -1.0, 1.0)
    turns[1:] *= np.cumprod(flips)[:, None]
    return {"positions": packed(positions), "turns": packed(turns)}


def _trail(trail: Trail) -> dict[str, Any]:
    return {
        "role": trail.role,
        "points": packed(_even(trail.points)),
        "dot": None if trail.dot is None else packed(trail.dot),
    }


def _even(points: Array) -> Array:
    """Return points at even distances along a line, which rests and detours do not crowd."""
    known = points[np.isfinite(points).all(axis=1)]
    if len(known) < 2:
        return known
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(known, axis=0), axis=1)))
    count = int(np.clip(length[-1] / _FINEST, _FEWEST, _MOST))
    at = np.linspace(0.0, length[-1], count)
    return np.column_stack([np.interp(at, length, column) for column in known.T])


def fragment(playback: Playback) -> str:
    """Return HTML of panes, playback bar and plots, to be put into the body of a `document`.

    It may stand there several times, among other HTML; it has no heading of its own.
    """
    first, *_ = *playback.spans.values(), ()
    panes = "\n".join(_pane(scene) for scene in playback.scenes)
    plots = "\n".join(
        _figure(plot, draw_plot(plot, playback.range, playback.time_label, first))
        for plot in playback.plots
    )
    # Without "<", nothing in the data can close its script element.
    data = json.dumps(described(playback), separators=(",", ":")).replace("<", "\\u003c")
    return f"""<section class="playback" aria-label="{_escaped(playback.title)}">
<noscript><style>.playback-panes {{ display: none; }}</style>
<p class="playback-missing">The three-dimensional view needs JavaScript, which is
disabled here.</p></noscript>
<p class="playback-missing playback-no-webgl" hidden>The three-dimensional view needs WebGL, which
this browser does not support or has disabled.</p>
<div class="playback-panes">
{panes}
</div>
<div class="playback-plots">
{plots}
</div>
<script type="application/json">{data}</script>
</section>"""


def _pane(scene: Scene) -> str:
    title = _escaped(scene.title)
    note = _escaped(scene.note)
    return (
        f'<figure class="playback-pane"><figcaption>{title} <span>{note}</span></figcaption>'
        f'<div class="playback-view" role="img" aria-label="{title}"></div></figure>'
    )


def _figure(plot: Plot, drawing: tuple[str, tuple[float, ...]]) -> str:
    """Return a plot with its legend, in which the page writes the values at the cursor."""
    svg, place = drawing
    source = base64.b64encode(svg.encode()).decode("ascii")
    axes = " ".join(f"{edge:.7g}" for edge in place)
    text = f"{plot.title}: {plot.label}" if plot.title else plot.label
    curves = ", ".join(curve.name for curve in plot.curves)
    entries = [
        (curve.name, look, bool(curve.layer))
        for curve, look in zip(plot.curves, curve_styles(plot), strict=True)
    ]
    if plot.marks and plot.marked:
        entries.append((plot.marked, NEUTRAL, False))
    legend = "".join(_entry(*each) for each in entries)
    return (
        f'<figure class="playback-plot" data-axes="{axes}">'
        f'<div><img alt="{_escaped(f"{text} of {curves}")}" draggable="false" '
        f'src="data:image/svg+xml;base64,{source}"></div>'
        f"<figcaption>{legend}</figcaption></figure>"
    )


def _entry(name: str, style: Mapping[str, Any], hidden: bool) -> str:
    """Return a name in a legend, after a piece of its line."""
    dash = " ".join(f"{2 * each:g}" for each in _dash(style) or ())
    return (
        f"<span{' hidden' * hidden}>"
        f'<svg viewBox="0 0 26 4"><path d="M0 2h26" stroke="{style["color"]}" stroke-width="2" '
        f'stroke-dasharray="{dash}"/></svg>{_escaped(name)} <b></b></span>'
    )


def _escaped(text: str) -> str:
    return html.escape(plain_text(text))
