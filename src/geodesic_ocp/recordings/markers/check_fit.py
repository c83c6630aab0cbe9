"""Whether a fit of markers is one, and what makes it doubtful."""

from __future__ import annotations

from geodesic_ocp.recordings.markers.marker_fit import NEAR, MarkerFit

# Bounds of this project's choice, see `MarkerFit.typical_error`: a recording by the Master Motor
# Map's set is fitted within 7 mm, without estimated offsets within 30 mm, one that is mirrored
# within 70 mm.
_NO_FIT = 0.04  # [m]
_MOST = 0.75  # share of the samples of markers that are lost
_SHORTEST, _TALLEST = 0.8, 2.4  # body heights that are believed if they are estimated [m]


def check_fit(fit: MarkerFit, estimated: bool) -> None:
    """Refuse a fit that is none; `estimated` says whether the height was.

    Raises:
        ValueError: the typical error is above 40 mm, markers are lost for three quarters of the
            time, or the body height is outside 0.8 to 2.4 m; names likely causes.
    """
    found = ""
    if fit.typical_error > _NO_FIT:
        found = (
            f"markers are typically {1e3 * fit.typical_error:.0f} mm from their places on "
            f"{fit.model.name!r}, {1e3 * NEAR:.0f} mm at most are usual"
        )
    elif fit.lost_share > _MOST:
        found = f"the markers are far from their places for {fit.lost_share:.0%} of the time"
    elif fit.height is not None and estimated and not _SHORTEST < fit.height < _TALLEST:
        found = f"the body height would be {fit.height:.2f} m, {fit.height_from}"
    if found:
        raise ValueError(f"the markers are not fitted: {found}. {_causes(fit)}")


def _causes(fit: MarkerFit) -> str:
    causes = ["the unit (Markers must be in m)"]
    if fit.base is None:
        causes.insert(
            0,
            "base='fixed' (which takes positions in the axes and from the origin of the model's "
            "base, the shoulder of an arm; for positions in a room give base='free' and markers of "
            "the thorax)",
        )
    causes += [
        "right and left exchanged, or axes that are left-handed",
        f"names that mean other places than in the marker set {fit.marker_set!r}",
    ]
    if fit.height is not None:
        causes.append("another height of the person (give height=...)")
    return "Check " + ", ".join(causes)
