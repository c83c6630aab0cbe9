"""Body segments of a person: their tables, and the segments in a model.

"winter" is the reference model of the Master Motor Map (Terlemez et al., "Master Motor Map
(MMM)...", Humanoids 2014), whose masses and centres of mass are those of Winter (*Biomechanics and
Motor Control of Human Movement*). "de_leva" is de Leva, "Adjustments to Zatsiorsky-Seluyanov's
segment inertia parameters", J. Biomech. 29 (1996), 1223-1230, table 4, which differs by sex.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Literal, get_args

import numpy as np

from geodesic_ocp.arrays import Array, as_choice
from geodesic_ocp.model.joints import frame_index
from geodesic_ocp.model.model import Model
from geodesic_ocp.model.primitives import Capsule

Side = Literal["right", "left"]
Sides = Literal["right", "left", "both"]
TableName = Literal["winter", "de_leva"]
Sex = Literal["male", "female"]
# Winter's, to the fingertips; that of de Leva ends at the third metacarpal.
_HAND_LENGTH = 0.108  # [height]
_FITS = 0.1  # [length of the segment], by which a capsule's end may miss a joint


@dataclass(frozen=True)
class Segment:
    """A segment per unit of body height and mass; the origin is the proximal joint.

    Axes with the arm hanging and the palm towards the body: x to the right, y forward, z up.
    """

    mass: float  # [body mass]
    centre: tuple[float, float, float]  # of mass [height]
    inertia: tuple[float, float, float]  # about the centre of mass [body mass * height^2]
    length: float = 0.0  # to the next joint, of the hand to the fingertips [height]


@dataclass(frozen=True)
class Trunk:
    """Abdomen and thorax per unit of body height and mass; each originates at its lower joint."""

    pelvis: float  # from the pelvis to the lumbar joint [height]
    half_width: float  # from the point midway between the shoulders to one of them [height]
    head: tuple[float, float]  # lower and upper end, above that point [height]
    abdomen: Segment
    thorax: Segment  # to that point
    on_thorax: tuple[Segment, ...]  # clavicles, neck and head, in the axes and origin of the thorax


def anthropometry(side: Side, table: TableName, sex: Sex | None) -> tuple[Segment, ...]:
    """Return upper arm, forearm and hand of a table for one arm.

    Raises:
        ValueError: an unknown table or sex, a missing sex for the table of de Leva, or a sex for
            the table of Winter, which does not differ by sex.
    """
    as_choice("table", table, get_args(TableName))
    if table == "winter":
        if sex is not None:
            raise ValueError("the table 'winter' does not differ by sex; omit sex")
        return _winter(side)
    if sex is None or sex not in get_args(Sex):
        raise ValueError(f"the table 'de_leva' needs sex='male' or 'female', got {sex!r}")
    return _de_leva(sex)


def _winter(side: Side) -> tuple[Segment, ...]:
    # In the source, the x offset of the left centres of mass is 1e-14: rounding, set to zero.
    x, y = {"right": (2.03848e-5, 3.81383e-8), "left": (0.0, 3.81383e-8)}[side]
    hand = {
        "right": (5.18800e-6, 3.90222e-6, 1.41993e-6),
        "left": (5.19630e-6, 3.91221e-6, 1.41814e-6),
    }[side]
    return (
        Segment(0.027, (x, y, -0.082), (5.90063e-5, 5.90086e-5, 3.96211e-6), 0.188),
        Segment(0.016, (x, y, -0.0624), (2.35586e-5, 2.33400e-5, 1.50684e-6), 0.145),
        Segment(0.006, (x, y, -0.0546), hand, _HAND_LENGTH),
    )


def trunk() -> Trunk:
    """Return trunk, neck and head of the reference model of the Master Motor Map.

    In the source the y offset of the centres of mass is 3e-11: rounding, set to zero.
    """
    thorax = 0.188
    half_width = 0.110
    clavicle = half_width - 0.010
    return Trunk(
        pelvis=0.040,
        half_width=half_width,
        head=(0.052, 0.182),
        abdomen=Segment(0.1, (0.0, 0.0, 0.0264), (1.07917e-4, 1.07917e-4, 7.74494e-5), 0.060),
        thorax=Segment(0.17, (0.0, 0.0, 0.15416), (6.62659e-4, 8.31018e-4, 4.69138e-4), thorax),
        on_thorax=(
            Segment(0.021, (clavicle, 0.0, thorax), (4.07431e-6, 5.50730e-6, 5.18568e-6)),
            Segment(0.021, (-clavicle, 0.0, thorax), (4.09202e-6, 5.53935e-6, 5.20945e-6)),
            Segment(0.024, (0.0, 0.0, thorax + 0.037), (4.97440e-6, 4.79695e-6, 3.81092e-6)),
            Segment(0.07, (0.0, 0.0, thorax + 0.117), (9.92468e-5, 9.68844e-5, 4.55261e-5)),
        ),
    )


# As printed: mean stature [mm]; of upper arm, forearm and hand (to the third metacarpale): length
# [mm], mass [% of body mass], centre of mass from the proximal end [% of length], and sagittal,
# transverse and longitudinal radius of gyration [% of length].
_STATURE = {"male": 1741.0, "female": 1735.0}
_DE_LEVA = {
    "male": (
        (281.7, 2.71, 57.72, 28.5, 26.9, 15.8),
        (268.9, 1.62, 45.74, 27.6, 26.5, 12.1),
        (86.2, 0.61, 79.00, 62.8, 51.3, 40.1),
    ),
    "female": (
        (275.1, 2.55, 57.54, 27.8, 26.0, 14.8),
        (264.3, 1.38, 45.59, 26.1, 25.7, 9.4),
        (78.0, 0.56, 74.74, 53.1, 45.4, 33.5),
    ),
}


def _de_leva(sex: Sex) -> tuple[Segment, ...]:
    """Return segments of the mean lengths, in proportion to stature.

    The sagittal axis points from back to front in the anatomical position, with the palm forward.
    Here the palm faces the body: the sagittal axis of hand and forearm is x, that of the upper arm,
    which does not rotate with the palm, is y.
    """
    segments = []
    tips = (None, None, _HAND_LENGTH)
    for row, rotates_with_palm, tip in zip(_DE_LEVA[sex], (False, True, True), tips, strict=True):
        length = row[0] / _STATURE[sex]
        mass = row[1] / 100.0
        sagittal, transverse, z = (mass * (radius / 100.0 * length) ** 2 for radius in row[3:])
        x, y = (sagittal, transverse) if rotates_with_palm else (transverse, sagittal)
        centre = (0.0, 0.0, -row[2] / 100.0 * length)
        segments.append(Segment(mass, centre, (x, y, z), tip or length))
    return tuple(segments)


@dataclass(frozen=True, eq=False)
class PersonArm:
    """An arm of a person: upper arm, forearm and hand.

    Attributes:
        side: "right" or "left".
        joints: indices in `pin` of the joints that carry the three, at shoulder, elbow and wrist.
        bodies: the three capsules, each from its joint to the next or to the fingertips.
        lengths: lengths of the three [m].
    """

    side: Side
    joints: tuple[int, int, int]
    bodies: tuple[Capsule, ...]
    lengths: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class PersonTrunk:
    """A trunk of a person with both arms.

    Attributes:
        lumbar: index in `pin` of the first joint between pelvis and abdomen.
        bodies: capsules of abdomen, thorax and head.
        half_width: from the middle to a shoulder [m].
    """

    lumbar: int
    bodies: tuple[Capsule, Capsule, Capsule]
    half_width: float


def person_arms(model: Model) -> tuple[PersonArm, ...]:
    """Return the arms of people in a model, right ones first.

    An arm has links "right upper arm", "right forearm" and "right hand" (or left; a prefix that
    ends in "/" is ignored), seven joints in a row, and a capsule along each of the links that ends
    at the next joint. A model whose bodies were replaced by others has none.
    """
    found = []
    for side in get_args(Side):
        parts = (_capsules(model, f"{side} {name}") for name in ("upper arm", "forearm", "hand"))
        found += [_arm(model, side, bodies) for bodies in product(*parts)]
    return tuple(arm for arm in found if arm is not None)


def person_trunks(model: Model) -> tuple[PersonTrunk, ...]:
    """Get the trunks of people with both arms in a model, by their links as for `person_arms`."""
    arms = person_arms(model)
    found = []
    for thorax in _capsules(model, "thorax"):
        joint = model.joint_of(str(thorax.link))
        own = [arm for arm in arms if _above(model, arm.joints[0], 3) == joint]
        lumbar = _above(model, joint, 3)
        below = [b for b in _capsules(model, "abdomen") if model.joint_of(str(b.link)) == lumbar]
        heads = [b for b in _capsules(model, "head") if model.joint_of(str(b.link)) == joint]
        if sorted(arm.side for arm in own) == ["left", "right"] and len(below) == len(heads) == 1:
            right, left = (_offset(model, arm.joints[0], 2) for arm in own)
            half_width = float(np.linalg.norm(right - left)) / 2.0
            first = _above(model, lumbar, 2)
            found.append(PersonTrunk(first, (below[0], thorax, heads[0]), half_width))
    return tuple(found)


def shoulder_joint(model: Model, arm: PersonArm) -> str:
    """Return name of the first joint of an arm."""
    return str(model.pin.names[_above(model, arm.joints[0], 2)])


def _arm(model: Model, side: Side, bodies: tuple[Capsule, ...]) -> PersonArm | None:
    """Return the arm of these capsules; None if they are not along a chain of seven joints."""
    shoulder, elbow, wrist = (model.joint_of(str(body.link)) for body in bodies)
    # Elbow and wrist have two coordinates each, of which the second carries the segment.
    above = [_above(model, joint, 2) for joint in (shoulder, elbow, wrist)]
    if above[1:] != [shoulder, elbow] or 0 in (shoulder, above[0]):
        return None
    ends = [_offset(model, elbow, 1), _offset(model, wrist, 1), None]
    lengths = []
    for body, next_joint in zip(bodies, ends, strict=True):
        place = model.pin.frames[frame_index(model.pin, str(body.link))].placement
        start, end = (place.act(np.array(point)) for point in (body.start, body.end))
        target = end if next_joint is None else next_joint
        length = float(np.linalg.norm(target))
        misses = np.abs([start, end - target, target - [0.0, 0.0, -length]])
        if misses.max() > _FITS * length:
            return None
        lengths.append(length)
    return PersonArm(side, (shoulder, elbow, wrist), bodies, tuple(lengths))


def _capsules(model: Model, part: str) -> list[Capsule]:
    """Return the capsules on links of this name, if a link has one only."""
    if not any(str(frame.name).rpartition("/")[2] == part for frame in model.pin.frames):
        return []
    try:
        bodies = model.bodies
    except ValueError:  # the geometry of a file that cannot be read: not a person
        return []
    found = [body for body in bodies if str(body.link).rpartition("/")[2] == part]
    return [body for body in found if isinstance(body, Capsule)]


def _above(model: Model, joint: int, count: int) -> int:
    """Return the joint that is this many joints before another; 0 for the base."""
    for _ in range(count):
        joint = int(model.pin.parents[joint])
    return joint


def _offset(model: Model, joint: int, before: int) -> Array:
    """Get translation (3,) [m] of the joint that is some joints before another, from its parent."""
    return np.array(model.pin.jointPlacements[_above(model, joint, before)].translation)
