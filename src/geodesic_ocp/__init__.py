"""Geodesics of mechanical systems, and human motion seen as sequences of them.

Importing the package is quick: each name is imported from its module when it is first used.
`__init__.pyi`, here and in the folders, says where the names are.
"""

from importlib import import_module as _import_module

from lazy_loader import attach_stub as _attach_stub

_find, _names, __all__ = _attach_stub(__name__, __file__)


def __getattr__(name):
    """Import a public name when it is first used."""
    if name in __all__:
        return _find(name)
    if name == "__version__":
        return _import_module("importlib.metadata").version(__name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__():
    return [*_names(), "__version__"]
