"""The joint inertia of every subject, from error profiles of the recordings, and how it scales.

A profile is the least error of a recording as a function of the joint inertia (`error_profile`). It
is all that an estimate from several recordings needs: the least of their sum, so that subjects are
fitted without reading a recording again.
"""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
import scipy

from geodesic_ocp.arrays import Array
from geodesic_ocp.errors import GeodesicOcpError, RecordingError
from geodesic_ocp.fitting.error_profile import ErrorProfile, error_profile
from geodesic_ocp.fitting.fit_metric import fit_metric
from geodesic_ocp.fitting.resampling import FEWEST, minimizers, resampled
from geodesic_ocp.manifold.metrics import FRACTION
from geodesic_ocp.model.inertias import inertia_scale
from geodesic_ocp.studies.paired_test import holm, student_half
from geodesic_ocp.studies.study_tables import Row
from geodesic_ocp.synergies.analyse import Analysis
from geodesic_ocp.trajectory.recording import Recording

if TYPE_CHECKING:
    from pandas import DataFrame

VALUES = FRACTION * np.geomspace(0.1, 10.0, 13)  # [m r^2], about the default
_RESAMPLES = 1000
_KEYS = ["curve", "condition", "subject"]
_UNIT = "m r^2 [kg m^2]"
_RELATIVE = "joint inertia [m r^2]"
_ABSOLUTE = "joint inertia [kg m^2]"
#: How a subject's joint inertia may depend on m r^2: the exponent that each hypothesis states.
_HYPOTHESES = {"proportional to m r^2": 1.0, "the same in kg m^2": 0.0}


def profile_rows(analysis: Analysis) -> list[Row]:
    """Return least errors of geodesics on the segments of an analysis, a row a joint inertia.

    None, with a RuntimeWarning, where no joint inertia can be fitted.
    """
    model = analysis.model.with_armature(0.0)
    segments = [(each.start, each.stop) for each in analysis.synergies]
    try:
        fit = fit_metric(Recording(model, analysis.motion), segments=[segments])
        curve = error_profile(fit, values=VALUES)
    except (ValueError, GeodesicOcpError) as failure:
        reason = str(failure).partition("\n")[0]
        warnings.warn(f"no joint inertia was fitted: {reason}", RuntimeWarning, stacklevel=2)
        return []
    unit = float(np.mean(inertia_scale(model)))
    return [
        {
            "curve": "geodesic",
            "joint_inertia_m_r2": value,
            "rms_error_rad": error,
            "m_r2_kg_m2": unit,
        }
        for value, error in zip(curve.values.tolist(), curve.errors[:, 0].tolist(), strict=True)
    ]


def inertia_table(profiles: DataFrame, confidence: float, seed: int) -> DataFrame:
    """Return the joint inertia of every subject, and the geometric mean over them.

    Args:
        profiles: rows of the table of profiles, with condition, height_m and mass_kg.
        confidence, seed: confidence of the intervals, and seed of the bootstrap over recordings.

    Returns:
        By curve, condition and subject. The estimate is NaN where the error is least at an end of
        the range.
    """
    from pandas import concat

    found = _estimates(profiles)
    ends = [f"{confidence:.0%} {end}" for end in ("low", "high")]
    intervals = [
        _interval(own, confidence, seed) for _, own in profiles.groupby(_KEYS, observed=True)
    ]
    for place, name, values in zip((5, 6), ends, zip(*intervals, strict=True), strict=True):
        found.insert(place, name, values)
    parts = []
    for key, own in found.groupby(level=_KEYS[:2], sort=False):
        if len(own) > 1:
            mean = _geometric_mean(own[_RELATIVE].to_numpy(), confidence)
            own.loc[(*key, "geometric mean"), [_RELATIVE, *ends]] = mean
        parts.append(own)
    table = concat(parts)
    note = [
        "Geodesics on the segments of the analysis. Intervals: of a subject, by bootstrap over the "
        "recordings; of the mean, by Student's t."
    ]
    if unknown := [*found.index[found[_RELATIVE].isna()].get_level_values("subject")]:
        note.append(
            f"Error least at an end of the range, {VALUES[0]:g} to {VALUES[-1]:g} m r^2: "
            f"{', '.join(unknown)}."
        )
    table.attrs["note"] = " ".join(note)
    return table


def _estimates(profiles: DataFrame) -> DataFrame:
    """Return the estimate of every subject, without intervals."""
    from pandas import DataFrame

    rows = {}
    for key, own in profiles.groupby(_KEYS, observed=True):
        curve = _profile(own)
        count = curve.errors.shape[1]
        unit = own["m_r2_kg_m2"].mean()
        value = float(minimizers(curve, np.ones((1, count)))[0, 0])
        value = value if 0.0 < value < np.inf else np.nan
        rows[key] = {
            "recordings": count,
            "height [m]": own["height_m"].mean(),
            "mass [kg]": own["mass_kg"].mean(),
            _UNIT: unit,
            _RELATIVE: value,
            _ABSOLUTE: value * unit,
            "rms error [rad]": float(np.interp(np.log(value), np.log(curve.values), curve.mean)),
        }
    found = DataFrame.from_dict(rows, orient="index").rename_axis(_KEYS)
    return found.astype({"recordings": "Int64"})


