"""The package against known geodesics, and the check against wrong values."""

from __future__ import annotations

import ast
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from known_metrics import DIAGONAL
from msgspec.structs import replace

from geodesic_ocp import validation
from geodesic_ocp.model.dynamics import BACKENDS, why_unavailable
from geodesic_ocp.validation import (
    BUNDLED,
    FORMAT,
    Check,
    KnownCubic,
    KnownGeodesic,
    Point,
    check_cubic,
    check_geodesic,
    check_known_geodesics,
    has_model,
    metric_of,
    read_known_cubics,
    read_known_geodesics,
    run_check,
    table_of,
)

ROOT = Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "known_geodesics.py"
GUIDE = ROOT / "docs" / "how-to" / "known_geodesics.md"
KNOWN = read_known_geodesics()
CUBICS = read_known_cubics()


def entry_named(name: str) -> KnownGeodesic:
    return next(known for known in KNOWN if known.name == name)


def write_table(folder: Path, *entries: Any, **head: Any) -> Path:
    file = folder / "mine.json"
    record = {"format": FORMAT, "version": 1, "entries": list(entries), **head}
    file.write_text(json.dumps(record))
    return file


def changed_entry(**fields: Any) -> dict[str, Any]:
    """The entry with changed fields; None leaves a field out."""
    return {name: value for name, value in {**DIAGONAL, **fields}.items() if value is not None}


def failed_quantities(checks: list[Check]) -> set[str]:
    return {check.quantity for check in checks if not check.passed}


# -- the package -----------------------------------------------------------------------------------


# Building the NLP of a mechanism of many joints takes most of the time; `check` runs them all.
MANY_JOINTS = [
    pytest.param(each, marks=[pytest.mark.slow] if len(each.q0) > 3 else [], id=each.name)
    for each in KNOWN
]


@pytest.mark.parametrize("known", MANY_JOINTS)
def test_known_geodesic(known: KnownGeodesic, backend: str) -> None:
    checks = check_geodesic(known, backend)
    expected = {"exp", "length"} | ({"path"} if known.points else set())
    assert {check.quantity for check in checks} == expected | ({"log"} if known.log else set())
    assert failed_quantities(checks) == set(), table_of(checks).to_string()


@pytest.mark.parametrize("known", CUBICS, ids=lambda known: known.name)
def test_known_cubic(known: KnownCubic) -> None:
    checks = check_cubic(known)
    assert {check.quantity for check in checks} == {"cubic", "action", "equation"}
    assert failed_quantities(checks) == set(), table_of(checks).to_string()


def test_wrong_cubics_fail() -> None:
    known = next(each for each in CUBICS if "Lie" in each.name)
    assert failed_quantities(check_cubic(replace(known, action=0.8))) == {"action"}
    other = replace(known, v0=(known.v0[0] + 1e-5, *known.v0[1:]))
    assert failed_quantities(check_cubic(other)) == {"cubic", "action"}


def test_tables_may_have_cubics_alone(tmp_path: Path) -> None:
    record = next(each for each in json.loads(BUNDLED.read_text())["cubics"])
    file = write_table(tmp_path, cubics=[record])
    assert (read_known_geodesics(file), read_known_cubics(file)) == ((), CUBICS[:1])
    file = write_table(tmp_path, cubics=[{**record, "v1": [1.0]}])
    with pytest.raises(ValueError, match=r"mine\.json: cubic 1 \(.*v1 must have 2 numbers"):
        read_known_cubics(file)


def test_every_type_of_metric_is_in_the_table() -> None:
    assert {known.metric["kind"] for known in (*KNOWN, *CUBICS)} == {
        "rotations",
        "euclidean",
        "sphere",
        "half-plane",
        "polar plane",
        "surface of revolution",
        "planar arm",
        "human arm",
        "urdf",
    }
    arms = [known.metric for known in KNOWN if known.metric["kind"] == "human arm"]
    assert {arm["side"] for arm in arms} == {"left", "right"}
    assert len({len(known.q0) for known in KNOWN}) >= 4


