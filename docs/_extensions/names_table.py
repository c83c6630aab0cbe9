"""The table of all public names, and each of them once in the search."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.statemachine import StringList
from public_names import public_names
from sphinx.application import Sphinx
from sphinx.ext.autosummary import Autosummary


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
    """Add the directive and the search's names."""
    app.connect("html-collect-pages", _once)  # links are resolved, the search is not indexed
    app.add_directive("public-names", PublicNames)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