def _interval(own: DataFrame, confidence: float, seed: int) -> tuple[float, float]:
    """Return the percentile bootstrap interval of a subject; NaN below three recordings."""
    curve = _profile(own)
    count = curve.errors.shape[1]
    if count < FEWEST:
        return np.nan, np.nan
    units = [[k] for k in range(count)]
    weights, tails = resampled(units, "recording", _RESAMPLES, confidence, seed)
    ends = np.percentile(minimizers(curve, weights), tails, method="nearest")
    return float(ends[0]), float(ends[1])


def _profile(own: DataFrame) -> ErrorProfile:
    """Return the profile of one or more recordings.

    Raises:
        RecordingError: they were computed at different values of the joint inertia.
    """
    errors = own.pivot(index="joint_inertia_m_r2", columns="recording", values="rms_error_rad")
    if errors.isna().any(axis=None):
        raise RecordingError(
            f"{', '.join(map(str, errors.columns[:3]))}: profiles of a subject must have the same "
            "joint inertias"
        )
    values = errors.index.to_numpy(dtype=float)
    names = tuple(map(str, errors.columns))
    return ErrorProfile("joint_inertia", "m r^2", values, errors.to_numpy(), "rad", np.nan, names)


def _geometric_mean(values: Array, confidence: float) -> tuple[float, float, float]:
    """Return geometric mean and its interval by Student's t of the logarithms; NaN if unknown."""
    logs = np.log(values[np.isfinite(values)])
    if logs.size == 0:
        return np.nan, np.nan, np.nan
    spread = logs.std(ddof=1) if logs.size > 1 else np.nan
    half = student_half(spread, logs.size, confidence)
    low, middle, high = np.exp(logs.mean() + np.array([-half, 0.0, half])).tolist()
    return middle, low, high


def scaling_table(profiles: DataFrame, confidence: float) -> DataFrame:
    """Return the exponent b of joint inertia [kg m^2] ~ (m r^2)^b, and tests of what it is.

    Args:
        profiles: as for `inertia_table`, with a column assumed: whether height or mass is not
            known of the subject.
        confidence: confidence of the interval.

    Returns:
        By curve, condition and hypothesis; NaN with fewer than three subjects, or all alike.
    """
    from pandas import DataFrame

    found = _estimates(profiles)
    assumed = profiles.groupby(_KEYS, observed=True)["assumed"].any().to_numpy()
    found["known"] = found[_ABSOLUTE].notna() & ~assumed
    rows: list[dict[str, object]] = []
    for (curve, condition), own in found[found["known"]].groupby(level=_KEYS[:2], sort=False):
        x = np.log(own[_UNIT])
        y = np.log(own[_ABSOLUTE])
        count = len(own)
        slope = error = np.nan
        if count > 2 and np.ptp(x) > 0.0:
            line = scipy.stats.linregress(x, y)
            slope = line.slope
            error = line.stderr
        student = scipy.stats.t(max(count - 2, 1))
        half = student.ppf((1.0 + confidence) / 2.0) * error
        same = {"curve": curve, "condition": condition}
        for name, wanted in _HYPOTHESES.items():
            with np.errstate(divide="ignore", invalid="ignore"):  # without any error: p is 0
                t = np.abs(slope - wanted) / np.float64(error)
            rows.append(
                {
                    **(same | {"hypothesis": name, "subjects": count, "exponent": slope}),
                    f"{confidence:.0%} low": slope - half,
                    f"{confidence:.0%} high": slope + half,
                    "p": 2.0 * student.sf(t),
                }
            )
    columns = ["subjects", "exponent", *(f"{confidence:.0%} {end}" for end in ("low", "high")), "p"]
    table = DataFrame(rows, columns=["curve", "condition", "hypothesis", *columns])
    table = table.set_index(["curve", "condition", "hypothesis"])
    tested = table["p"].notna()
    table.loc[tested, "p, Holm"] = holm(table.loc[tested, "p"])
    note = [
        "Exponent b of joint inertia [kg m^2] ~ (m r^2)^b over subjects, by least squares of the "
        "logarithms. A small p speaks against the hypothesis."
    ]
    if left_out := dict.fromkeys(found.index[~found["known"]].get_level_values("subject")):
        note.append(
            f"Left out, as height, mass or joint inertia is not known: {', '.join(left_out)}."
        )
    if not tested.all() or table.empty:
        note.append("At least three subjects that differ in m r^2 are needed.")
    table.attrs["note"] = " ".join(note)
    return table
