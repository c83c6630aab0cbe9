"""A Model from a file, a string, a pin.Model or a robot's name, and a list of what there is."""

from __future__ import annotations

import difflib
import textwrap
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from os import PathLike
from pathlib import Path
from typing import cast, get_args

import numpy as np
import pinocchio as pin

from geodesic_ocp.model.anthropometry import Side
from geodesic_ocp.model.doubts import NO_LIMIT
from geodesic_ocp.model.dynamics import (
    BACKENDS,
    ENVIRONMENT_VARIABLE,
    choose_backend,
    why_unavailable,
)
from geodesic_ocp.model.formats.description import (
    Description,
    change_base,
    lock_joints,
    read_description,
    read_file,
)
from geodesic_ocp.model.formats.robots import (
    INSTALL,
    ROBOTS,
    described,
    folder,
    locate,
    on_demand,
)
from geodesic_ocp.model.formats.urdf import (
    disabled_collisions,
    set_armature,
    srdf_armature,
)
from geodesic_ocp.model.human import human_arm
from geodesic_ocp.model.inertias import check_inertias
from geodesic_ocp.model.joints import DEFAULT_LIMIT, frame_index, link_of, motion_subspace
from geodesic_ocp.model.link_geometry import LinkGeometry
from geodesic_ocp.model.model import Model

_SUFFIXES = (".urdf", ".xml", ".mjcf", ".xacro")
_LONGEST_NAME = 4096
_WIDTH = 100  # of the list of models


def load_model(
    source: str | PathLike[str] | pin.Model,
    *,
    hand: str | Sequence[str] | None = None,
    joints: Sequence[str] | None = None,
    base: str | None = None,
    configuration: Mapping[str, float] | None = None,
    height: float | None = None,
    mass: float | None = None,
    srdf: str | PathLike[str] | None = None,
    backend: str | None = None,
) -> Model:
    """Load a Model of the joints between a base and one or more hands (end-effectors), or of given
    joints.

    All other joints are locked; the links that they carry remain, as part of the links that they
    are then fixed to. Continuous joints become angles with limits of +-2 pi rad
    (`Model.with_limits` changes them). Joint inertias that a file states become `Model.armature`:
    the armature of an MJCF, of a URDF that of `<dynamics>` or the rotor inertias and gear ratios of
    its transmissions (extensions by Drake), and for robots by name the `rotor_params` of an SRDF in
    their package. Most files state none (`Model.with_armature` adds them).

    >>> pendulum = '''<robot name="pendulum">
    ...   <link name="base"/>
    ...   <link name="bob"><inertial><origin xyz="0 0 -0.5"/><mass value="2"/>
    ...     <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
    ...   <joint name="hinge" type="revolute"><parent link="base"/><child link="bob"/>
    ...     <axis xyz="1 0 0"/><limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
    ... </robot>'''
    >>> go.load_model(pendulum, hand="bob", backend="built-in")
    Model('pendulum', dof=1, hand='bob', backend='built-in')

    Args:
        source: a URDF, MJCF or MMM/Simox file or its text, a pin.Model, or the name of a robot
            (`geodesic-ocp models` lists the available ones); "menagerie/NAME" is one of MuJoCo
            Menagerie (extra mujoco).
        hand: name of the hand frame, or names of several, such as of both arms of a body with the
            waist that they share (`Model.hands`); known robots have a default.
        joints: names of the joints that move, in any order; the model keeps the order of the file.
            None: all between `base` and `hand`.
        base: fixed frame that becomes the base frame, for poses and for the direction of gravity;
            None: the root of the file.
        configuration: values [rad or m], by name, at which joints are locked; the default is zero,
            or the limit closest to it, and for a mimic joint the value that its leader implies. The
            lift of a `tiago-pro-right-arm` or `-left-arm` is raised, to 0.35 m.
        height, mass: body height [m] and mass [kg], for MMM models; 1.75 m and 70 kg by default.
        srdf: SRDF file that says which pairs of links are not checked for collisions; None: those
            in the folder `srdf` beside that of the URDF. What it disables for the reason "Default"
            is checked all the same (`execution.link_pairs`).
        backend: back end of the symbolic rigid-body algorithms, see `Model`.

    Raises:
        ValueError: the source cannot be found or read; a name is unknown; a moving joint does not
            have one degree of freedom of its own (spherical, free-flyer, mimic); a moving link has
            no mass or an inertia that is not positive definite; the SRDF is none, or for another
            robot. Names what is wrong.
    """
    given = tuple(hand) if isinstance(hand, (list, tuple)) else () if hand is None else (hand,)
    description, hands, base = _read(source, given, base, height, mass)
    for fault in description.warnings:
        warnings.warn(fault, UserWarning, stacklevel=2)
    whole = description.pin
    if not hands:
        raise ValueError(f"hand must name a frame of {whole.name!r}: {_known(_frames(whole))}")
    indices = [_frame("hand", whole, each) for each in hands]
    base_index = None if base is None else _frame("base", whole, base)
    every = {name for index in indices for name in _moving(whole, index, base_index, joints)}
    moving = [str(name) for name in whole.names if str(name) in every]
    values = configuration or {}
    if isinstance(values, Mapping) and isinstance(source, str) and source in ROBOTS:
        raised = {name: at for name, at in ROBOTS[source].raised.items() if name not in moving}
        values = {**raised, **values}
    model = lock_joints(description, moving, values)
    if base is not None:
        model = change_base(model, base)
    for each in hands:
        if model.frames[frame_index(model, each)].parentJoint == 0:
            raise ValueError(f"hand {each!r} does not move with any of the joints {_known(moving)}")
    if isinstance(source, str) and source in ROBOTS:
        model.name = source
    of_file = model.armature.any() and not isinstance(source, pin.Model)
    origin = "the file" if of_file else ""
    continuous = _limit_unlimited(model)
    shapes = description.shapes
    if srdf is not None:
        if not isinstance(shapes, LinkGeometry):
            raise ValueError(f"srdf: links of {whole.name!r} have no geometry")
        shapes = replace(shapes, disabled=disabled_collisions(Path(srdf), whole))
    loaded = Model(model, hands[0], backend, continuous, shapes, hands, armature_from=origin)
    check_inertias(loaded.pin)
    if loaded.doubts:
        warnings.warn(f"{loaded.name}: {'; '.join(loaded.doubts)}", UserWarning, stacklevel=2)
    return loaded


