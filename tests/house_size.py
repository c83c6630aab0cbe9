"""What there is to read and to learn in the package, by room."""

from __future__ import annotations

import ast
import re
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

_NAME = re.compile(r"_?[A-Z0-9_]+")


@dataclass(frozen=True)
class Size:
    """Size of a room.

    Attributes:
        nodes: expressions and statements, the measure of what there is to understand.
        nodes_per_line: of lines of code, without imports, comments and docstrings.
        packed: assignments of several values at once, `a, b = x, y`.
        constants: named numbers of modules.
    """

    nodes: int
    nodes_per_line: float
    packed: int
    constants: int


def sizes(source: Path) -> dict[str, Size]:
    """Sizes of the folders of a package; files beside them are the room "."."""
    counts: dict[str, Counter[str]] = {}
    for file in sorted(source.rglob("*.py")):
        parts = file.relative_to(source).parts
        room = parts[0] if len(parts) > 1 else "."
        counts.setdefault(room, Counter()).update(_counts(file.read_text()))
    return {
        room: Size(
            nodes=found["nodes"],
            nodes_per_line=round(found["nodes"] / max(found["lines"], 1), 2),
            packed=found["packed"],
            constants=found["constants"],
        )
        for room, found in counts.items()
    }


def _counts(text: str) -> Counter[str]:
    tree = ast.parse(text)
    lines = text.split("\n")
    blank = {k for k, line in enumerate(lines, 1) if not line.strip() or line.strip()[0] == "#"}
    found: Counter[str] = Counter()
    for node in ast.walk(tree):
        found["nodes"] += isinstance(node, ast.expr | ast.stmt)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(
            node
        ):
            blank.update(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
        if isinstance(node, ast.Import | ast.ImportFrom):
            blank.update(range(node.lineno, (node.end_lineno or 0) + 1))
        if isinstance(node, ast.Assign):
            several = isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple)
            found["packed"] += several
    found["constants"] = sum(map(_named_numbers, tree.body))
    found["lines"] = len(lines) - len(blank)
    return found


def _named_numbers(statement: ast.stmt) -> int:
    """Number of names in capitals that a statement of a module gives to numbers."""
    if not isinstance(statement, ast.Assign | ast.AnnAssign) or statement.value is None:
        return 0
    target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
    names = [node.id for node in ast.walk(target) if isinstance(node, ast.Name)]
    values = [node.value for node in ast.walk(statement.value) if isinstance(node, ast.Constant)]
    plain = isinstance(statement.value, ast.Constant | ast.Tuple | ast.UnaryOp | ast.BinOp)
    numbers = plain and any(type(value) in (int, float) for value in values)
    return len(names) if numbers and all(map(_NAME.fullmatch, names)) else 0
