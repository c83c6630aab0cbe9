"""A self-contained HTML document around one or more playbacks."""

from __future__ import annotations

import base64
import hashlib
import html
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path

from geodesic_ocp.scenes.plain_text import plain_text

_SCRIPTS = ("shapes.js", "drawing.js", "pane.js", "bar.js", "keys.js", "plots.js", "page.js")
# Whatever the body says, the page loads nothing from anywhere, and runs its own scripts alone.
_POLICY = (
    "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data: blob:; "
    "style-src 'unsafe-inline'; script-src"
)


def document(title: str, body: str) -> str:
    """A complete page with a stylesheet and the scripts that `fragment`s in its body need.

    Browsers run no other scripts in it, those of the body included.

    Args:
        title: of the page, as plain text; it is escaped. The body has its own heading.
        body: HTML, such as `f"<h1>{html.escape(title)}</h1>{fragment(playback)}"`.

    Raises:
        ImportError: Meshcat, whose copy of three.js draws the scenes, is not installed.
    """
    folder = files("geodesic_ocp.viewer.page")
    style = (folder / "page.css").read_text(encoding="utf-8")
    own = "\n".join((folder / "scripts" / name).read_text(encoding="utf-8") for name in _SCRIPTS)
    scripts = _library(), f'\n(function () {{\n"use strict";\n{own}}})();\n'
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


def _source(script: str) -> str:
    """A script, as a policy names it, https://www.w3.org/TR/CSP3/."""
    digest = hashlib.sha256(script.encode()).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"


def _library() -> str:
    """Meshcat's JavaScript with the licences of what it contains."""
    found = find_spec("meshcat")  # importing it would import its web server
    if found is None or found.origin is None:
        raise ImportError("the viewer needs meshcat: pip install 'geodesic_ocp[viewer]'")
    folder = Path(found.origin).parent / "viewer"
    names = ("LICENSE", "dist/main.min.js.LICENSE.txt", "dist/main.min.js")
    licence, others, script = ((folder / name).read_text(encoding="utf-8") for name in names)
    return f"\n/*!\nMeshcat\n{licence}*/\n{others}\n{script}\n"
