"""Ipopt's callback in every iteration, and a plot of the iterates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import TYPE_CHECKING, Any, TypeAlias

import casadi as ca
import numpy as np

from geodesic_ocp.figures.path_figure import draw_path
from geodesic_ocp.ocp.nlp import NLP
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.trajectory.path import Path

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Iterate:
    """An iterate of Ipopt.

    Attributes:
        number: number of the iteration; the initial guess is number zero.
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


class LivePlot:
    """A callback for `solve` that draws the path of every iterate into one notebook output.

    Args:
        problem: the problem to be solved.
        interval: shortest time between two drawings [s]; `close` draws the last iterate.

    Raises:
        ValueError: outside a notebook.

    Use it as `with go.ocp.LivePlot(problem) as live: go.solve(problem, callback=live)`.
    """

    def __init__(self, problem: Problem, interval: float = 0.1) -> None:
        try:
            from IPython import get_ipython
            from IPython.display import display
        except ImportError as error:
            raise ValueError(
                "LivePlot needs IPython: pip install 'geodesic_ocp[notebooks]'"
            ) from error
        if getattr(get_ipython(), "kernel", None) is None:
            raise ValueError("LivePlot works in a notebook only")
        self._problem, self._interval = problem, interval
        self._display: Any = display
        self._handle: Any = None
        self._figure: Figure | None = None
        self._drawn = -float("inf")
        self._waiting: Iterate | None = None

    def __call__(self, iterate: Iterate) -> None:
        """Draw the iterate, unless the previous one was drawn less than `interval` ago."""
        self._waiting = iterate
        if perf_counter() - self._drawn >= self._interval:
            self._draw(iterate)

    def _draw(self, iterate: Iterate) -> None:
        title = (
            f"{type(self._problem).__name__}, iteration {iterate.number}: objective "
            f"{iterate.objective:.6g}, largest violation {iterate.violation:.1e}"
        )
        self._figure = draw_path(iterate.path, title, self._problem.draw, self._figure, arms=False)
        if self._handle is None:
            self._handle = self._display(self._figure, display_id=True)
        else:
            self._handle.update(self._figure)
        self._drawn, self._waiting = perf_counter(), None

    def close(self) -> None:
        """Draw the last iterate, if it was skipped."""
        if self._waiting is not None:
            self._draw(self._waiting)

    def __enter__(self) -> LivePlot:
        return self

    def __exit__(self, *error: Any) -> None:
        self.close()
