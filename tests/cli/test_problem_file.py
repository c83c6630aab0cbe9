"""geodesic-ocp solve: problems in files are found, changed, solved and plotted."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import Output

import geodesic_ocp as go
from geodesic_ocp.cli.solve import problem_classes, with_fields

GALLERY = Path(__file__).resolve().parents[2] / "problems"
DISC = str(GALLERY / "around_disc.py")

OWN = '''
from dataclasses import dataclass
import geodesic_ocp as go
from beside import END

@dataclass(frozen=True)
class Straight(go.Problem):
    """A straight line."""
    end: tuple = END
    steps: int = 3
    named: bool = False
    def __post_init__(self):
        if self.steps < 0: raise ValueError(f"steps must be positive, got {self.steps}")
    @property
    def metric(self): return go.Euclidean(2)
    def boundary(self, q0, q1): return [(q0, (0.0, 0.0)), (q1, self.end)]

@dataclass(frozen=True)
class Longer(Straight):
    """Another."""
    end: tuple = (3.0, 4.0)
'''


@pytest.fixture
def own(tmp_path: Path) -> Path:
    (tmp_path / "beside.py").write_text("END = (1.0, 1.0)\n")
    file = tmp_path / "own.py"
    file.write_text(OWN)
    return file


@pytest.mark.slow
def test_problem_is_solved_and_plotted(tmp_path: Path, printed: Output) -> None:
    out = tmp_path / "new" / "folder"
    arguments = ["solve", DISC, "--set", "radius=0.4", "--tolerance", "1e-6", "--out", str(out)]
    text = printed(*arguments)
    assert text.startswith("AroundDisc: From (-1, 0) to (1, 0) [m] around a disc")
    assert "exact length" in text
    assert "2.162243" in text
    assert "locally minimizing under its constraints" in text
    assert (out / "AroundDisc.png").stat().st_size > 10_000
    again = go.ocp.load_solution(out / "AroundDisc.json")
    assert again.problem.radius == 0.4  # type: ignore[attr-defined]


def test_every_class_of_a_file_is_solved(own: Path, printed: Output) -> None:
    text = printed("solve", own)
    assert text.index("Straight: A straight line.") < text.index("Longer: Another.")
    text = printed("solve", own, "--problem", "Longer", "--set", "end=[6, 8]")
    assert "Straight" not in text
    rows = dict(line.rsplit(maxsplit=1) for line in text.splitlines() if line.startswith("length"))
    assert rows == {"length": "10"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--set", "end=(1, 2, 3)"], "boundary[1]: a bound must be one number or 2"),
        (["--set", "steps=-1"], "steps must be positive, got -1"),
        (
            ["--set", "steps='three'"],
            "Straight(steps='three') is not a valid problem: '<'",
        ),
        (
            ["--set", "ende=(1, 2)"],
            "Straight has no field 'ende'; its fields are end, steps, named",
        ),
        (["--set", "end=import os"], "end='import os' is not a Python literal"),
        (["--set", "end"], "--set end: must be FIELD=VALUE"),
        (["--set", "end=('a', 2)"], "boundary[1]: a bound must be numbers, got ('a', 2)"),
        (["--problem", "Curved"], "has no Curved; it has Straight, Longer"),
        (["--tolerance", "-1"], "tolerance must be positive"),
    ],
)
def test_wrong_settings_are_named(
    own: Path, arguments: list[str], message: str, refused: Output
) -> None:
    assert message in refused("solve", own, *arguments)


def test_fields_of_the_wrong_type_are_named(refused: Output) -> None:
    assert "Throw(ball=3) is not a valid problem: 'int' object has no attribute" in refused(
        "solve", GALLERY / "throw.py", "--set", "ball=3"
    )


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("x = 1\n", "defines no problem"),
        ("x = \n", "cannot be run: SyntaxError"),
        ("import nothing_of_that_name\n", "cannot be run: ModuleNotFoundError"),
        ("from geodesic_ocp import PointToPoint\n", "defines no problem"),
        ("x = 1\nx = {}['a']\n", "line 2 cannot be run: KeyError: 'a'"),
        (
            "import geodesic_ocp as go\nclass Mine(go.Problem):\n    metric = None\n",
            "defines no problem: Mine must define boundary",
        ),
        ("import sys\nsys.exit(0)\n", "line 2 cannot be run: SystemExit"),
    ],
)
def test_files_without_problems_are_named(
    tmp_path: Path, content: str, message: str, refused: Output
) -> None:
    file = tmp_path / "file.py"
    file.write_text(content)
    assert message in refused("solve", file)
    assert "missing.py is not a Python file" in refused("solve", tmp_path / "missing.py")


def test_infeasible_problem_ends_with_code_2(tmp_path: Path, refused: Output) -> None:
    file = tmp_path / "apart.py"
    file.write_text(
        OWN.replace("from beside import END", "END = (1.0, 1.0)")
        + "    def constraints(self, q, v): return [(5.0, q[0] + q[1], 6.0, 'far')]\n"
    )
    assert "the given start violates a constraint: far falls below 5 by 5" in refused(
        "solve", file, "--problem", "Longer"
    )


def test_fields_are_set_from_literals(own: Path) -> None:
    straight, _ = problem_classes(own)
    problem = with_fields(straight, {"end": "(2, 0)", "steps": "4", "named": "True"})
    assert (problem.end, problem.steps, problem.named) == ((2, 0), 4, True)  # type: ignore[attr-defined]
