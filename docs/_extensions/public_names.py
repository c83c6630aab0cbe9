"""The public names; the reference shows public base classes only."""

from __future__ import annotations

import re
import sys
from types import ModuleType
from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.ext.autosummary import Autosummary

import geodesic_ocp as go


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


class PublicNames(Autosummary):
    """The directive `public-names`: one table of all of them, with the first line of each."""

    def run(self) -> list[nodes.Node]:
        """The table."""
        self.content = StringList(sorted(public_names(), key=str.lower), source="public names")
        self.options["nosignatures"] = None
        return super().run()


def _once(app: Sphinx) -> list[Any]:
    """Let the search find the page of a name by its title alone, not the name on it as well."""
    objects = app.env.domains.python_domain.objects
    for name in public_names():
        full = f"geodesic_ocp.{name}"
        objects[full] = objects[full]._replace(aliased=True)
    return []  # no more pages


def setup(app: Sphinx) -> dict[str, bool]:
    """Show public bases."""
    app.setup_extension("sphinx.ext.autodoc")
    for name in ("baselines", "distances"):  # modules of folders, by their public names
        sys.modules[f"geodesic_ocp.{name}"] = getattr(go, name)
    app.connect("autodoc-process-bases", _public_bases)
    app.connect("html-page-context", _back_links)
    app.connect("html-collect-pages", _once)  # links are resolved, the search is not indexed
    app.add_directive("public-names", PublicNames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
