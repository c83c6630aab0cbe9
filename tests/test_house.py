"""The structure of the package: imports go down its layers, without circles."""

from __future__ import annotations

import ast
import inspect
import re
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path

from house_size import Size, sizes
from public_names import public_names

import geodesic_ocp as go
from geodesic_ocp.cli.main import new_app

SOURCE = Path(__file__).resolve().parents[1] / "src" / "geodesic_ocp"
PACKAGE = SOURCE.name
# From the ground up: a module imports from its own layer and from those before it.
CORE = [
    ("errors", "progress", "arrays", "tables", "records", "figures"),
    ("ipopt", "compiled"),
    ("cells", "blocks"),
    ("model",),
    ("model.formats",),
    ("manifold",),
    ("trajectory",),
    ("ocp",),
    ("logarithm",),
    ("synergies",),
    ("fitting",),
    ("validation",),
]
# Wings import the core and the wings named here; nothing but the command line imports them.
WINGS = {
    "recordings": (),
    "studies": ("recordings",),
    "execution": (),
    "retargeting": ("execution",),
    "drawing": ("recordings", "studies", "execution", "retargeting"),
}
LAYERS = [*CORE, *((name,) for name in WINGS), ("cli",)]
HEIGHT = {name: height for height, layer in enumerate(LAYERS) for name in layer}


def statements(block: ast.AST) -> list[ast.AST]:
    """All statements, those in functions and under TYPE_CHECKING included."""
    found = [block]
    for each in found:  # which grows
        for field in ("body", "orelse", "finalbody", "handlers", "cases"):
            inner = getattr(each, field, ())
            found += inner if isinstance(inner, list) else ()  # not of expressions
    return found[1:]


def imports(nodes: list[ast.AST]) -> list[str]:
    """Full names of all imports."""
    names = []
    for node in nodes:
        if isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute"
            names += [f"{node.module}.{alias.name}" for alias in node.names]
    return names


def layer(module: str) -> int:
    parents = [module]
    while parents[-1] not in HEIGHT and parents[-1]:
        parents.append(parents[-1].rpartition(".")[0])
    assert parents[-1], f"{module} belongs to no layer"
    return HEIGHT[parents[-1]]


def test_imports_go_down_the_layers_and_each_thing_has_one_place() -> None:
    files = {}  # by the modules' names within the package; its own is empty
    for file in SOURCE.rglob("*.py"):
        parts = file.relative_to(SOURCE).with_suffix("").parts
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    functions = {name.rpartition(".")[2] for name, it in public_names().items() if callable(it)}
    graph: dict[str, set[str]] = {name: set() for name in files}
    classes: Counter[str] = Counter()
    for name, file in files.items():
        text = file.read_text()
        module = ast.parse(text)
        nodes = statements(module)
        imported = imports(nodes)
        for full in imported:
            package, _, inner = full.partition(".")
            if package == PACKAGE:
                other = inner if inner in files else inner.rpartition(".")[0]
                assert other in files, f"{full} is not in a module of the package"
                graph[name].add(other)
                if name:
                    assert layer(other) <= layer(name), f"{name} imports {other} from above"
                wing = name.partition(".")[0]
                room = other.partition(".")[0]
                if wing in WINGS and room in WINGS:
                    assert room in (wing, *WINGS[wing]), f"{name} imports {other}"
        classes.update(node.name for node in nodes if isinstance(node, ast.ClassDef))
        if not name.startswith("model"):
            roots = {full.partition(".")[0] for full in imported}
            assert "pinocchio" not in roots, f"{name} imports pinocchio"
        if name != "ipopt":
            assert not re.search(r"\b(nlpsol|qpsol)\(", text), f"{name} calls a solver"
        # A module named after a public function holds it, and the function is what users import.
        last = name.rpartition(".")[2]
        defined = {node.name for node in module.body if isinstance(node, ast.FunctionDef)}
        if last in functions and name.partition(".")[0] != "cli":
            assert last in defined or not defined, f"{name} does not hold {last}"
    del graph[""]
    TopologicalSorter(graph).prepare()  # raises on a circle and names it
    assert not [name for name, count in classes.items() if count > 1], "classes share a name"


