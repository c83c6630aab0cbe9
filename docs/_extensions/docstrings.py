r"""Docstrings are plain text, not reStructuredText: |v|_G is a norm and q' a derivative.

Characters that reStructuredText takes for markup are escaped, outside `code` and examples.
"""

from __future__ import annotations

import inspect
import re
from dataclasses import MISSING, fields, is_dataclass
from typing import Any

from sphinx.application import Sphinx
from sphinx.util.inspect import object_description

_CODE = re.compile(r"(`[^`]*`)")
_MARKUP = re.compile(r"([\\|*]|_\b|(?<=\w)_(?!\w))")
_ITEM = re.compile(r"(?:\d+\.|-) ")


def plain(lines: list[str]) -> list[str]:
    """The lines with markup characters escaped, and an empty line after each list."""
    result: list[str] = []
    in_example = in_list = False
    for line in lines:
        in_example = line.lstrip().startswith(">>>") or (in_example and bool(line.strip()))
        is_item = bool(_ITEM.match(line))
        if in_list and line and not line.startswith(" ") and not is_item:
            result.append("")
        in_list = is_item or (in_list and line.startswith(" "))
        result.append(line if in_example else _escaped(line))
    return result


def _escaped(line: str) -> str:
    parts = _CODE.split(line)
    return "".join(part if part.startswith("`") else _MARKUP.sub(r"\\\1", part) for part in parts)


def _process(
    app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]
) -> None:
    del app, name, obj, options
    lines[:] = plain(lines)
    if what in ("attribute", "data", "property"):
        # Napoleon reads a first line with a colon as "type: description": begin with a comment.
        lines[:0] = ["..", ""]


def _has_defaults(kind: Any) -> bool:
    """Whether every field of the dataclass has a default."""
    return all(
        each.default is not MISSING or each.default_factory is not MISSING for each in fields(kind)
    )


def _short_defaults(
    app: Sphinx,
    what: str,
    name: str,
    obj: Any,
    options: object,
    signature: str | None,
    returns: str,
) -> tuple[str | None, str]:
    """A default such as RetargetingSettings() without all of its fields."""
    del app, name, options
    if signature and what in ("function", "method"):
        for parameter in inspect.signature(obj).parameters.values():
            value, kind = parameter.default, type(parameter.default)
            if is_dataclass(kind) and _has_defaults(kind) and value == kind():
                signature = signature.replace(object_description(value), f"{kind.__name__}()")
    return signature, returns


def setup(app: Sphinx) -> dict[str, bool]:
    """Escape before napoleon reads the sections; shorten signatures."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("autodoc-process-docstring", _process, priority=400)
    app.connect("autodoc-process-signature", _short_defaults)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
