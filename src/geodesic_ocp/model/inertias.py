"""Inertias of bodies and joints: checked, scaled, and added where files lack them.

The rotor of a motor with inertia I behind a gear of ratio r adds r^2 I to the inertia of its joint.
For the wrist of a robot it is larger than the inertia of the links, and few files state it.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from geodesic_ocp.arrays import Array, ShortRepr
from geodesic_ocp.model.joints import frame_index, link_of, max_reach, motion_subspace
from geodesic_ocp.model.model import ROUNDING, Model

# Relative size below which an eigenvalue of a mass matrix is zero.
_SINGULAR = 1e-13
_NUM_CONFIGURATIONS = 8
DEFAULT_ARMATURE = 0.05  # [kg m^2], of revolute joints of robots of which nothing is known
_UR = r"(shoulder_pan|shoulder_lift|elbow|wrist_[123])_joint$"
_PANDA = "MuJoCo Menagerie, franka_emika_panda/panda.xml (armature 0.1 on all joints)"
_UR5E = "MuJoCo Menagerie, universal_robots_ur5e/ur5e.xml (armature 0.1 on all joints)"


def check_inertias(model: pin.Model) -> None:
    """Reject a model whose mass matrix is not that of solid bodies.

    Every moving link, with all that is fixed to it, must have mass and, if it can rotate, positive
    principal moments of inertia. A link may be massless if a later link of its chain has mass, as
    between the axes of a shoulder, or if its joint has an inertia of its own (armature). The model
    has one coordinate per joint, as `Model.pin`.

    Raises:
        ValueError: names the link and what is wrong with its inertia.
    """
    rotates = [False] * model.njoints
    for index in range(1, model.njoints):
        body = model.inertias[index]
        link = link_of(model, index)
        angular = motion_subspace(model, index)[3:]
        rotates[index] = rotates[model.parents[index]] or bool(np.any(angular))
        if not np.all(np.isfinite(body.toDynamicParameters())):
            raise ValueError(f"link {link!r}: the inertia is not finite")
        if body.mass < 0.0:
            raise ValueError(f"link {link!r} has a negative mass, {body.mass:.3g} kg")
        moments = np.linalg.eigvalsh(body.inertia)
        # A massless link may have moments, such as those of a rotor, but no negative ones.
        least = ROUNDING * moments[-1] if body.mass > 0.0 else -ROUNDING * moments[-1]
        if rotates[index] and (moments[0] < least or (body.mass > 0.0 and moments[-1] <= 0.0)):
            listed = ", ".join(f"{moment:.3g}" for moment in moments)
            what = f"link {link!r}, {body.mass:.3g} kg, has an inertia that is not positive"
            raise ValueError(f"{what} definite: principal moments {listed} kg m^2")
    _check_mass_matrix(model)


def _check_mass_matrix(model: pin.Model) -> None:
    """Reject a mass matrix that is singular in every configuration: some joint moves no mass."""
    rng = np.random.default_rng(0)
    data = model.createData()
    weightless = model.copy()
    weightless.gravity = pin.Motion.Zero()
    still = np.zeros(model.nv)
    idle = np.zeros(model.nv)
    for _ in range(_NUM_CONFIGURATIONS):
        q = rng.uniform(-1.5, 1.5, model.nv)
        # Not crba, which omits entries if joints are not numbered depth first.
        columns = [pin.rnea(weightless, data, q, still, unit) for unit in np.eye(model.nv)]
        sizes = np.sqrt(np.maximum(np.diag(columns), np.finfo(float).tiny))
        values, vectors = np.linalg.eigh(np.array(columns) / np.outer(sizes, sizes))
        if values[0] > _SINGULAR:
            return
        idle = np.maximum(idle, np.abs(vectors[:, 0]))
    index = int(np.argmax(idle)) + 1
    has_mass = any(model.inertias[each].mass > 0.0 for each in model.subtrees[index])
    why = "that moves no mass" if has_mass else "neither it nor any later link has mass"
    raise ValueError(
        f"link {link_of(model, index)!r} moves with joint {model.names[index]!r}, but {why}, and "
        "the joint has no armature: the mass matrix is singular in every configuration"
    )


@dataclass(frozen=True, eq=False, repr=False)
class RobotArmature(ShortRepr):
    """Joint inertia of a robot, and where the numbers come from.

    Attributes:
        values: (n,) [kg m^2, kg for prismatic joints], for `Model.with_armature`.
        source: the file, the document or the default, in words.
    """

    values: Array
    source: str


# Patterns of names of joints and of their robots, value [kg m^2] and its source.
_KNOWN = (
    (r"panda_joint[1-7]$", "", 0.1, _PANDA),
    (_UR, r"^ur5e\b", 0.1, _UR5E),
    (_UR, r"^ur5\b", 0.1, f"that of its successor UR5e: {_UR5E}"),
    ("", r"^human (left|right) arm\b", 0.0, "a person's arm has no rotors"),
)


def robot_armature(model: Model) -> RobotArmature:
    """Return joint inertia of the robot: its model's, the known one, or a default.

    A model with armature on any joint keeps its own on all joints. Otherwise known robots get
    values whose source is named, and all other joints 0.05 kg m^2; prismatic ones the mass that has
    this inertia at the distance of the arm's reach, 0.05 kg m^2 / reach^2.

    >>> robot_armature(go.human_arm("right", armature=0.2)).source
    'the model'

    Args:
        model: of a robot.
    """
    if model.armature.any():
        return RobotArmature(model.armature, "the model")
    values = np.zeros(model.dof)
    sources = []
    default = f"default of {DEFAULT_ARMATURE:g} kg m^2"
    entries = [entry for entry in _KNOWN if re.search(entry[1], model.name)]
    for row, (joint, unit) in enumerate(zip(model.joint_names, model.units, strict=True)):
        known = [entry[2:] for entry in entries if re.search(entry[0], joint)]
        values[row], source = known[0] if known else (DEFAULT_ARMATURE, default)
        if unit == "m" and not known:
            values[row] /= model.reach**2
            source = f"{default} / reach^2 = {values[row]:.3g} kg"
        sources.append(source)
    values.flags.writeable = False
    return RobotArmature(values, "; ".join(dict.fromkeys(sources)))


def with_rotor_inertia(model: Model) -> Model:
    """Get the model with the joint inertia of `robot_armature`; the same one if it has its own.

    >>> arm = go.human_arm(armature=0.2)
    >>> go.model.with_rotor_inertia(arm) is arm
    True

    Args:
        model: of a robot.
    """
    if model.armature.any():
        return model
    values = robot_armature(model).values
    return model.with_armature(values) if values.any() else model


def scale_inertias(
    model: Model, mass_factors: Sequence[float], inertia_factors: Sequence[float]
) -> Model:
    """Return the model with every link's mass and rotational inertia multiplied; centres of mass
    stay.

    Args:
        model: model with n joints.
        mass_factors: mass factors of the link behind each joint, (n,), in the order of the
            coordinates.
        inertia_factors: inertia factors of its rotational inertia about the centre of mass, (n,).
    """
    scaled = model.pin.copy()
    for index in range(1, scaled.njoints):
        body = scaled.inertias[index]
        row = scaled.joints[index].idx_v
        scaled.inertias[index] = pin.Inertia(
            mass_factors[row] * body.mass, body.lever, inertia_factors[row] * body.inertia
        )
    return replace(model, pin=scaled)


def inertia_scale(model: Model) -> Array:
    """Return moving mass times squared reach [kg m^2] for revolute joints, (n,); for prismatic
    ones, mass.

    The mass is that of the joint's own tree, as both arms of a person are two. The reach is the
    largest distance of the hand from the first joint, and is taken for all trees. A joint inertia
    in this unit has the same effect on the geodesics of large and small, heavy and light arms.

    Of a model with several hands, the joints that move the same hands belong together, such as
    those of an arm or of the trunk: mass and reach are those from the first of them on.
    """
    result = []
    several = len(model.hands) > 1
    whole = model.pin
    masses = [sum(whole.inertias[each].mass for each in tree) for tree in whole.subtrees]
    frames = [frame_index(whole, hand) for hand in model.hands]
    carriers = {frame: list(whole.supports[whole.frames[frame].parentJoint]) for frame in frames}
    # For each joint the frames of the hands that it moves, if there are several.
    moved = [
        tuple(frame for frame in frames if several and joint in carriers[frame])
        for joint in range(whole.njoints)
    ]
    reaches: dict[tuple[int, ...], float] = {(): model.reach}
    for joint, unit in enumerate(model.units, start=1):
        chain = list(whole.supports[joint])[1:]
        hands = moved[joint]
        # The first joint of the tree, or of those that move the same hands.
        start = next(each for each in chain if not hands or moved[each] == hands)
        if hands not in reaches:
            origin = None if start == chain[0] else start
            limits = model.lower, model.upper
            reaches[hands] = max(max_reach(whole, hand, *limits, origin) for hand in hands)
        result.append(masses[start] * (reaches[hands] ** 2 if unit == "rad" else 1.0))
    return np.array(result)
