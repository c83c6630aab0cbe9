"""A self-contained HTML document around one or more playbacks."""

from __future__ import annotations


def document(title: str, body: str) -> str:
    """A complete page with a stylesheet and the scripts that `fragment`s in its body need.

    Args:
        title: of the page, as plain text; it is escaped. The body has its own heading.
        body: HTML, such as `f"<h1>{html.escape(title)}</h1>{fragment(playback)}"`.

    Raises:
        ImportError: Meshcat, whose copy of three.js draws the scenes, is not installed.
    """
    raise NotImplementedError
