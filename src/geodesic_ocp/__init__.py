"""Geodesics of mechanical systems, and human motion seen as sequences of them.

Importing the package is quick: each name is imported from its module when it is first used.
`__init__.pyi`, here and in the folders, says where the names are.
"""

from importlib import import_module as _import_module
from pathlib import Path as _Path

from lazy_loader import attach_stub as _attach_stub

_find, _names, __all__ = _attach_stub(__name__, __file__)
_RENAMED = {
    "Study": "StudyResult",
    "alignment": "align",
    "clearance_constraint": "keep_clear",
    "collision_pairs": "link_pairs",
    "evaluate": "motion_errors",
    "figures": "drawing",
    "fit_motion": "fit_markers",
    "viewer": "drawing",
}


def __getattr__(name):
    """Import a public name when it is first used; warn of a name of version 0.1."""
    if name in __all__:
        return _find(name)
    if name == "__version__":
        return _import_module("importlib.metadata").version(__name__)
    if not name.startswith("_"):
        now = _RENAMED.get(name, name)
        folders = [stub.parent.name for stub in _Path(__file__).parent.glob("*/__init__.pyi")]
        for place in ["", "baselines.", "distances.", *(f"{folder}." for folder in folders)]:
            module = _find(place[:-1]) if place else _import_module(__name__)
            if now in module.__all__:
                text = f"{__name__}.{name} is now {__name__}.{place}{now}"
                _import_module("warnings").warn(text, DeprecationWarning, stacklevel=2)
                return getattr(module, now)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return [*_names(), "__version__"]
