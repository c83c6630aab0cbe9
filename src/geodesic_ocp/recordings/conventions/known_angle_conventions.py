"""How a table of angles is read: conventions that are built in, and those in files.

All that are built in have the axes x forward, y up, z right.

isb: the recommendation of the International Society of Biomechanics (Wu et al., Journal of
    Biomechanics 38, 2005, 981-992): thorax to upper arm Y-X-Y (plane of elevation, elevation,
    which is negative, and axial rotation), elbow and wrist Z-X-Y. As there, angles of the left
    side are those of the mirrored right side. The recommendation names no columns.
opensim_upper_limb: the right arm of Holzbaur et al. (Annals of Biomedical Engineering 33, 2005,
    829-840) and Saul et al. (Computer Methods in Biomechanics and Biomedical Engineering 18, 2015,
    1445-1458). Its shoulder turns by elv_angle, shoulder_elv, -elv_angle and shoulder_rot, relative
    to the thorax, as the model takes back the rotations of clavicle and scapula.
opensim_full_body: the arms and trunk of Hamner et al. (Journal of Biomechanics 43, 2010, 2709-2716)
    and Rajagopal et al. (IEEE Transactions on Biomedical Engineering 63, 2016, 2068-2079).
"""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from geodesic_ocp.arrays import as_choice
from geodesic_ocp.recordings.conventions.angle_convention import (
    AngleConvention,
    AxisRotation,
    SegmentRelation,
    mirrored,
)
from geodesic_ocp.recordings.conventions.continuous_angles import direction
from geodesic_ocp.recordings.conventions.osim_convention import OsimConvention
from geodesic_ocp.records import decoding, from_record, read_structured

Axis = tuple[float, float, float]

# In zero position, forearm and hand of ISB and of the full-body models have the palm forward.
_PALM_INWARDS = AxisRotation("y", offset=-90.0)


def _along(axis: Axis) -> AxisRotation:
    """Return the smallest rotation of y into an axis: of the forearm into the axis of pronation."""
    across = np.cross([0.0, 1.0, 0.0], direction(axis))
    angle = float(np.degrees(np.arcsin(np.linalg.norm(across))))
    return AxisRotation((across[0], across[1], across[2]), offset=angle)


def _turns(*columns: tuple[str | Axis, str]) -> tuple[AxisRotation, ...]:
    """Return the rotations about axes by columns, one after the other."""
    return tuple(AxisRotation(axis, column) for axis, column in columns)


def _both(right: tuple[SegmentRelation, ...]) -> tuple[SegmentRelation, ...]:
    return right + tuple(mirrored(relation) for relation in right)


_ISB_ARM = (
    SegmentRelation(
        "right upper arm",
        "thorax",
        _turns(("y", "plane_of_elevation_r"), ("x", "elevation_r"), ("y", "axial_rotation_r")),
    ),
    SegmentRelation(
        "right forearm",
        "right upper arm",
        (
            AxisRotation("z", "elbow_flexion_r"),
            AxisRotation("x", "carrying_angle_r", optional=True),
            AxisRotation("y", "pronation_r"),
        ),
        (_PALM_INWARDS,),
    ),
    SegmentRelation(
        "right hand",
        "right forearm",
        (
            AxisRotation("z", "wrist_flexion_r"),
            AxisRotation("x", "wrist_deviation_r"),
            AxisRotation("y", "wrist_rotation_r", optional=True),
        ),
        (_PALM_INWARDS,),
    ),
)
ISB = AngleConvention(
    "isb",
    (
        SegmentRelation(
            "thorax",
            None,
            _turns(
                ("z", "thorax_extension"),
                ("x", "thorax_lateral_flexion"),
                ("y", "thorax_axial_rotation"),
            ),
        ),
        *_both(_ISB_ARM),
    ),
    source="Wu et al., Journal of Biomechanics 38 (2005) 981-992",
)

_PLANE: Axis = (0.00479995, 0.999089, 0.0423995)
_ELEVATION: Axis = (-0.998261, 0.00229991, 0.0588977)
_PRONATION: Axis = (-0.017161, 0.992666, -0.119668)
OPENSIM_UPPER_LIMB = AngleConvention(
    "opensim_upper_limb",
    (
        SegmentRelation("thorax"),
        SegmentRelation(
            "right upper arm",
            "thorax",
            (
                AxisRotation(_PLANE, "elv_angle"),
                AxisRotation(_ELEVATION, "shoulder_elv"),
                AxisRotation(_PLANE, "elv_angle", sign=-1.0),
                AxisRotation(_PLANE, "shoulder_rot"),
            ),
        ),
        SegmentRelation(
            "right forearm",
            "right upper arm",
            _turns(((0.0494004, 0.0366003, 0.998108), "elbow_flexion"), (_PRONATION, "pro_sup")),
            (_along(_PRONATION),),
        ),
        SegmentRelation(
            "right hand",
            "right forearm",
            _turns(("z", "deviation"), ("x", "flexion")),
            refusal=(
                "the axes and the sense of the columns deviation and flexion differ between "
                "published versions of this model; give your model's in a convention of your own"
            ),
        ),
    ),
    source=(
        "Holzbaur et al., Annals of Biomedical Engineering 33 (2005) 829-840; Saul et al., Computer"
        " Methods in Biomechanics and Biomedical Engineering 18 (2015) 1445-1458"
    ),
)

