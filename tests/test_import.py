"""Importing the package is quick: names, and the libraries behind them, load when first used."""

from __future__ import annotations

import subprocess
import sys

import pytest
from public_names import public_names

import geodesic_ocp as go

HEAVY = ("casadi", "matplotlib", "numpy", "pinocchio", "scipy")
ANALYSE = """
import geodesic_ocp as go
import sys

recording = go.trajectory.bundled_recording()
arm, motion = recording.model, recording.motion
go.log(go.KineticEnergy(arm), motion.q[790], motion.q[-1])
analysis = go.analyse(arm, motion.part(790, len(motion) - 1))
assert "matplotlib" not in sys.modules
go.plot(analysis)
"""


def loaded_after(code: str) -> set[str]:
    """Names of the modules that a new interpreter has loaded after running the code."""
    run = [sys.executable, "-c", f"{code}\nimport sys\nprint(*sys.modules)"]
    return set(subprocess.run(run, capture_output=True, text=True, check=True).stdout.split())


def test_import_loads_no_other_library_and_no_module_hides_a_function() -> None:
    loaded_after(
        f"import sys, geodesic_ocp as go\nassert not set(sys.modules) & set({HEAVY})\n"
        "import geodesic_ocp.manifold.exp, geodesic_ocp.execution.replay\n"
        "from geodesic_ocp import *\n"
        "assert callable(exp) and callable(log) and callable(go.execution.replay)"
    )


@pytest.mark.slow
def test_only_figures_load_matplotlib() -> None:
    loaded = loaded_after(ANALYSE)
    assert "matplotlib" in loaded
    assert "matplotlib.pyplot" not in loaded


def test_every_name_can_be_imported() -> None:
    names = public_names()
    assert len([name for name in names if "." not in name]) <= 55
    assert all(callable(value) for value in names.values())
    assert len({name.rpartition(".")[2] for name in names}) == len(names), "two of one name"
    assert set(go.__all__) < set(dir(go))


def test_unknown_names_are_attribute_errors() -> None:
    with pytest.raises(
        AttributeError, match="module 'geodesic_ocp' has no attribute 'geodesik'"
    ) as error:
        _ = go.geodesik
    assert (error.value.name, error.value.obj) == ("geodesik", go)  # so that a name is suggested
    with pytest.raises(ImportError, match="cannot import name 'geodesik'"):
        from geodesic_ocp import geodesik  # noqa: F401


def test_version() -> None:
    assert go.__version__.count(".") == 2
