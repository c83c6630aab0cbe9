"""A metric's functions for the compiled core, by the names that the core calls."""

from __future__ import annotations

import casadi as ca


def compiled_functions(
    matrix: ca.Function,
    energy_density: ca.Function,
    geodesic: ca.Function,
    transport: ca.Function,
    transport_matrix: ca.Function,
) -> dict[str, ca.Function]:
    """The functions, from five of `Metric`, of positions q, velocities v and momenta p, (n,) each.

    - metric_tensor: q -> G
    - metric_solve: (q, p) -> G^-1 p
    - geodesic_rate: (q, v) -> (v, v'), the geodesic equation
    - transport_rate: (w, (q, v)) -> w', parallel transport
    - transport_matrix: (q, v) -> A, with w' = A w
    - energy_gradient: (q, v) -> l = v' G v / 2, and (l_q, l_v)
    - energy_hessian: (q, v) -> l, and (l_q, l_v, vec l_qq, vec l_qv, vec G)
    """
    n = matrix.size1_in(0)
    q, v = ca.SX.sym("q", n), ca.SX.sym("v", n)
    state = ca.vertcat(q, v)
    tensor = matrix(q)
    factors, upper, permutation = ca.ldl(tensor, False)
    energy = energy_density(q, v)
    gradient = ca.gradient(energy, state)
    by_position = ca.triu2symm(ca.triu(ca.jacobian(gradient[:n], q)))
    mixed = ca.jacobian(gradient[n:], q).T  # l_vv is G itself
    momentum = ca.SX.sym("p", n)
    solution = ca.ldl_solve(momentum, factors, upper, permutation)
    derivatives = ca.vertcat(
        gradient, ca.vec(ca.densify(by_position)), ca.vec(ca.densify(mixed)), ca.vec(tensor)
    )
    outputs: dict[str, tuple[list[ca.SX], list[ca.SX]]] = {
        "metric_tensor": ([q], [tensor]),
        "metric_solve": ([q, momentum], [solution]),
        "geodesic_rate": ([state], [geodesic(state)]),
        "energy_gradient": ([state], [energy, gradient]),
        "energy_hessian": ([state], [energy, derivatives]),
    }
    functions = {
        name: ca.Function(name, inputs, [ca.densify(ca.cse(result)) for result in results])
        for name, (inputs, results) in outputs.items()
    }
    w = ca.SX.sym("w", n)
    rate = transport(w, state)
    functions["transport_rate"] = ca.Function("transport_rate", [w, state], [rate])
    functions["transport_matrix"] = transport_matrix
    return functions
