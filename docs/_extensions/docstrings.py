r"""Docstrings are plain text, not reStructuredText: |v|_G is a norm and q' a derivative.

Characters that reStructuredText takes for markup are escaped, outside `code` and examples.
"""

from __future__ import annotations

import re

from sphinx.application import Sphinx

_CODE = re.compile(r"(`[^`]*`)")
_MARKUP = re.compile(r"([\\|*]|_\b|(?<=\w)_(?!\w))")


def plain(lines: list[str]) -> list[str]:
    """The lines with markup characters escaped."""
    result, in_example = [], False
    for line in lines:
        in_example = line.lstrip().startswith(">>>") or (in_example and bool(line.strip()))
        parts = [line] if in_example else _CODE.split(line)
        result.append(
            "".join(
                part if in_example or part.startswith("`") else _MARKUP.sub(r"\\\1", part)
                for part in parts
            )
        )
    return result


def _process(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    del app, name, obj, options
    lines[:] = plain(lines)
    if what in ("attribute", "data", "property"):
        # Napoleon reads a first line with a colon as "type: description": begin with a comment.
        lines[:0] = ["..", ""]


def setup(app: Sphinx) -> dict[str, bool]:
    """Escape before napoleon reads the sections."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", _process, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