def test_some_geodesics_are_checked_without_the_logarithm() -> None:
    assert any(known.log for known in KNOWN)
    assert any(not known.log for known in KNOWN)


# -- wrong values must fail --------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda known: {"length": known.length + 1e-6}, {"length"}),
        (lambda known: {"q1": (known.q1[0], known.q1[1] - 1e-6)}, {"exp", "log"}),
        (lambda known: {"points": (Point(0.5, (known.points[1].q[0], 0.0)),)}, {"path"}),
        (
            lambda known: {"v0": (known.v0[0] + 1e-6, known.v0[1])},
            {"exp", "length", "path", "log"},
        ),
        (lambda known: {"q1": (float("nan"), 0.0)}, {"exp", "log"}),
    ],
    ids=["length", "q1", "points", "v0", "not a number"],
)
@pytest.mark.parametrize("name", ["two uneven links", "half-plane, half circle"])
def test_wrong_values_fail(
    name: str, change: Callable[[KnownGeodesic], dict[str, Any]], expected: set[str]
) -> None:
    known = entry_named(name)
    assert failed_quantities(check_geodesic(replace(known, **change(known)))) == expected


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "field", "value"),
    [
        ("two uneven links", "masses", [1.4, 0.90001]),
        ("two uneven links", "centres", [0.17, 0.12001]),
        ("two uneven links", "inertias", [0.025, 0.00901]),
        ("torus, over the inner equator", "minor", 0.80001),
        ("cone", "half_angle", 0.6435),
        ("human right arm, reach", "side", "left"),
        ("human left arm, de Leva, female", "sex", "male"),
    ],
)
def test_another_metric_fails(name: str, field: str, value: Any) -> None:
    known = entry_named(name)
    assert "exp" in failed_quantities(
        check_geodesic(replace(known, metric={**known.metric, field: value}))
    )


def test_exceptions_are_failures_with_a_message() -> None:
    known = entry_named("plane in polar coordinates")
    checks = check_geodesic(replace(known, q0=(0.0, 0.0)))
    assert failed_quantities(checks) >= {"exp", "path", "log"}
    assert all(check.message for check in checks if np.isinf(check.error))
    (check,) = check_geodesic(replace(known, metric={"kind": "euclidean", "dim": 0}))
    assert (check.quantity, check.passed) == ("metric", False)
    assert "dim" in check.message


def test_nan_is_not_within_a_tolerance() -> None:
    assert not Check("x", "exp", "-", float("nan"), 1.0).passed
    assert Check("x", "exp", "-", 1.0, 1.0).passed


def test_an_unknown_backend_is_an_error_not_a_failure() -> None:
    with pytest.raises(ValueError, match="backend must be one of"):
        check_geodesic(entry_named("two rods"), "symbolic")


def test_metrics_without_a_model_are_checked_once() -> None:
    known = [entry_named("sphere, great circle"), entry_named("two rods")]
    backends = [name for name in BACKENDS if not why_unavailable(name)]
    checks = check_known_geodesics(known, backends)
    exps = [(check.name, check.backend) for check in checks if check.quantity == "exp"]
    assert exps == [(known[0].name, "-"), *((known[1].name, name) for name in backends)]
    assert [has_model(entry.metric) for entry in known] == [False, True]


# -- the command -----------------------------------------------------------------------------------


