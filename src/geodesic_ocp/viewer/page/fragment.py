"""HTML that shows one playback, as a part of a document."""

from __future__ import annotations

import base64
import html
import json

from geodesic_ocp.scenes.plain_text import plain_text
from geodesic_ocp.scenes.playback import Playback, Plot
from geodesic_ocp.scenes.scene import Scene
from geodesic_ocp.viewer.page.described import described
from geodesic_ocp.viewer.plots import draw_plot


def fragment(playback: Playback) -> str:
    """HTML of panes, playback bar and plots, to be put into the body of a `document`.

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
    title, note = _escaped(scene.title), _escaped(scene.note)
    return (
        f'<figure class="playback-pane"><figcaption>{title} <span>{note}</span></figcaption>'
        f'<div class="playback-view" role="img" aria-label="{title}"></div></figure>'
    )


def _figure(plot: Plot, drawing: tuple[str, tuple[float, ...]]) -> str:
    svg, place = drawing
    source = base64.b64encode(svg.encode()).decode("ascii")
    axes = " ".join(f"{edge:.5f}" for edge in place)
    text = f"{plot.title}: {plot.label}" if plot.title else plot.label
    curves = ", ".join(curve.name for curve in plot.curves)
    return (
        f'<figure class="playback-plot" data-axes="{axes}">'
        f'<img alt="{_escaped(f"{text} of {curves}")}" draggable="false" '
        f'src="data:image/svg+xml;base64,{source}"></figure>'
    )


def _escaped(text: str) -> str:
    return html.escape(plain_text(text))
