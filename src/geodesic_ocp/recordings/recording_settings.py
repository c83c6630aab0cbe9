"""RecordingSettings: the person in a recording, and what its file leaves open."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from geodesic_ocp.arrays import as_positive
from geodesic_ocp.recordings.conventions.known_angle_conventions import ANGLE_CONVENTIONS
from geodesic_ocp.recordings.markers.marker_set import check_known
from geodesic_ocp.recordings.markers.markers import Axis, as_axis


@dataclass(frozen=True)
class RecordingSettings:
    """Facts about a recording that its file may not state; None: the file or a default decides.

    Attributes:
        height: height of the person [m]; default: the recording's, or 1.75 m.
        mass: body mass of the person [kg]; default: the recording's, or 70 kg.
        convention: convention of the joint angles (.mot, .sto): a name, a file, or the model's file
            (.osim); of a skeleton (.amc, .bvh, .npz): a file; default: the known convention that
            fits.
        unit: unit of lengths in .bvh and .amc files: m, cm, mm, in, or a number of metres.
        skeleton: skeleton of .amc files (.asf); default: the file beside each.
        up: axis that points upwards in files of markers or of a skeleton: x, y, z, or the opposite,
            as in --up=-y.
        marker_set: file that says where the markers are (.json, .toml), or the name of a known set,
            such as HALPE_26; default: the known set that fits.
        person: person in a file with the markers of several, by the prefix of their labels, as in
            Ann:RSHO; default: the first.
        sample_rate: sampling rate of files that have neither a rate nor times [Hz]; default: 120 Hz
            of .amc files, none of others.
        degrees_in: whether angles in tables and .mot and .sto files that do not say their unit are
            in degrees.
        columns: file (.csv) that says which columns of a table are which joints; its columns are
            ours, theirs, sign, unit and offset.
        fill: longest gap that is bridged [s]; of many recordings, parts between longer ones are
            recordings of their own; default: no gap may be.
        part: number of a part between longer gaps, from 1.

    Raises:
        ValueError: a number that is not positive, an unknown axis, or a file that does not exist.
    """

    height: float | None = None
    mass: float | None = None
    convention: str | None = None
    unit: float | str | None = None
    skeleton: str | None = None
    up: Axis | None = None
    marker_set: str | None = None
    person: str | None = None
    sample_rate: float | None = None
    degrees_in: bool | None = None
    columns: str | None = None
    fill: float | None = None
    part: int | None = None

    def __post_init__(self) -> None:
        self._check_positive(height="m", mass="kg", sample_rate="Hz", fill="s")
        for name in ("skeleton", "columns"):
            file = getattr(self, name)
            if file is not None and not Path(file).is_file():
                raise ValueError(f"{name}: there is no file {file!r}")
        if self.marker_set is not None:
            check_known(self.marker_set)
        named = self.convention is None or self.convention in ANGLE_CONVENTIONS
        if self.convention is not None and not named and not Path(self.convention).is_file():
            raise ValueError(
                f"convention: {self.convention!r} is neither a file nor one of the built-in "
                f"conventions, which are {', '.join(ANGLE_CONVENTIONS)}"
            )
        if self.up is not None:
            as_axis(self.up)

    def _check_positive(self, **units: str) -> None:
        for name, unit in units.items():
            if (number := getattr(self, name)) is not None:
                as_positive(name, number, unit)

    def reading(self) -> dict[str, Any]:
        """Return the arguments of `read_recording` about the format of the file."""
        others = ("height", "mass", "sample_rate")
        names = (each.name for each in fields(RecordingSettings) if each.name not in others)
        return {name: getattr(self, name) for name in names} | {"rate": self.sample_rate}