def _limit_unlimited(model: pin.Model) -> tuple[str, ...]:
    """Limit unlimited revolute joints like continuous joints; returns their names."""
    names = []
    lower = model.lowerPositionLimit
    upper = model.upperPositionLimit
    for index in range(1, model.njoints):
        row = model.joints[index].idx_q
        twist = motion_subspace(model, index)
        # A revolution of a screw also translates.
        revolute = model.joints[index].nq == 1 and np.any(twist[3:]) and not np.any(twist[:3])
        if revolute and lower[row] <= -NO_LIMIT and upper[row] >= NO_LIMIT:
            lower[row] = -DEFAULT_LIMIT
            upper[row] = DEFAULT_LIMIT
            names.append(str(model.names[index]))
    return tuple(names)


def _read(
    source: object,
    hands: tuple[str, ...],
    base: str | None,
    height: float | None,
    mass: float | None,
) -> tuple[Description, tuple[str, ...], str | None]:
    """Return the description, and the hands and base, which have defaults for known robots."""
    if isinstance(source, pin.Model):
        if height is not None or mass is not None:
            raise ValueError("height and mass scale MMM models, but source is a pin.Model")
        return Description(source.copy()), hands, base
    if not isinstance(source, (str, PathLike)):
        raise ValueError(f"source must be a file, its text, a pin.Model or a name, got {source!r}")
    if isinstance(source, str) and source.removeprefix("\ufeff").lstrip().startswith("<"):
        return read_description(source, "the text", height, mass), hands, base
    if isinstance(source, str) and (len(source) > _LONGEST_NAME or "\0" in source):
        raise ValueError(f"source is neither XML nor a name: {source[:40]!r}...")
    file = Path(source)
    if not isinstance(source, str) or file.is_file() or file.suffix in _SUFFIXES:
        return read_file(file, height, mass), hands, base
    if (found := locate(source)) is None:
        raise ValueError(_unknown_source(source))
    if (robot := ROBOTS.get(source)) is not None:
        hands = hands or robot.hands
        base = robot.base if base is None else base
    description = read_file(found, height, mass)
    set_armature(description.pin, srdf_armature(found))
    return description, hands, base


def _unknown_source(name: str) -> str:
    if name in ROBOTS:
        return f"{name!r} is in {ROBOTS[name].package}, which is not installed: {INSTALL}"
    names = {*ROBOTS, *described(), *on_demand()}
    similar = difflib.get_close_matches(name, names)
    hint = "`geodesic-ocp models` lists robots"
    if similar:
        hint = f"did you mean {', '.join(similar)}?"
    return f"there is no file and no robot {name!r}; {hint}; more come with {INSTALL}"


def _frame(argument: str, model: pin.Model, name: str) -> int:
    if not isinstance(name, str) or not model.existFrame(name):
        known = _known(_frames(model), name)
        raise ValueError(f"{argument} {name!r} is not a frame of {model.name!r}: {known}")
    return frame_index(model, name)


def _frames(model: pin.Model) -> list[str]:
    return [str(each.name) for each in model.frames if each.type != pin.FrameType.FIXED_JOINT]


def _known(names: Iterable[str], wanted: str = "") -> str:
    """Return the names; if there are many, those similar to the wanted one, or the last ones."""
    names = list(names)
    if len(names) <= 40:
        return ", ".join(names)
    shown = difflib.get_close_matches(str(wanted), names, n=10, cutoff=0.3) or names[-10:]
    return f"{', '.join(shown)} and {len(names) - len(shown)} more"