# What there is to read and to learn. Ceilings only go down, unless a new capability says in the
# change that raises one what it costs.
CEILINGS = {
    ".": Size(nodes=11583, nodes_per_line=7.22, packed=2, constants=8),
    "cli": Size(nodes=11291, nodes_per_line=6.15, packed=0, constants=13),
    "compiled": Size(nodes=3054, nodes_per_line=5.68, packed=0, constants=10),
    "drawing": Size(nodes=37014, nodes_per_line=7.78, packed=1, constants=179),
    "execution": Size(nodes=27114, nodes_per_line=7.8, packed=4, constants=90),
    "fitting": Size(nodes=9404, nodes_per_line=7.2, packed=0, constants=28),
    "logarithm": Size(nodes=13517, nodes_per_line=7.05, packed=0, constants=83),
    "manifold": Size(nodes=9929, nodes_per_line=7.39, packed=0, constants=23),
    "model": Size(nodes=32747, nodes_per_line=7.86, packed=3, constants=41),
    "ocp": Size(nodes=39401, nodes_per_line=7.4, packed=1, constants=171),
    "recordings": Size(nodes=36799, nodes_per_line=7.12, packed=3, constants=98),
    "retargeting": Size(nodes=31045, nodes_per_line=7.24, packed=2, constants=141),
    "studies": Size(nodes=17065, nodes_per_line=6.37, packed=0, constants=18),
    "synergies": Size(nodes=13486, nodes_per_line=7.31, packed=0, constants=27),
    "trajectory": Size(nodes=19979, nodes_per_line=7.81, packed=0, constants=55),
}
NAMES_ON_TOP = 55
PUBLIC_NAMES = 174
PARAMETERS = 546  # of public functions
PARAMETERS_OF_ONE = 20
OPTIONS = 264  # of all commands
WORDS = 50407  # of README, CONTRIBUTING and the guides


def test_rooms_do_not_grow() -> None:
    found = sizes(SOURCE)
    assert set(found) == set(CEILINGS)
    for room, size in found.items():
        ceiling = CEILINGS[room]
        for name, value in vars(size).items():
            most = getattr(ceiling, name)
            assert value <= most, f"{room} has {value} {name}, at most {most} are planned"


def test_the_interface_does_not_grow() -> None:
    names = public_names()
    assert len(go.__all__) <= NAMES_ON_TOP
    assert len(names) <= PUBLIC_NAMES
    functions = [each for each in names.values() if inspect.isfunction(each)]
    counts = {each.__name__: len(inspect.signature(each).parameters) for each in functions}
    assert max(counts.values()) <= PARAMETERS_OF_ONE, counts
    assert sum(counts.values()) <= PARAMETERS
    assert number_of_options() <= OPTIONS


def test_the_guides_do_not_grow() -> None:
    root = SOURCE.parents[1]
    docs = root / "docs"
    folders = (docs, docs / "how-to", docs / "explanation")
    pages = [root / "README.md", root / "CONTRIBUTING.md"]
    pages += [page for folder in folders for page in folder.glob("*.md")]
    assert sum(len(page.read_text().split()) for page in pages) <= WORDS


def test_values_have_no_memory() -> None:
    """Fields of a frozen dataclass are set while it is made, by one function, and never grow."""
    setters = []
    grown = []
    for file in SOURCE.rglob("*.py"):
        text = file.read_text()
        if "object.__setattr__" in text:
            setters.append(file.name)
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ClassDef) and any(map(_is_frozen, node.decorator_list)):
                grown += [f"{file.name}:{k}" for k in map(_grows, ast.walk(node)) if k]
    assert setters == ["arrays.py"]
    assert not grown, f"records grow at {', '.join(grown)}"


def _is_frozen(decorator: ast.expr) -> bool:
    keywords = getattr(decorator, "keywords", [])
    return any(each.arg == "frozen" and getattr(each.value, "value", 0) for each in keywords)


def _grows(node: ast.AST) -> int:
    """Line of a statement that changes what a field holds, such as `self.x.append(y)`; else 0."""
    changed: ast.AST | None = None
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
        if node.func.attr in ("append", "extend", "add", "update", "setdefault", "pop", "clear"):
            changed = node.func.value
    elif isinstance(node, ast.Assign | ast.AugAssign):
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        changed = target.value if isinstance(target, ast.Subscript) else None
    own = isinstance(changed, ast.Attribute) and ast.unparse(changed.value) == "self"
    return getattr(node, "lineno", 0) if own else 0


def number_of_options() -> int:
    """Number of the options and arguments of all commands."""
    app = new_app()
    commands = [name for name in app if not name.startswith("-")]
    return sum(len(app[name].assemble_argument_collection()) for name in commands)
