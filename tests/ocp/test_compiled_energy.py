"""The energy's compiled derivatives are those of the interpreted functions."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from numpy.testing import assert_allclose

import geodesic_ocp as go
from geodesic_ocp.blocks import Terms
from geodesic_ocp.compiled import library
from geodesic_ocp.ocp.problem import parse_conditions
from geodesic_ocp.ocp.transcription import CompiledEnergy, PathTerms, Transcription, Units


# The system's compiler, which takes two seconds, computes several states at once.
@pytest.mark.parametrize("compiler", ["auto", pytest.param("system", marks=pytest.mark.slow)])
@pytest.mark.parametrize("grid", [go.Grid(1, 6), go.Grid(3, 4, (0.0, 0.2, 0.9, 1.0))])
def test_compiled_derivatives_equal_interpreted_ones(
    compiler: str, grid: go.Grid, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(library.ENVIRONMENT_VARIABLE, compiler)
    arm = go.human_arm(height=1.6 + 0.1 * len(compiler))  # whose library is not loaded yet
    problem = go.Reach(arm, np.zeros(7), np.zeros(3))
    if not problem.metric.kernels.available():
        pytest.skip("needs a compiler")
    if compiler == "system":
        assert problem.metric.kernels.compiler_name == "system"
    conditions = parse_conditions(problem)
    q, v, p = conditions.q, conditions.v, conditions.p
    derived = Terms(ca.vertcat(q, v), p, problem.metric.energy_density(q, v))
    own = PathTerms.of(problem.metric, conditions)
    terms = [own, replace(own, energy=derived)]
    assert isinstance(terms[0].energy, CompiledEnergy)
    compiled, interpreted = (
        Transcription(each, replace(grid, ends=None), grid.nodes) for each in terms
    )
    x = rng.normal(size=arm.dof * grid.size)
    units = Units(rng.normal(size=arm.dof), 0.7, 3.0)
    p = interpreted.parameters(units, grid, rng.normal(size=3))
    factors = rng.normal(size=interpreted.program.size_g)
    arguments = {"value": [x, p], "objective": [x, p], "hessian": [x, p, 0.7, factors]}
    for name, values in arguments.items():
        results = [getattr(each, name).call(values) for each in (compiled, interpreted)]
        for one, other in zip(*results, strict=True):
            expected = ca.DM(other).full()
            assert_allclose(
                ca.DM(one).full(), expected, rtol=0, atol=1e-12 * np.abs(expected).max()
            )
