"""The README's Python runs as it stands there, from top to bottom."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

README = Path(__file__).resolve().parents[1] / "README.md"


def test_readme_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)  # one block writes a file
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(), flags=re.DOTALL)
    assert len(blocks) == 10
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, str(README), "exec"), names)
    assert names["there"] == pytest.approx(np.array(names["goal"]), abs=1e-9)
    path = names["path"]
    assert names["carried"] == pytest.approx(path(1.0, 1), abs=1e-5)
    assert names["again"].stats.success
    printed = capsys.readouterr().out
    # The table in the README is the one that is printed.
    for row in names["analysis"].table().markdown().splitlines():
        assert row in README.read_text()
    assert "straight lines, same segments" in printed
