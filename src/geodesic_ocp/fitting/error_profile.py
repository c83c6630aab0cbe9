"""The least error of a fit as a function of one parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.errors import NotConverged
from geodesic_ocp.fitting.metric_fit import MetricFit
from geodesic_ocp.progress import Progress, no_progress, shows_progress
from geodesic_ocp.tables import new_table

if TYPE_CHECKING:
    from pandas import DataFrame

_RANGE = 10.0
_COUNT = 13


@dataclass(frozen=True, eq=False, repr=False)
class ErrorProfile(ShortRepr):
    """Least errors at fixed values of one parameter, all others estimated anew at each.

    Attributes:
        name, unit: name and unit of the parameter.
        values: increasing (k,).
        errors: root mean square error of each recording (k, recordings), in `error_unit`.
        error_unit: "rad" or "m".
        estimate: estimate of the parameter.
        recordings: their names.
    """

    name: str
    unit: str
    values: Array
    errors: Array
    error_unit: str
    estimate: float
    recordings: tuple[str, ...]
    _shown = ("name", "unit", "estimate", "values")

    @property
    def mean(self) -> Array:
        """Root of the mean over the recordings of the squared errors, (k,)."""
        return np.asarray(np.sqrt(np.mean(self.errors**2, axis=1)))

    def table(self) -> DataFrame:
        """Return value, mean error, and the error of every recording."""
        unit = f" [{self.unit}]" if self.unit else ""
        header = (f"{self.name}{unit}", f"rms error [{self.error_unit}]", *self.recordings)
        rows = zip(self.values.tolist(), self.mean.tolist(), self.errors.tolist(), strict=True)
        return new_table(header, tuple((value, mean, *each) for value, mean, each in rows))


@shows_progress
def error_profile(
    fit: MetricFit,
    name: str | None = None,
    values: ArrayLike | None = None,
    *,
    progress: Progress | None = None,
) -> ErrorProfile:
    """Return least error of a fit as a function of one parameter, with all others estimated anew.

    >>> recording = go.trajectory.bundled_recording()
    >>> fit = go.fitting.fit_metric(recording)
    >>> profile = go.fitting.error_profile(fit, values=[0.001, 0.05, 1.0])
    >>> profile.errors.ravel().round(3).tolist()
    [0.026, 0.021, 0.021]

    Args:
        fit: fit whose recordings and cuts are used.
        name: name of the parameter; None: the first.
        values: at which it is fixed; None: 13 from a tenth to ten times the estimate.
        progress: called with the current step, the amount done, and the total.

    Raises:
        ValueError: no such parameter, or values out of its bounds.
        NotConverged: Ipopt did not find a solution at one of the values.
    """
    names = [each.name for each in fit.estimates]
    wanted = names[0] if name is None else name
    if wanted not in names:
        raise ValueError(f"there is no parameter {wanted!r}; there are {', '.join(names)}")
    index = names.index(wanted)
    parameter = fit.parameters[index]
    estimate = fit.estimates[index]
    if values is None:
        spread = np.geomspace(1.0 / _RANGE, _RANGE, _COUNT)
        smallest = max(parameter.lower, 1e-6 * parameter.start)
        grid = np.unique(np.clip(estimate.value * spread, smallest, parameter.upper))
    else:
        grid = np.unique(np.asarray(values, dtype=float))
        if not grid.size or grid[0] < parameter.lower or grid[-1] > parameter.upper:
            raise ValueError(
                f"values of {wanted} must be between {parameter.lower:g} and {parameter.upper:g}, "
                f"got {values!r}"
            )
    report = progress or no_progress
    middle = int(np.argmin(np.abs(grid - estimate.value)))
    squares = np.empty((grid.size, len(fit.recordings)))
    near = fit.outcome
    for done, number in enumerate([*range(middle, grid.size), *range(middle - 1, -1, -1)]):
        report(f"profile of {wanted}", done, grid.size)
        if number == middle - 1:  # downwards, from the middle again
            near = fit.outcome
        near = fit.program.solve(near=near, fixed={index: float(grid[number])})
        if not near.success:
            raise NotConverged(f"{wanted} = {grid[number]:.4g}: {near.status}", near)
        squares[number] = fit.program.mean_squares(near.x)
    return ErrorProfile(
        wanted,
        estimate.unit,
        grid,
        fit.root_mean_squares(squares),
        fit.error_unit,
        estimate.value,
        tuple(each.name for each in fit.recordings),
    )
