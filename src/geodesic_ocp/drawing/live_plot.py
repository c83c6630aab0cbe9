"""A plot of the iterates of a solve."""

from __future__ import annotations

from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING, Any

from geodesic_ocp.drawing.over_time import timed_figure
from geodesic_ocp.drawing.path_figure import draw_obstacles, draw_path
from geodesic_ocp.ocp.callback import Iterate
from geodesic_ocp.ocp.motion_problem import MotionPhases, MotionProblem
from geodesic_ocp.ocp.problem import Problem
from geodesic_ocp.trajectory.path import Path

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class LivePlot:
    """A callback for `solve` that draws every iterate, path or motion, into one notebook output.

    Args:
        problem: the problem to be solved.
        interval: shortest time between two drawings [s]; `close` draws the last iterate.

    Raises:
        ValueError: outside a notebook.

    Use it as `with go.drawing.LivePlot(problem) as live: go.solve(problem, callback=live)`.
    """

    def __init__(
        self, problem: Problem | MotionProblem | MotionPhases, interval: float = 0.1
    ) -> None:
        try:
            from IPython import get_ipython
            from IPython.display import display
        except ImportError as error:
            raise ValueError(
                "LivePlot needs IPython: pip install 'geodesic_ocp[notebooks]'"
            ) from error
        if getattr(get_ipython(), "kernel", None) is None:
            raise ValueError("LivePlot works in a notebook only")
        self._problem = problem
        self._interval = interval
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
        if isinstance(iterate.path, Path):
            extra = None
            if isinstance(self._problem, Problem):
                extra = partial(draw_obstacles, self._problem)
            self._figure = draw_path(iterate.path, title, extra, self._figure, arms=False)
        else:
            self._figure = timed_figure(iterate.path, title)
        if self._handle is None:
            self._handle = self._display(self._figure, display_id=True)
        else:
            self._handle.update(self._figure)
        self._drawn = perf_counter()
        self._waiting = None

    def close(self) -> None:
        """Draw the last iterate, if it was skipped."""
        if self._waiting is not None:
            self._draw(self._waiting)

    def __enter__(self) -> LivePlot:
        return self

    def __exit__(self, *error: Any) -> None:
        self.close()
