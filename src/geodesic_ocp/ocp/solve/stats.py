"""Statistics of a solve."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MeshIteration:
    """One solve of a mesh refinement.

    Attributes:
        segments: of its grid.
        iterations, seconds: of Ipopt.
        objective: the value reached.
        max_path_violation: largest violation of any condition anywhere on the path.
    """

    segments: int
    iterations: int
    seconds: float
    objective: float
    max_path_violation: float


@dataclass(frozen=True, repr=False)
class Stats:
    """Statistics of one solve.

    Attributes:
        success: whether the path is a local solution, to Ipopt's tolerance.
        status: how the solver stopped, a sentence.
        iterations: of Ipopt; with several grids, on the last one (`mesh_history` has all).
        seconds: wall time of the solver, likewise.
        variables, constraints: sizes of the NLP, bounds not counted.
        energy: of the path by the quadrature of its grid, 1/2 int |q'|_G^2 ds.
        objective: what was minimized, energy and running cost.
        max_node_violation: largest violation of any condition at the nodes, in its unit.
        worst_constraint: name of the condition with that violation.
        max_path_violation: largest violation anywhere on the path, between the nodes included.
        mesh_history: the solves of a mesh refinement; empty if there was none.
    """

    success: bool
    status: str
    iterations: int
    seconds: float
    variables: int
    constraints: int
    energy: float
    objective: float
    max_node_violation: float
    worst_constraint: str
    max_path_violation: float
    mesh_history: tuple[MeshIteration, ...] = ()

    def __repr__(self) -> str:
        refined = f" on {len(self.mesh_history)} grids" if self.mesh_history else ""
        return (
            f"Stats({self.status}: {self.total_iterations} iterations{refined}, "
            f"{self.total_seconds:.2g} s, energy {self.energy:.6g}, "
            f"largest violation {self.max_path_violation:.1e})"
        )

    @property
    def total_iterations(self) -> int:
        """Iterations of Ipopt on all grids."""
        return sum(each.iterations for each in self.mesh_history) or self.iterations

    @property
    def total_seconds(self) -> float:
        """Wall time [s] of the solver on all grids."""
        return sum(each.seconds for each in self.mesh_history) or self.seconds
