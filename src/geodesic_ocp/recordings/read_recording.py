"""read_motion, read_markers and read_recording: files of joint angles and of markers."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from os import PathLike
from pathlib import Path
from typing import Any, get_args

from geodesic_ocp.arrays import as_integer, as_positive
from geodesic_ocp.errors import RecordingError
from geodesic_ocp.model.anthropometry import Side, Sides
from geodesic_ocp.model.human import (
    DEFAULT_HEIGHT,
    DEFAULT_MASS,
    as_stature,
    both_arms,
    human_arm,
    human_upper_body,
)
from geodesic_ocp.model.model import Model
from geodesic_ocp.recordings.conventions.segment_orientations import joint_angles
from geodesic_ocp.recordings.formats.recognise import FORMATS, recognise
from geodesic_ocp.recordings.markers.marker_fit import DOUBTFUL, MarkerFit
from geodesic_ocp.recordings.markers.marker_set import MarkerSet
from geodesic_ocp.recordings.markers.markers import (
    Axis,
    Markers,
    as_axis,
    check_plausible_size,
    with_z_up,
    without_gap_numbers,
)
from geodesic_ocp.recordings.markers.people import of_person
from geodesic_ocp.records import naming
from geodesic_ocp.trajectory.files.angle_tables import noted_doubts
from geodesic_ocp.trajectory.files.series import Gaps, without_gaps
from geodesic_ocp.trajectory.files.text_lines import named_failures
from geodesic_ocp.trajectory.motion import Motion, Subject
from geodesic_ocp.trajectory.recording import (
    Recording,
    check_radians,
    prepared,
)


def read_markers(
    path: str | PathLike[str], *, up: Axis | None = None, person: str | None = None
) -> Markers:
    """Read the positions of markers from a file: c3d, TRC, CSV of Vicon Nexus, TSV of Qualisys,
    Motion-BIDS, or a table with NAME_x, NAME_y, NAME_z.

    The content of the file tells its format. Positions are converted to metres, in the axes of
    the file unless `up` is given; a marker that was not seen is NaN. So is one at a position that
    is far away in any unit, or that is repeated exactly and to which the marker jumps and back; a
    RuntimeWarning names the latter.

    >>> import tempfile
    >>> from pathlib import Path
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "markers.csv"
    ...     _ = file.write_text('''# unit: m
    ... time,RSHO_x,RSHO_y,RSHO_z
    ... 0,0.2,0,1.4
    ... 0.1,0.2,0,1.5''')
    ...     markers = go.recordings.read_markers(file)
    >>> markers.names, markers.positions.shape
    (('RSHO',), (2, 1, 3))

    Args:
        path: path of the file.
        up: the axis of the file that points upwards, such as "y" or "-z"; the space is turned so
            that it becomes z, which `fit_markers` needs. Formats leave it open: TRC files for
            OpenSim mostly have y up, c3d files z.
        person: person in a file with the markers of several, by the prefix of their labels, such as
            "Ann" of "Ann:RSHO"; by default the first, with a warning that names the others. Names
            in the result are without the prefix.

    Raises:
        RecordingError: the file is missing, of an unknown format, or malformed, has no such person,
            or its positions are not those of a person in the unit that it states; the message names
            the file, the line or frame, and what was expected there.
        ValueError: `up` is not an axis.
    """
    file = Path(path)
    if up is not None:
        as_axis(up)
    with named_failures(file):
        kind = recognise(file)
        if FORMATS[kind].content != "markers":
            raise RecordingError(
                f"{file}: {FORMATS[kind].label} has no markers; read it with go.read_motion"
            )
        markers = of_person(FORMATS[kind].read(file), person, str(file))
        markers, gaps = without_gap_numbers(markers)
        if gaps:
            warnings.warn(
                f"{file}: gaps, as the markers jump there to a place and back: {gaps}",
                RuntimeWarning,
                stacklevel=2,
            )
        check_plausible_size(markers)
    return markers if up is None else with_z_up(markers, up)


def read_motion(
    path: str | PathLike[str],
    joints: Sequence[str] | None = None,
    *,
    convention: Any = None,
    skeleton: str | PathLike[str] | None = None,
    rate: float | None = None,
    unit: str | float | None = None,
    up: Axis | None = None,
    columns: Any = None,
    fill: float | None = None,
    part: int | None = None,
    degrees_in: bool | None = None,
) -> Motion:
    """Read a recorded motion from a file, whose format its content tells, not its suffix.

    The formats are MMM XML of both layouts, tables of comma-separated values, ASF/AMC, BVH, Xsens
    MVNX, OpenSim's .mot and .sto, joint angles in Motion-BIDS, and .npz as in AMASS. The angles of
    the first two are those in the file, as are those of OpenSim and Motion-BIDS in no known
    convention; others are converted through the orientations of the segments to the joints of
    `human_arm` and of the trunk.

    >>> from importlib.resources import files
    >>> motion = go.read_motion(files("geodesic_ocp") / "data" / "climb.csv")
    >>> len(motion), motion.joint_names[:3]
    (840, ('LSx_joint', 'LSz_joint', 'LSy_joint'))

    Args:
        path: path of the file.
        joints: names of the joints to read, in the order of the result; all by default.
        convention: convention of the joint angles of an OpenSim file, which may be the file of its
            model (.osim), or of the skeleton of an AMC, BVH, MVNX or .npz file; by default the
            known one that fits the names in the file.
        skeleton: file (.asf) that belongs to an AMC file; by default the one beside it.
        rate: sampling rate [Hz], where the file has neither a rate nor times; 120 Hz by default of
            an AMC file.
        unit: unit of lengths in a BVH or AMC file: "m", "cm", "mm", "in" or a number of metres.
        up: the axis that points upwards in the space of a skeleton, such as "y" or "-z".
        columns: which columns of a table are which joints: by joint the name of a column, or a
            `Column` with sign, unit and offset; or a CSV file ours,theirs,sign,unit,offset.
        fill: longest gap that is bridged [s]: empty cells, nan, or numbers that stand for a gap,
            such as rows of zeros, to which joints jump and back; none by default.
        part: number of a part, from 1, between longer gaps.
        degrees_in: whether the angles of a table or an OpenSim file that does not say their unit
            are in degrees.

    What the file says comes before `rate` and `degrees_in`; a warning names the difference.

    Raises:
        RecordingError: the file is missing, of an unknown format, or malformed, it has gaps that
            are not bridged and no part between them is asked for, or its angles look like degrees
            though they should be radians; the message names the file, the line or element, and
            what was expected there.
        ValueError: an argument that does not apply to files of this format.
    """
    file = Path(path)
    if joints is not None and (isinstance(joints, str) or not joints):
        raise ValueError(f"joints must be a sequence of names or None, got {joints!r}")
    with named_failures(file):
        kind = recognise(file)
    if FORMATS[kind].content == "markers":
        raise RecordingError(
            f"{file}: {FORMATS[kind].label} has markers, not joint angles; read it with "
            "go.recordings.read_markers, and compute angles with go.recordings.fit_markers"
        )
    arguments = {"convention": convention, "skeleton": skeleton, "rate": rate, "unit": unit}
    arguments |= {"up": up, "columns": columns, "fill": fill, "part": part}
    arguments["degrees_in"] = degrees_in
    given = {name: value for name, value in arguments.items() if value is not None}
    check_stated(file, kind, given)
    own = {name: value for name, value in given.items() if name in FORMATS[kind].arguments}
    files = {name: given.get(name) for name in ("columns", "convention", "skeleton")}
    with naming(**files), named_failures(file):
        if FORMATS[kind].content == "segments":
            motion = joint_angles(FORMATS[kind].read(file, **own), joints)
        else:
            motion = FORMATS[kind].read(file, joints, **own)
        if "fill" not in FORMATS[kind].arguments:  # readers of columns leave out gaps themselves
            motion = without_gaps(file, motion, fill=fill, part=part)
        if kind in ("mmm", "table"):  # of others the unit of the columns is stated
            check_radians(motion.joint_names, motion.q)
        return replace(motion, doubts=noted_doubts(file)) if kind == "table" else motion


def check_stated(file: Path, kind: str, names: Iterable[str]) -> None:
    """Raise ValueError if arguments of these names do not apply to files of this format."""
    for name in names:
        if name not in FORMATS[kind].applicable:
            others = " and ".join(e.label for e in FORMATS.values() if name in e.applicable)
            raise ValueError(f"{name} is for {others}; {file} is {FORMATS[kind].label}")


def that_apply(file: Path, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """Return the arguments of `read_recording` that apply to the format of the file.

    For files of several formats; of a file that cannot be recognised, none.
    """
    try:
        kind = recognise(file)
    except (RecordingError, OSError):
        return {}
    return {name: value for name, value in arguments.items() if name in FORMATS[kind].applicable}


def read_recording(
    path: str | PathLike[str],
    side: Sides = "right",
    *,
    height: float | None = None,
    mass: float | None = None,
    armature: float = 0.0,
    resample: float | None = None,
    cutoff: float | None = None,
    duration: float | None = None,
    unfiltered: bool = False,
    convention: Any = None,
    unit: str | float | None = None,
    rate: float | None = None,
    skeleton: str | PathLike[str] | None = None,
    up: Axis | None = None,
    marker_set: MarkerSet | str | PathLike[str] | None = None,
    person: str | None = None,
    columns: Any = None,
    fill: float | None = None,
    part: int | None = None,
    degrees_in: bool | None = None,
) -> Recording:
    """Read a recording of one or both human arms, filter it, and scale a model to the person.

    >>> from importlib.resources import files
    >>> go.read_recording(files("geodesic_ocp") / "data" / "climb.csv", "left").name
    'climb, left'

    Args:
        path: path of the file, in any format of `read_motion`, or of markers (`read_markers`), to
            which the motion is fitted, with the lengths of the arm (`fit_markers`).
        side: "right", "left", or "both" as one model: `human_upper_body` where the recording has
            the trunk's joints, otherwise both arms beside each other (`combine`).
        height: height of the person [m]; by default that in the file, or of the markers, or 1.75 m.
        mass: mass of the person [kg]; by default that in the file, or 70 kg.
        armature: joint inertia of every joint of the arm [kg m^2].
        resample: interpolate at this rate first [Hz], for samples that are not evenly spaced.
        cutoff: cutoff of the filter [Hz], see `Motion.filtered`; chosen for each file by default.
        duration: duration of the window of a Savitzky-Golay filter [s], instead of a cut-off.
        unfiltered: take the motion as it is, with the velocities of a cubic spline; so are motions
            fitted to markers, which the fit has smoothed, unless a filter is given.
        convention, unit, rate, skeleton, degrees_in: where the file does not give them, see
            `read_motion`.
        up: the axis that points upwards in a file of markers or of a skeleton.
        marker_set: where the markers are, or a file that says so, see `fit_markers`.
        person: person in a file with the markers of several, see `read_markers`.
        columns, fill, part: columns of a table, and gaps, see `read_motion`.

    Raises:
        RecordingError: the file cannot be read or has no arm of that side.
        ValueError: the motion is implausible, too short or uneven for the filter, or a number is
            out of range.
        NotConverged: no motion was fitted to the markers.
    """
    numbers = {"height": height, "mass": mass, "cutoff": cutoff, "duration": duration}
    numbers["fill"] = fill
    if part is not None:
        as_integer("part", part, 1)
    check_arguments(side, up, numbers, unfiltered=unfiltered)
    file = Path(path)
    stated = {"convention": convention, "unit": unit, "rate": rate, "skeleton": skeleton}
    stated |= {"columns": columns, "fill": fill, "part": part, "degrees_in": degrees_in}
    of_markers = {"up": up, "marker_set": marker_set}
    with named_failures(file):
        kind = recognise(file)
    every = stated | of_markers | {"person": person}
    check_stated(file, kind, [name for name, each in every.items() if each is not None])
    if FORMATS[kind].content == "markers":
        markers = read_markers(file, person=person)
        arm = _arm_of(markers.subject, file, side, height, mass, armature)
        fit = _fitted(file, arm, markers, height, of_markers)
        arm = fit.model
        motion = fit.motion
        if cutoff is None and duration is None:
            unfiltered = True  # the fit has smoothed it
    else:
        fit = None
        motion = _motion_of(file, side, stated | {"up": up})
        has_trunk = "BPx_joint" in motion.joint_names
        arm = _arm_of(motion.subject, file, side, height, mass, armature, has_trunk)
    with named_failures(file):
        motion = prepared(
            arm,
            motion,
            str(file),
            resample=resample,
            cutoff=cutoff,
            duration=duration,
            unfiltered=unfiltered,
        )
    name = file.stem if part is None else f"{file.stem}, part {part}"
    name = name if person is None else f"{name}, {person}"
    return Recording(arm, motion, f"{name}, {side}", motion.subject.name, fit)


def _motion_of(file: Path, side: Sides, stated: dict[str, Any]) -> Motion:
    """Return the joints of an arm, or of both, with those of the trunk if the file has them."""
    if side != "both":
        return read_motion(file, human_arm(side).joint_names, **stated)
    try:
        return read_motion(file, human_upper_body().joint_names, **stated)
    except Gaps:
        raise
    except RecordingError:
        names = [name for each in get_args(Side) for name in human_arm(each).joint_names]
        return read_motion(file, names, **stated)


def check_arguments(
    side: Sides,
    up: Axis | None,
    numbers: Mapping[str, Any],
    *,
    unfiltered: bool = False,
) -> None:
    """Check arguments of `read_recording` that do not depend on the file.

    Args:
        side: "right", "left" or "both".
        up: axis that points upwards, or None.
        numbers: height, mass, cutoff and duration.
        unfiltered: whether the motion is not to be filtered.

    Raises:
        ValueError: another side or axis, a number that is not positive, or several filters.
    """
    units = {"cutoff": "Hz", "duration": "s", "height": "m", "mass": "kg", "fill": "s"}
    given = [name for name in units if numbers.get(name) is not None]
    for name in given:
        as_positive(name, numbers[name], units[name])
    filters = [
        f"{numbers[name]:g} {units[name]}" for name in given if name in ("cutoff", "duration")
    ]
    if len(filters) + unfiltered > 1:
        allowed = "cutoff, duration and unfiltered" if unfiltered else "cutoff and duration"
        raise ValueError(f"give only one of {allowed}, got {' and '.join(filters)}")
    if side != "both":
        human_arm(side)  # raises for another side
    if up is not None:
        as_axis(up)


def _arm_of(
    subject: Subject,
    file: Path,
    side: Sides,
    height: float | None,
    mass: float | None,
    armature: float,
    has_trunk: bool = True,
) -> Model:
    """Return the arm of the person, or both, with the trunk if it is known.

    Raises:
        ValueError: a height or mass that no person has.
    """
    stature = stature_of(subject, height, mass)
    try:
        as_stature(*stature)
    except ValueError as error:
        if height is None and mass is None:
            raise RecordingError(f"{file}: {error}") from None
        raise
    return _arm(side, *stature, armature, has_trunk)


def _fitted(
    file: Path, arm: Model, markers: Markers, height: float | None, of_markers: dict[str, Any]
) -> MarkerFit:
    """Return the motion that is fitted to the markers, and the arm with the person's lengths."""
    from geodesic_ocp.recordings.markers.fit_markers import fit_markers

    used = naming(marker_set=of_markers["marker_set"])
    with used, named_failures(file), warnings.catch_warnings():
        warnings.filterwarnings("ignore", DOUBTFUL, RuntimeWarning)  # named below
        fit = fit_markers(arm, markers, height=height, **of_markers)
    if fit.doubts:
        warnings.warn(f"{file}: {'; '.join(fit.doubts)}", RuntimeWarning, stacklevel=3)
    return fit


@lru_cache(maxsize=8)  # recordings of one person share the arm and what was compiled for it
def _arm(side: Sides, height: float, mass: float, armature: float, has_trunk: bool) -> Model:
    if side != "both":
        return human_arm(side, height, mass, armature=armature)
    if has_trunk:
        return human_upper_body(height, mass, armature=armature)
    arms = [human_arm(each, height, mass, armature=armature) for each in get_args(Side)]
    return both_arms(arms, height)


def stature_of(
    subject: Subject, height: float | None = None, mass: float | None = None
) -> tuple[float, float]:
    """Return height [m] and mass [kg] of a person: those given, or the file's, or the defaults."""
    height = height if height is not None else subject.height
    mass = mass if mass is not None else subject.mass
    return (
        DEFAULT_HEIGHT if height is None else height,
        DEFAULT_MASS if mass is None else mass,
    )
