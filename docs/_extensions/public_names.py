"""The reference lists every public name, once: anything else fails the build."""

from __future__ import annotations

import re
from collections import Counter

from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

import geodesic_ocp

_ENTRY = re.compile(r"^   (\w+)$", re.MULTILINE)


def _check(app: Sphinx) -> None:
    pages = sorted((app.srcdir / "reference").glob("*.md"))
    listed = Counter(name for page in pages for name in _ENTRY.findall(page.read_text()))
    public = set(geodesic_ocp.__all__)
    faults = {
        "missing": public - listed.keys(),
        "not public": listed.keys() - public,
        "listed twice": {name for name, count in listed.items() if count > 1},
    }
    for what, names in faults.items():
        if names:
            raise ExtensionError(f"docs/reference, {what}: {', '.join(sorted(names))}")


def _public_bases(app: Sphinx, name: str, obj: type, options: object, bases: list[type]) -> None:
    """Name the nearest public class in place of a base that users do not see."""
    del app, name, options
    public = {getattr(geodesic_ocp, each) for each in geodesic_ocp.__all__}
    bases[:] = next(([each] for each in obj.__mro__[1:] if each in public), bases)


def setup(app: Sphinx) -> dict[str, bool]:
    """Check before anything is read; show public bases."""
    app.setup_extension("sphinx.ext.autodoc")
    app.connect("builder-inited", _check)
    app.connect("autodoc-process-bases", _public_bases)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
