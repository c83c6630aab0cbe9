"""The available models and back ends, as lines of text."""

from __future__ import annotations

import textwrap
import warnings
from collections.abc import Iterator, Sequence
from typing import get_args

import pinocchio as pin

from geodesic_ocp.model.dynamics.rigid_body import (
    BACKENDS,
    ENVIRONMENT_VARIABLE,
    choose_backend,
    why_unavailable,
)
from geodesic_ocp.model.formats.description import Description, read_file
from geodesic_ocp.model.formats.load_model import load_model
from geodesic_ocp.model.formats.robots import INSTALL, ROBOTS, described, folder, on_demand
from geodesic_ocp.model.human.anthropometry import Side
from geodesic_ocp.model.human.human_arm import human_arm
from geodesic_ocp.model.model import Model

_WIDTH = 100


def catalogue() -> Iterator[str]:
    """List models with degrees of freedom, moving mass [kg] and reach [m], and the back ends.

    Robots without a known hand frame are loaded with the last link of their longest chain.
    """
    with warnings.catch_warnings():
        # Back ends that are skipped are listed below; warnings about files are for load_model.
        warnings.simplefilter("ignore")
        in_use = choose_backend()
        yield "human_arm(side, height, mass), here for 1.75 m and 70 kg"
        for side in get_args(Side):
            yield from _summary(side, human_arm(side, backend=in_use))
        installed = [name for name in ROBOTS if folder(ROBOTS[name].package) is not None]
        if installed:
            yield "load_model(name)"
        for name in installed:
            yield from _summary(name, load_model(name, backend=in_use))
    absent = [name for name in ROBOTS if name not in installed]
    if absent:
        packages = sorted({ROBOTS[name].package for name in absent})
        yield f"not available without {' and '.join(packages)}:"
        yield f"  {INSTALL}"
        yield from _wrapped(absent)
    if names := sorted(described()):
        yield (
            f"load_model(name, hand=...): {len(names)} of example-robot-data and armar, each with "
            "its longest chain"
        )
        for name in names:
            yield from _longest_chain(name, in_use)
    if names := sorted(on_demand()):
        yield (
            f"load_model(name, hand=...): {len(names)} of robot_descriptions, which downloads them "
            "on first use"
        )
        yield from _wrapped(names)
    yield "load_model(file, hand=...): URDF, MJCF, MMM/Simox XML"
    yield "back ends of the symbolic mass matrix"
    for name in BACKENDS:
        missing = why_unavailable(name)
        state = f"cannot be imported: {missing}" if missing else "available"
        yield f"  {name}: {'in use' if name == in_use else state}"
    yield f"the environment variable {ENVIRONMENT_VARIABLE} selects another one"


def _summary(name: str, model: Model) -> Iterator[str]:
    values = f"{model.dof} DoF, {model.mass:5.2f} kg, reach {model.reach:.2f} m"
    if inertia := model.describe_armature():
        values += f", {inertia}"
    yield f"  {name:20} {values}"
    yield from _wrapped(model.joint_names, indent="    ")


def last_link(description: Description) -> str:
    """The link moved by the most joints, none of which mimics another or is mimicked."""
    model, mimics = description.pin, description.mimics
    coupled = {*mimics, *(mimic.leader for mimic in mimics.values())}
    links = [frame for frame in model.frames if frame.type == pin.FrameType.BODY]

    def joints(frame: pin.Frame) -> int:
        chain = list(model.supports[frame.parentJoint])
        return 0 if coupled & {model.names[joint] for joint in chain} else len(chain)

    return str(max(links, key=joints).name)


def _longest_chain(name: str, backend: str) -> Iterator[str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            description = read_file(described()[name], None, None)
            model = load_model(name, hand=last_link(description), backend=backend)
        except ValueError as error:
            reason = f"  {name:26} cannot be loaded: {error}"
            yield from textwrap.wrap(reason, _WIDTH, subsequent_indent="    ")
            return
    values = f"{model.dof:2} DoF, {model.mass:6.2f} kg, reach {model.reach:.2f} m"
    yield f"  {name:26} {values}, hand={model.hand!r}"


def _wrapped(names: Sequence[str], indent: str = "  ") -> list[str]:
    return textwrap.wrap(
        ", ".join(names),
        _WIDTH,
        initial_indent=indent,
        subsequent_indent=indent,
        break_on_hyphens=False,
    )
