"""What a callback receives in every iteration of the solver."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.ocp.nlp.nlp import NLP
from geodesic_ocp.trajectory.path import Path


@dataclass(frozen=True, eq=False)
class Iterate:
    """An iterate of Ipopt.

    Attributes:
        number: of the iteration; the initial guess is number zero.
        objective: energy and running cost.
        violation: largest violation of any condition at the nodes, in the condition's unit.
        path: the path.
    """

    number: int
    objective: float
    violation: float
    path: Path


Callback: TypeAlias = Callable[[Iterate], object]


class IterationCallback(ca.Callback):
    """Passes every iterate from CasADi to a function, and keeps any exception that it raises."""

    def __init__(self, nlp: NLP, callback: Callback) -> None:
        super().__init__()
        self._nlp, self._callback, self._number = nlp, callback, 0
        self.failure: BaseException | None = None
        self.stopped = False
        x, g = nlp.bounds.lower.size, nlp.bounds.lower_g.size
        self._sizes = dict(
            zip(ca.nlpsol_out(), (x, 1, g, x, g, nlp.transcription.size_p), strict=True)
        )
        self.construct("iteration_callback", {})

    def get_n_in(self) -> int:
        """Number of inputs: as many as a solver has outputs."""
        return int(ca.nlpsol_n_out())

    def get_n_out(self) -> int:
        """Number of outputs: whether to stop."""
        return 1

    def get_name_in(self, index: int) -> str:
        """Name of the solver's output of that index."""
        return str(ca.nlpsol_out(index))

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        """Dense columns of the NLP's sizes."""
        return ca.Sparsity.dense(self._sizes[ca.nlpsol_out(index)])

    def eval(self, arguments: Sequence[ca.DM]) -> list[int]:
        """[1] to stop Ipopt, else [0]."""
        values = dict(zip(self._sizes, arguments, strict=True))
        path = self._nlp.path(values["x"].full()[:, 0])
        violation, _ = self._nlp.bounds.worst(path.nodes, values["g"].full()[:, 0])
        objective = float(values["f"]) * self._nlp.units.scale
        try:
            answer = self._callback(Iterate(self._number, objective, violation, path))
            self.stopped = isinstance(answer, (bool, np.bool_)) and bool(answer)
        except BaseException as error:  # CasADi would turn it into a warning
            self.failure, self.stopped = error, True
        self._number += 1
        return [int(self.stopped)]
