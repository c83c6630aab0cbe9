"""KnownHeight: what is known of the person's height before the fit."""

from __future__ import annotations

from dataclasses import dataclass

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.recordings.markers.markers import Markers
from geodesic_ocp.recordings.markers.program.body import MarkedBody
from geodesic_ocp.recordings.markers.program.fit_settings import HEIGHT_SPREAD, FitSettings
from geodesic_ocp.recordings.markers.standing_height import standing_height

_TALLEST = 3.0  # [m]


@dataclass(frozen=True)
class KnownHeight:
    """What is known of the person's height before the fit.

    Attributes:
        factor: from the model's height to the person's.
        spread: standard deviation of the factor that is estimated; 0 if the factor is kept.
        origin: where it was taken from, in words.
    """

    factor: float
    spread: float
    origin: str


def known_height(
    body: MarkedBody, positions: Markers, height: float | None, settings: FitSettings
) -> KnownHeight:
    """The height that is given, of the recording's subject, of a standing person or of the model.

    Raises:
        ValueError: a height for a model that is not of a person, or not a height.
    """
    if body.height is None:
        if height is not None:
            raise ValueError(f"height is for models of people, not for {body.model.name!r}")
        return KnownHeight(1.0, 0.0, "")
    if height is not None:
        if as_positive("height", height, "m") > _TALLEST:
            in_cm = "; is it in cm?" if 50.0 < height < 100.0 * _TALLEST else ""
            raise ValueError(f"height must be at most {_TALLEST:g} m, got {height:g} m{in_cm}")
        return KnownHeight(height / body.height, 0.0, "as given")
    if positions.subject.height is not None:
        return KnownHeight(
            positions.subject.height / body.height, 0.0, "of the recording's subject"
        )
    if not settings.lengths:
        return KnownHeight(1.0, 0.0, "of the model")
    standing = standing_height(positions) if settings.base == "free" else None
    if standing is not None:
        return KnownHeight(standing / body.height, 0.0, "from the markers of head and feet")
    return KnownHeight(1.0, HEIGHT_SPREAD, "from lengths of segments, by the model's proportions")
