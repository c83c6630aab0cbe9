"""The house: imports go down its layers, never up."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[1] / "src" / "geodesic_ocp"
# From the ground up. A module may import from its own layer and from those below.
LAYERS = [
    ("errors", "arrays", "records", "table", "plot"),
    ("sampled",),
    ("model",),
    ("manifold",),
    ("ocp",),
    ("motion",),
    ("analysis", "gallery", "viewer"),
    ("retargeted_arm", "retargeted", "retargeting"),
    ("report",),
    ("commands",),
    ("cli",),
    ("__init__",),
]
HEIGHT = {name: height for height, layer in enumerate(LAYERS) for name in layer}
FILES = sorted(SOURCE.rglob("*.py"))


def imports(file: Path) -> list[str]:
    """Full names of everything that the file imports, also inside functions."""
    names = []
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: imports are written in full"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def layer(file: Path) -> str:
    return file.relative_to(SOURCE).parts[0].removesuffix(".py")


def test_every_module_has_a_layer() -> None:
    assert {layer(file) for file in FILES} == set(HEIGHT)


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(SOURCE)))
def test_imports_go_down(file: Path) -> None:
    own = HEIGHT[layer(file)]
    for name in imports(file):
        package, *rest = name.split(".")
        if package == "geodesic_ocp" and rest and layer(file) != "__init__":
            assert HEIGHT[rest[0]] <= own, f"{file} imports {name} from above"


@pytest.mark.parametrize("file", FILES, ids=lambda file: str(file.relative_to(SOURCE)))
def test_solvers_stay_in_their_rooms(file: Path) -> None:
    if layer(file) != "model":
        assert not any(name.split(".")[0] == "pinocchio" for name in imports(file))
    if file != SOURCE / "ocp" / "ipopt.py":
        calls = [
            node for node in ast.walk(ast.parse(file.read_text())) if isinstance(node, ast.Call)
        ]
        names = {getattr(call.func, "attr", getattr(call.func, "id", "")) for call in calls}
        assert not names & {"nlpsol", "qpsol"}, f"{file} calls a solver"
