"""The structure of the package: imports go down its layers, without circles."""

from __future__ import annotations

import ast
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from public_names import public_names

SOURCE = Path(__file__).resolve().parents[1] / "src" / "geodesic_ocp"
PACKAGE = SOURCE.name
# From the ground up: a module imports from its own layer and from those before it.
LAYERS = [
    ("errors", "progress", "arrays", "tables", "records"),
    ("ipopt", "compiled"),
    ("cells", "blocks"),
    ("model",),
    ("model.formats",),
    ("manifold",),
    ("trajectory",),
    (
        *("drawing.camera", "drawing.styles", "drawing.raster", "drawing.actors"),
        *("drawing.arm_shapes", "drawing.best_view", "drawing.arm_strip"),
        *("drawing.analysis_figure", "drawing.path_figure", "drawing.study_figures"),
    ),
    ("ocp",),
    ("logarithm",),
    ("recordings",),
    ("synergies",),
    ("fitting",),
    ("studies",),
    ("execution",),
    ("retargeting", "drawing.retargeting_strips"),
    ("validation",),
    ("drawing",),
    ("cli",),
]
HEIGHT = {name: height for height, layer in enumerate(LAYERS) for name in layer}


def trees() -> dict[str, ast.Module]:
    """Syntax trees of all modules by their names within the package; its own is empty."""
    found = {}
    for file in SOURCE.rglob("*.py"):
        parts = file.relative_to(SOURCE).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        found[name] = ast.parse(file.read_text())
    return found


TREES = trees()


def imported_names(tree: ast.Module) -> list[str]:
    """Full names of all imports, those in functions and under TYPE_CHECKING included."""
    names = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def imported_modules(tree: ast.Module) -> set[str]:
    """Modules of this package that are imported."""
    found = set()
    for name in imported_names(tree):
        package, _, inner = name.partition(".")
        if package == PACKAGE:
            module = inner if inner in TREES else inner.rpartition(".")[0]
            assert module in TREES, f"{name} is not in a module of the package"
            found.add(module)
    return found


def layer(module: str) -> int:
    parents = [module]
    while parents[-1] not in HEIGHT and parents[-1]:
        parents.append(parents[-1].rpartition(".")[0])
    assert parents[-1], f"{module} belongs to no layer"
    return HEIGHT[parents[-1]]


@pytest.mark.slow
def test_imports_go_down_the_layers_without_circles() -> None:
    graph = {name: imported_modules(tree) for name, tree in TREES.items() if name}
    for name, imports in graph.items():
        if name != "ocp":
            for other in imports:
                assert layer(other) <= layer(name), f"{name} imports {other} from above"
    TopologicalSorter(graph).prepare()  # raises on a circle and names it


def test_each_thing_has_one_place() -> None:
    classes: Counter[str] = Counter()
    for name, tree in TREES.items():
        nodes = list(ast.walk(tree))
        classes.update(node.name for node in nodes if isinstance(node, ast.ClassDef))
        if not name.startswith("model"):
            roots = {full.partition(".")[0] for full in imported_names(tree)}
            assert "pinocchio" not in roots, f"{name} imports pinocchio"
        if name != "ipopt":
            calls = [node.func for node in nodes if isinstance(node, ast.Call)]
            called = {getattr(f, "attr", getattr(f, "id", "")) for f in calls}
            assert not called & {"nlpsol", "qpsol"}, f"{name} calls a solver"
    assert not [name for name, count in classes.items() if count > 1], "classes share a name"
    # A module named after a public function holds it, and the function is what users import.
    functions = {name.rpartition(".")[2] for name, it in public_names().items() if callable(it)}
    for name, tree in TREES.items():
        last = name.rpartition(".")[2]
        defined = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
        if last in functions and name.partition(".")[0] != "cli":
            assert last in defined or not defined, f"{name} does not hold {last}"