@pytest.fixture
def short_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A table of one entry instead of the bundled one."""
    folder = tmp_path / "bundled"
    folder.mkdir()
    entries = json.loads(BUNDLED.read_text())["entries"]
    sphere = next(entry for entry in entries if entry["name"] == "sphere, great circle")
    monkeypatch.setattr(validation, "BUNDLED", write_table(folder, sphere))


@pytest.mark.usefixtures("short_table")
def test_run_check_prints_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    assert run_check()
    printed = capsys.readouterr().out
    assert "sphere, great circle" in printed
    assert "all 4 checks passed" in printed
    for name in BACKENDS:
        assert name in printed  # whether checked or not available
    assert why_unavailable("pinocchio.casadi") in printed


@pytest.mark.usefixtures("short_table")
def test_run_check_names_failures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nowhere = changed_entry(name="nowhere", metric={"kind": "euclidean", "dim": 3})
    assert not run_check(write_table(tmp_path, changed_entry(length=5.1), nowhere))
    printed = capsys.readouterr().out
    line = next(line for line in printed.splitlines() if line.startswith("diagonal  "))
    quantity, backend, error, tolerance, verdict = line.split()[1:]
    assert (quantity, backend, tolerance, verdict) == ("exp", "-", "1.00e-10", "passed")
    assert float(error) < 1e-10
    assert "5 of 12 checks FAILED, of 'diagonal', 'nowhere'" in printed
    assert "nowhere, exp, -: q must have shape (3,)" in printed


# -- tables ----------------------------------------------------------------------------------------


def test_example_of_the_documentation_passes(tmp_path: Path) -> None:
    (example,) = re.findall(r"```json\n(.*?)```", GUIDE.read_text(), flags=re.DOTALL)
    file = tmp_path / "example.json"
    file.write_text(example)
    (known,) = read_known_geodesics(file)
    assert failed_quantities(check_geodesic(known)) == set()


def test_cubic_of_the_documentation_passes(tmp_path: Path) -> None:
    (example,) = re.findall(r"cubic = (\{.*?\n\})", GUIDE.read_text(), flags=re.DOTALL)
    file = write_table(tmp_path, cubics=[ast.literal_eval(example)])
    (known,) = read_known_cubics(file)
    assert failed_quantities(check_cubic(known)) == set()


def test_files_are_relative_to_the_table(tmp_path: Path) -> None:
    shutil.copy(BUNDLED.parent / "known_arm.urdf", tmp_path / "arm.urdf")
    metric = {"kind": "urdf", "file": "arm.urdf", "hand": "tool"}
    six = {name: [0.1] * 6 for name in ("q0", "v0", "q1")}
    (known,) = read_known_geodesics(
        write_table(tmp_path, changed_entry(metric=metric, points=[], **six))
    )
    assert metric_of(known.metric).dim == 6


def test_joints_of_a_urdf_can_be_selected(tmp_path: Path) -> None:
    metric = {"kind": "urdf", "file": str(BUNDLED.parent / "known_arm.urdf"), "hand": "tool"}
    assert metric_of({**metric, "joints": ["elbow", "pitch"]}).dim == 2


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"q0": None}, "missing required field `q0`"),
        ({"q0": [0.0, "x"]}, r"Expected `float`, got `str` - at `\$\.q0\[1\]`"),
        ({"q0": 0.0}, r"Expected `array`, got `float` - at `\$\.q0`"),
        ({"v0": [1.0]}, "v0 must have 2 numbers as q0 has, got 1"),
        ({"length": -5.0}, r"Expected `float` > 0\.0 - at `\$\.length`"),
        ({"length": True}, r"got `bool` - at `\$\.length`"),
        ({"log": "yes"}, "Expected `bool`, got `str`"),
        ({"tolerances": {"exp": 1e-9}}, "tolerances: 'log' is missing"),
        ({"tolerances": {"exp": 0.0, "log": 1e-9}}, r"> 0\.0 - at `\$\.tolerances"),
        ({"tolerances": 1e-9}, r"Expected `object`, got `float` - at `\$\.tolerances`"),
        ({"tolerances": {"exp": 1.0, "log": 1.0, "end": 1.0}}, "Invalid enum value 'end'"),
        ({"points": [{"s": 1.0, "q": [3.0, 4.0]}]}, r"< 1\.0 - at `\$\.points\[0\]\.s`"),
        ({"points": [{"s": 0.5}]}, r"missing required field `q` - at `\$\.points\[0\]`"),
        ({"points": [{"s": 0.5, "q": [1.0]}]}, r"points\[0\]: q must have 2 numbers"),
        ({"source": " "}, r"Expected `str` matching .* - at `\$\.source`"),
        ({"colour": "red"}, "unknown field `colour`"),
        ({"metric": "flat"}, r"Expected `object`, got `str` - at `\$\.metric`"),
        ({"metric": {"kind": "klein"}}, "kind must be one of 'euclidean', .*got 'klein'"),
        ({"metric": {"kind": "euclidean"}}, "metric: 'euclidean' needs 'dim'"),
        ({"metric": {"kind": "sphere", "radius": 2}}, "metric: 'sphere' has no 'radius'"),
        (
            {"metric": {"kind": "surface of revolution", "profile": "vase"}},
            "profile must be one of 'cylinder', .*got 'vase'",
        ),
        (
            {"metric": {"kind": "surface of revolution", "profile": "torus", "major": 2.0}},
            "needs 'minor'",
        ),
        ({"metric": {"kind": "urdf", "file": 3, "hand": "tool"}}, "file must be a text"),
    ],
)
def test_malformed_entries_are_named(tmp_path: Path, fields: dict[str, Any], words: str) -> None:
    file = write_table(tmp_path, changed_entry(name="fine"), changed_entry(**fields))
    with pytest.raises(ValueError, match=rf"mine\.json: entry 2 \('diagonal'\): .*{words}"):
        read_known_geodesics(file)


@pytest.mark.parametrize(
    ("entries", "head", "words"),
    [
        ([], {}, "entries"),
        ([DIAGONAL], {"format": "geodesics"}, "is not a file of known geodesics"),
        ([DIAGONAL], {"version": 2}, "has version 2, expected 1"),
        ([DIAGONAL, DIAGONAL], {}, r"entry 2 \('diagonal'\): name is that of an entry before"),
        ([changed_entry(name=None)], {}, "entry 1: .*missing required field `name`"),
        ([[1.0, 2.0]], {}, "entry 1: Expected `object`, got `array`"),
    ],
)
def test_malformed_tables_are_named(
    tmp_path: Path, entries: list[Any], head: dict[str, Any], words: str
) -> None:
    with pytest.raises(ValueError, match=rf"mine\.json: .*{words}"):
        read_known_geodesics(write_table(tmp_path, *entries, **head))


def test_files_that_are_not_tables_are_named(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"none\.json: there is no such file"):
        read_known_geodesics(tmp_path / "none.json")
    for words in ("geodesics", '{"format": NaN}'):
        (tmp_path / "text.json").write_text(words)
        with pytest.raises(ValueError, match=r"text\.json: is not JSON"):
            read_known_geodesics(tmp_path / "text.json")


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"lengths": [1.0]}, "as many entries each"),
        ({"lengths": "11"}, "lengths must be a list of numbers"),
        ({"masses": [1.0, None]}, r"masses\[1\] must be a finite number"),
        ({"masses": [1.0, -0.5]}, "negative mass"),
    ],
)
def test_planar_arms_need_values_for_every_link(fields: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        metric_of({**entry_named("two uneven links").metric, **fields})


# -- the tool that computes the table -------------------------------------------------------------


def test_tool_shares_no_code_with_the_package() -> None:
    modules = set()
    for node in ast.walk(ast.parse(TOOL.read_text())):
        if isinstance(node, ast.Import):
            modules |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            modules.add((node.module or "").split(".")[0])
    assert "pinocchio" in modules
    assert not modules & {"geodesic_ocp", "casadi"}


@pytest.mark.slow
def test_tool_reproduces_the_table() -> None:
    done = subprocess.run(
        [sys.executable, TOOL, "--check"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