_RADIUS: Axis = (0.0563981, 0.998406, 0.00195171)
_FULL_BODY_ARM = (
    SegmentRelation(
        "right upper arm",
        "thorax",
        _turns(("z", "arm_flex_r"), ("x", "arm_add_r"), ("y", "arm_rot_r")),
    ),
    SegmentRelation(
        "right forearm",
        "right upper arm",
        _turns(((0.226047, 0.022269, 0.973862), "elbow_flex_r"), (_RADIUS, "pro_sup_r")),
        (_along(_RADIUS), _PALM_INWARDS),
    ),
    SegmentRelation(
        "right hand",
        "right forearm",
        _turns(("z", "wrist_flex_r"), ("x", "wrist_dev_r")),
        (_PALM_INWARDS,),
    ),
)
OPENSIM_FULL_BODY = AngleConvention(
    "opensim_full_body",
    (
        SegmentRelation(
            "pelvis",
            None,
            _turns(("z", "pelvis_tilt"), ("x", "pelvis_list"), ("y", "pelvis_rotation")),
        ),
        SegmentRelation(
            "thorax",
            "pelvis",
            _turns(("z", "lumbar_extension"), ("x", "lumbar_bending"), ("y", "lumbar_rotation")),
        ),
        *_both(_FULL_BODY_ARM),
    ),
    source=(
        "Hamner et al., Journal of Biomechanics 43 (2010) 2709-2716; Rajagopal et al., IEEE "
        "Transactions on Biomedical Engineering 63 (2016) 2068-2079"
    ),
    position=("pelvis_tx", "pelvis_ty", "pelvis_tz"),
    # of the model before it is scaled to a person
    offsets={"pelvis": (-0.1007, 0.0815, 0.0), "thorax": (0.003155, 0.3715, 0.0)},
)

ANGLE_CONVENTIONS = {
    convention.name: convention for convention in (ISB, OPENSIM_UPPER_LIMB, OPENSIM_FULL_BODY)
}


def as_convention(
    given: AngleConvention | OsimConvention | str | Path | None,
) -> AngleConvention | OsimConvention | None:
    """Return the convention itself, the built-in one of this name, or the one in a file.

    A file is a model (.osim), or one in JSON or TOML that has the attributes of an OsimConvention
    or of AngleConvention, SegmentRelation and AxisRotation as keys:

        {"model": "arm.osim", "bodies": {"thorax": "base"}, "neutral": {"pro_sup": 90}}

        {"name": "mine", "extends": "opensim_upper_limb", "relations": [
            {"segment": "right hand", "parent": "right forearm", "rotations": [
                {"axis": "-z", "column": "deviation"}, {"axis": "x", "column": "flexion"}]}]}

    A relative path of the model is one from the folder of the file. With "extends", the relations
    of a built-in convention precede those in the file, which replace those of the same segment.

    Raises:
        RecordingError: the file is missing or malformed, or its keys or values are others.
        ValueError: the argument is neither a convention, nor the name of one, nor a path.
    """
    if given is None or isinstance(given, (AngleConvention, OsimConvention)):
        return given
    known = ", ".join(ANGLE_CONVENTIONS)
    if not isinstance(given, (str, Path)):
        raise ValueError(
            f"convention must be an AngleConvention, one of {known}, or a file, got {given!r}"
        )
    if str(given) in ANGLE_CONVENTIONS:
        return ANGLE_CONVENTIONS[str(given)]
    file = Path(given)
    if file.suffix.lower() == ".osim":
        return OsimConvention(file)
    record = read_structured(file, "convention", f"; built-in conventions are {known}")
    with decoding(file):
        if not isinstance(record, dict) or "model" not in record:
            return _angle_convention(file.stem, record)
        found = from_record(OsimConvention, "the convention of a model", record)
        return replace(found, model=file.parent / found.model)


def _angle_convention(name: str, record: Any) -> AngleConvention:
    defaults: dict[str, Any] = {"relations": ()}
    if isinstance(record, dict) and "extends" in record:
        known = ANGLE_CONVENTIONS[as_choice("extends", record["extends"], ANGLE_CONVENTIONS)]
        defaults = {each.name: getattr(known, each.name) for each in fields(known)}
        record = {key: value for key, value in record.items() if key != "extends"}

    def relations(entries: list[Any]) -> tuple[SegmentRelation, ...]:
        own = (
            from_record(
                SegmentRelation, "a relation", each, rotations=_rotations, neutral=_rotations
            )
            for each in entries
        )
        return tuple({each.segment: each for each in (*defaults["relations"], *own)}.values())

    defaults["name"] = name
    return from_record(AngleConvention, "a convention", record, defaults, relations=relations)


def _rotations(entries: list[Any]) -> tuple[AxisRotation, ...]:
    return tuple(from_record(AxisRotation, "a rotation", each) for each in entries)
