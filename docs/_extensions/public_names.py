"""The public names; the reference shows public base classes only."""

from __future__ import annotations

import re
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

import geodesic_ocp as go

if TYPE_CHECKING:
    from sphinx.application import Sphinx


def public_names() -> dict[str, object]:
    """All public classes and functions by name, such as "log" or "recordings.Markers"."""
    found: dict[str, object] = {}
    for name in go.__all__:
        value = getattr(go, name)
        if not isinstance(value, ModuleType):
            found[name] = value
            continue
        inner = {each: getattr(value, each) for each in value.__all__}
        found |= {
            f"{name}.{each}": object
            for each, object in inner.items()
            if not isinstance(object, ModuleType)
        }
    return found


def _public_bases(app: Sphinx, name: str, obj: type, options: object, bases: list[type]) -> None:
    """Name the nearest public class in place of a base that users do not see."""
    del app, name, options
    public = list(public_names().values())
    bases[:] = next(([each] for each in obj.__mro__[1:] if each in public), bases)


_BACK = re.compile(r"(generated/([\w.]+?)(?:_class)?\.html)#([\w.]+)")


def _back_links(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: object
) -> None:
    """Let the links of source pages lead to the names on the pages of the reference.

    Sphinx takes one prefix for all names of a module, some of which are in namespaces.
    """
    del app, template, doctree
    if page.startswith("_modules/"):

        def corrected(match: re.Match[str]) -> str:
            file, name, anchor = match.groups()
            _, _, member = anchor.partition(f".{name.rpartition('.')[2]}")
            return f"{file}#{name}{member}"

        context["body"] = _BACK.sub(corrected, context["body"])


def setup(app: Sphinx) -> dict[str, bool]:
    """Show public bases."""
    app.setup_extension("sphinx.ext.autodoc")
    for name in ("baselines", "distances"):  # modules of folders, by their public names
        sys.modules[f"geodesic_ocp.{name}"] = getattr(go, name)
    app.connect("autodoc-process-bases", _public_bases)
    app.connect("html-page-context", _back_links)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
