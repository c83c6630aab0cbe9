"""Derivatives of programs made of blocks are those that CasADi finds for the whole program."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
import scipy.sparse

from geodesic_ocp import blocks
from geodesic_ocp.arrays import evaluate
from geodesic_ocp.blocks import Block, BlockProgram, Terms
from geodesic_ocp.cells import Cells

SIZE = 40


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "most"), [(0, 10**6), (1, 10**6), (2, 0), (3, 0)])
def test_derivatives_are_those_of_the_whole_program(
    seed: int, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All kinds of places, weights, units and shared parameters at once, compiled and not."""
    monkeypatch.setattr(blocks, "_MANY", most)
    rng = np.random.default_rng(seed)
    z, p, state = ca.SX.sym("z", 3), ca.SX.sym("p", 2), ca.SX.sym("state", 6)
    mixed = Terms(
        z,
        p,
        ca.sin(z[0] * z[1]) * p[0] + z[2] ** 4,
        ca.vertcat(z[0] * z[1] * p[1], ca.exp(z[2] * z[0])),
    )
    moving = Terms(
        state,
        objective=ca.sumsqr(ca.sin(state)) * state[0] * state[3] * state[4],
        constraints=ca.vertcat(state[0] * state[5] * state[2], state[1]),
    )
    shared = ca.MX.sym("shared", 2)
    some = np.array([rng.permutation(SIZE)[:3] for _ in range(6)])
    combined = scipy.sparse.random_array((12, SIZE), density=0.2, rng=rng)
    nodes = 4 * np.arange(4)[:, None] + 2 * np.arange(3)  # of cells that share one of them
    both = ca.vertcat(state, ca.SX.sym("common", 2))
    sharing = Terms(
        both,
        objective=ca.sumsqr(ca.sin(both)) * both[0] * both[6] * both[7],
        constraints=ca.vertcat(both[0] * both[7] * both[2], both[4] * both[6] ** 2),
    )
    common = Cells(20 + nodes[:, :, None] + np.arange(2), rng.normal(size=(3, 3, 3)), (3, 7))
    scales = rng.normal(size=(12, 8)), rng.normal(size=(12, 8))
    alone = Terms(z, p, ca.sin(z[0] * z[1]) * p[0] + z[2] ** 4 * p[1])
    groups = np.array([0, 1, 1, 0, 1])
    cells = Cells(nodes[:, :, None] + np.arange(2), rng.normal(size=(5, 3, 3)))
    units = rng.normal(size=(4, 3)), ca.DM(rng.normal(size=(4, 3))) * shared[0]
    sums = scipy.sparse.random_array((7, 24), density=0.4, rng=rng)
    bent = Terms(
        z, constraints=ca.vertcat(ca.sin(z[0] * z[1]), z[2] ** 2 * z[0], ca.exp(z[1]) * z[2], z[0])
    )
    points = Block(bent, some[:4], units=units)
    apart = Terms(z, p, constraints=ca.vertcat(p[0] * z[0] * z[1] + z[2] ** 3, z[1] * z[2]))
    at_points = np.array([rng.permutation(16)[:3] for _ in range(5)])
    linear = scipy.sparse.random_array((5, SIZE), density=0.2, rng=rng)
    form = scipy.sparse.random_array((SIZE, SIZE), density=0.1, rng=rng)
    program = BlockProgram(
        SIZE,
        [
            Block(mixed, some, rng.normal(size=(6, 2))),
            Block(Terms(z[0], constraints=z[0]), linear),
            Block(
                mixed, combined, rng.normal(size=(4, 2)), weights=rng.normal(size=4), units=units
            ),
            Block(sharing, common, units=scales),
            Block(sharing, common, units=scales, sums=sums),
            Block(
                alone,
                some[:2],
                rng.normal(size=(5, 2)),
                weights=rng.normal(size=5),
                units=(rng.normal(size=(2, 3)), rng.normal(size=(2, 3))),
                groups=groups,
            ),
            Block(apart, at_points, rng.normal(size=(5, 2)), inner=points),
            Block(apart, at_points[:2], rng.normal(size=(2, 2)), inner=points),
            Block(moving, cells, weights=shared[1] * ca.DM(rng.normal(size=20))),
        ],
        shared,
        (form + form.T, rng.normal(size=SIZE)),
    )
    x, lam_f, lam_g = ca.MX.sym("x", SIZE), ca.MX.sym("f"), ca.MX.sym("g", program.size_g)
    f, g = program.functions["nlp"](x, shared)
    lagrangian = ca.hessian(lam_f * f + ca.dot(lam_g, g), x)[0]
    expected = ca.Function(
        "expected",
        [x, shared, lam_f, lam_g],
        [ca.gradient(f, x), ca.jacobian(g, x), ca.triu(lagrangian)],
    )
    point, values, factors = rng.normal(size=SIZE), [0.7, 1.3], rng.normal(size=program.size_g)
    found = (
        program.functions["grad_f"](point, values)[1],
        program.functions["jac_g"](point, values)[1],
        program.functions["hess_lag"](point, values, 0.6, factors),
    )
    for one, other in zip(found, expected(point, values, 0.6, factors), strict=True):
        np.testing.assert_allclose(one.full(), other.full(), rtol=0.0, atol=1e-12 * 100.0)


def test_a_quadratic_program_is_solved() -> None:
    """min sum (x_k - k)^2 with x_k + x_(k+1) = 0 of neighbours, from its normal equations."""
    x, target = ca.SX.sym("x"), ca.SX.sym("target")
    pair = ca.SX.sym("pair", 2)
    near = Block(
        Terms(x, target, (x - target) ** 2), np.arange(3)[:, None], np.arange(3.0)[:, None]
    )
    zero = np.zeros((2, 1))
    sums = Terms(pair, constraints=pair[0] + pair[1])
    links = Block(sums, np.array([[0, 1], [1, 2]]), None, zero, zero)
    free = np.full(3, -np.inf), np.full(3, np.inf)
    outcome = BlockProgram(3, [near, links]).solve(np.ones(3), free, {})
    assert outcome.success
    np.testing.assert_allclose(outcome.x, np.array([1.0, -1.0, 1.0]) / 3.0, atol=1e-9)


@pytest.mark.parametrize("sparse", [False, True])
def test_arrays_of_any_layout_are_evaluated_as_casadi_does(sparse: bool) -> None:
    x, rotation = ca.SX.sym("x", 3), ca.SX.sym("R", 3, 3)
    outer = ca.diag(x) if sparse else x @ x.T
    function = ca.Function("f", [x, rotation], [rotation @ x, outer])
    rng = np.random.default_rng(2)
    wide, number = rng.normal(size=(6, 6)), 2.0
    layouts = (wide[0, ::2], wide[::2, ::2]), (wide[:3, :1], wide[:3, :3].T), (number, wide[3:, 3:])
    for given in layouts:
        expected = [each.full() for each in function.call(list(given))]
        for one, other in zip(evaluate(function, *given), expected, strict=True):
            np.testing.assert_array_equal(one, other)
    with pytest.raises(RuntimeError):
        evaluate(function, wide[0], wide[:3, :3])  # of six entries