def _moving(
    model: pin.Model, hand: int, base: int | None, joints: Sequence[str] | None
) -> tuple[str, ...]:
    """Return names of the moving joints: the given ones, or those between base and hand."""
    if joints is None:
        chain = list(model.supports[model.frames[hand].parentJoint])[1:]
        if base is not None and (root := model.frames[base].parentJoint) > 0:
            if root not in chain:
                where = f"between the root and the hand {model.frames[hand].name!r}"
                advice = "name the joints that move with joints=[...]"
                raise ValueError(f"base {model.frames[base].name!r} is not {where}; {advice}")
            chain = chain[chain.index(root) + 1 :]
        if not chain:
            raise ValueError(f"there is no joint before the hand {model.frames[hand].name!r}")
        return tuple(str(model.names[index]) for index in chain)
    if isinstance(joints, str) or not isinstance(joints, Iterable):
        raise ValueError(f"joints must be a sequence of names, got {joints!r}")
    names = tuple(joints)
    known = list(model.names)[1:]
    for name in names:
        if name not in known:
            raise ValueError(f"{name!r} is not a joint of {model.name!r}: {_known(known, name)}")
    if len(set(names)) < len(names) or not names:
        raise ValueError(f"joints must be names, at least one and each once, got {list(names)}")
    return names


def catalogue() -> Iterator[str]:
    """List names of models, none of which is loaded, and the back ends."""
    in_use = choose_backend()
    yield f"human_arm(side): {', '.join(get_args(Side))}"
    names: dict[bool, list[str]] = {True: [], False: []}
    for name, robot in ROBOTS.items():
        names[folder(robot.package) is not None].append(name)
    if names[True]:
        yield "load_model(name)"
        yield from _wrapped(names[True])
    if names[False]:
        packages = sorted({ROBOTS[name].package for name in names[False]})
        yield f"not available without {' and '.join(packages)}:"
        yield f"  {INSTALL}"
        yield from _wrapped(names[False])
    for found, origin in (
        (described(), "example-robot-data and armar"),
        (on_demand(), "robot_descriptions, which downloads them on first use"),
    ):
        if found:
            yield f"load_model(name, hand=...): {len(found)} of {origin}"
            yield from _wrapped(sorted(found))
    yield "load_model(file, hand=...): URDF, MJCF, MMM/Simox XML"
    yield "back ends of the symbolic mass matrix"
    for name in BACKENDS:
        missing = why_unavailable(name)
        state = f"cannot be used: {missing}" if missing else "available"
        yield f"  {name}: {'in use' if name == in_use else state}"
    yield f"the environment variable {ENVIRONMENT_VARIABLE} selects another one"
    yield "geodesic-ocp models NAME shows the joints, mass and reach of one"


def summary(name: str) -> Iterator[str]:
    """Describe an arm of a person (its side) or a robot (a name or a file): degrees of freedom,
    moving mass [kg], reach [m], hand and joints.
    """
    if name in get_args(Side):
        model = human_arm(cast(Side, name))
    else:
        hand = default_hand(name)
        base = None if hand is None else _default_base(name, hand)
        model = load_model(name, hand=hand, base=base)
    values = [f"{model.dof} DoF", f"{model.mass:.2f} kg", f"reach {model.reach:.2f} m"]
    yield f"{name}: {', '.join(filter(None, [*values, model.describe_armature()]))}"
    yield from _wrapped(model.joint_names)
    yield f"  hand: {', '.join(model.hands)}"
    if name not in get_args(Side) and base is not None:
        yield f"  base: {base}, before which joints are locked"
    if name in ROBOTS and (raised := ROBOTS[name].raised):
        yield f"  locked at {', '.join(f'{each} {at:g} m' for each, at in raised.items())}"


def default_hand(source: str) -> str | None:
    """Return the link moved by the most joints, if possible by none that mimics another or is
    mimicked, where the name or file of a robot has no hand of its own; None otherwise.
    """
    if source in ROBOTS or (description := _description(source)) is None:
        return None
    model = description.pin
    mimics = description.mimics
    coupled = {*mimics, *(mimic.leader for mimic in mimics.values())}
    links = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]

    def joints(frame: pin.Frame) -> tuple[int, int]:
        chain = list(model.supports[frame.parentJoint])[1:]
        is_coupled = coupled & {model.names[joint] for joint in chain}
        return 0 if is_coupled else len(chain), len(chain)

    return str(max(links, key=joints).name)


def _default_base(source: str, hand: str) -> str | None:
    """Return the link after the last joint before the hand that has several degrees of freedom,
    such as that of a floating base; None if there is no such joint.
    """
    if (description := _description(source)) is None:
        return None
    model = description.pin
    chain = list(model.supports[model.frames[frame_index(model, hand)].parentJoint])[1:]
    several = [joint for joint in chain if model.joints[joint].nv > 1]
    return link_of(model, several[-1]) if several else None


def _description(source: str) -> Description | None:
    """Return the description in the file of a robot, or of a name; None if there is none."""
    file = Path(source) if Path(source).is_file() else locate(source)
    return None if file is None else read_file(file, None, None)


def _wrapped(names: Sequence[str]) -> list[str]:
    lines = textwrap.wrap(", ".join(names), _WIDTH - 2, break_on_hyphens=False)
    return [f"  {line}" for line in lines]
