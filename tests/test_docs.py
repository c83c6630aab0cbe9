"""What the README and the documentation show can be run as it stands."""

from __future__ import annotations

import contextlib
import inspect
import re
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from public_names import public_names

import geodesic_ocp as go
from geodesic_ocp.cli.main import new_app
from geodesic_ocp.model.formats.robots import ROBOTS, folder
from geodesic_ocp.tables import markdown

ROOT = Path(__file__).resolve().parents[1]
README = ROOT / "README.md"
# Copied there by a build: notebooks, gallery, and pages of the reference.
_GENERATED = {"_build", "generated", "problems", "tutorials"}
PAGES = [
    README,
    *(
        page
        for page in sorted((ROOT / "docs").rglob("*.md"))
        if not _GENERATED & set(page.relative_to(ROOT / "docs").parts)
    ),
]
_BLOCK = re.compile(r"(<!-- needs robots -->\n)?```python\n(.*?)```", re.DOTALL)
_COMMAND = re.compile(r"^(?:\.venv/bin/)?geodesic-ocp (.*?)(?:\s+#.*)?$", re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """Python of a page, and whether it needs descriptions of robots."""

    code: str
    needs_robots: bool


def _name(page: Path) -> str:
    return page.relative_to(ROOT).as_posix().removeprefix("docs/")


def _blocks(page: Path) -> list[Block]:
    return [Block(code, bool(mark)) for mark, code in _BLOCK.findall(page.read_text())]


def _run(page: Path, blocks: list[Block]) -> dict[str, Any]:
    names: dict[str, Any] = {"__name__": "__main__"}
    for block in blocks:
        exec(compile(block.code, str(page), "exec"), names)
    return names


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    mpl.use("Agg")


@pytest.mark.parametrize(
    "page",
    [
        pytest.param(page, id=_name(page), marks=[] if page == README else [pytest.mark.slow])
        for page in PAGES
        if _blocks(page)
    ],
)
def test_blocks_run(page: Path) -> None:
    """With the blocks that need descriptions of robots where these are installed."""
    installed = folder(ROBOTS["panda"].package) is not None
    names = _run(page, [each for each in _blocks(page) if installed or not each.needs_robots])
    if page == README:
        assert names["path"](1.0) == pytest.approx(np.array(names["goal"]), abs=1e-9)
        assert names["path"].certificate.locally_shortest
        assert names["solution"].stats.success


def test_readme_is_short() -> None:
    assert len(README.read_text().split()) <= 450


@pytest.mark.slow
def test_tables_of_the_demo_are_what_it_prints(bundled_analysis: go.synergies.Analysis) -> None:
    _, _, *lines = markdown(bundled_analysis.table()).splitlines()
    rows = [re.sub(" +", " ", line) for line in lines]
    text = (ROOT / "docs" / "explanation" / "segmentation.md").read_text()
    assert [row for row in rows if row not in text] == []


def test_the_reference_lists_every_public_name() -> None:
    pages = (ROOT / "docs" / "reference").glob("*.md")
    texts = "".join(page.read_text() for page in pages)
    listed = re.findall(r"^   ([\w.]+)$", texts, re.MULTILINE)
    assert sorted(listed) == sorted(public_names())


@pytest.mark.parametrize(
    "name", [name for name, value in public_names().items() if inspect.isfunction(value)]
)
def test_every_public_function_describes_its_arguments_and_has_an_example(name: str) -> None:
    function: Any = public_names()[name]
    text = inspect.getdoc(function) or ""
    _, _, arguments = text.partition("\nArgs:\n")
    missing = set(inspect.signature(function).parameters) - set(re.findall(r"\w+", arguments))
    assert missing == set()
    assert ">>> " in text


@pytest.mark.slow
def test_commands_have_these_options() -> None:
    """Every command line in the documentation is one that the parser accepts."""
    app = new_app()
    commands = {
        command
        for page in PAGES
        for block in re.findall(r"```sh\n(.*?)```", page.read_text(), re.DOTALL)
        for command in _COMMAND.findall(block)
    }
    assert len(commands) > 5
    for command in commands:
        with contextlib.suppress(ValueError):  # the files of the examples are not there
            app.parse_args(shlex.split(command), exit_on_error=False)


def test_stated_defaults() -> None:
    """Defaults in the table of options of `retarget` are those of the settings."""
    text = (ROOT / "docs" / "how-to" / "retargeting.md").read_text()
    stated = re.findall(r"^\| `--([a-z-]+) .*\(default ([-\d. ]+)[);]", text, re.MULTILINE)
    assert len(stated) > 8
    for option, numbers in stated:
        default = getattr(go.retargeting.RetargetingSettings(), option.replace("-", "_"))
        assert np.ravel(default).tolist() == [float(each) for each in numbers.split()], option
