"""geodesic-ocp check: exit codes and what it prints."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from commands import Output
from known_metrics import DIAGONAL

from geodesic_ocp import validation
from geodesic_ocp.cli import main as cli
from geodesic_ocp.validation import FORMAT


def table(file: Path, **changes: Any) -> Path:
    entries = [{**DIAGONAL, **changes}]
    file.write_text(json.dumps({"format": FORMAT, "version": 1, "entries": entries}))
    return file


@pytest.fixture
def short_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One straight line instead of the bundled table."""
    file = table(tmp_path / "bundled.json", name="bundled diagonal")
    monkeypatch.setattr(validation, "BUNDLED", file)


@pytest.mark.usefixtures("short_table")
def test_correct_table_ends_with_code_0(tmp_path: Path, printed: Output) -> None:
    assert "1 known geodesics with built-in: all 4 checks passed" in printed(
        "check", "--backend", "built-in"
    )
    assert "all 8 checks passed" in printed("check", table(tmp_path / "mine.json"))


@pytest.mark.usefixtures("short_table")
def test_wrong_value_ends_with_code_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["check", str(table(tmp_path / "mine.json", length=5.1))]) == 1
    printed = capsys.readouterr()
    assert "1 of 8 checks FAILED, of 'diagonal'" in printed.out
    assert printed.err == ""


@pytest.mark.usefixtures("short_table")
def test_malformed_table_ends_with_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for file, words in (
        (
            table(tmp_path / "mine.json", length="long"),
            "Expected `float`, got `str` - at `$.length`",
        ),
        (tmp_path / "none.json", "there is no such file"),
    ):
        assert cli.main(["check", str(file)]) == 2
        printed = capsys.readouterr()
        assert printed.out == ""
        assert printed.err.startswith("geodesic-ocp: error: ")
        assert f"{file.name}: " in printed.err
        assert words in printed.err
        assert printed.err.count("\n") == 1


def test_unknown_back_end_is_wrong_usage(refused: Output) -> None:
    assert 'Invalid value "symbolic" for --backend' in refused("check", "--backend", "symbolic")
