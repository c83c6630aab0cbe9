"""Published conventions of OpenSim's tables against models with the same axes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from recordings.opensim_models.osim_files import Axis, Link, osim_text, write_table

import geodesic_ocp as go
from geodesic_ocp.recordings.conventions.angle_convention import AngleConvention
from geodesic_ocp.recordings.conventions.continuous_angles import direction
from geodesic_ocp.recordings.conventions.known_angle_conventions import ANGLE_CONVENTIONS

Array = NDArray[np.float64]
BODIES = {"upper arm": "humerus", "forearm": "radius", "hand": "hand"}


def body_of(segment: str | None) -> str:
    if segment is None:
        return "ground"
    side, _, part = segment.partition(" ")
    return f"{BODIES[part]}_{side[0]}" if part else segment


def as_links(
    convention: AngleConvention, ranges: Mapping[str, tuple[float, float]]
) -> tuple[list[Link], list[str]]:
    """A model whose joints turn as the convention, and its coordinates.

    The elbow is below the shoulder, the wrist along the axis of pronation from the elbow.
    """
    links: list[Link] = []
    columns: list[str] = []
    for relation in convention.relations:
        if relation.refusal:
            continue
        names = [each.column for each in relation.rotations if each.column is not None]
        turns, last = [], []
        for each in relation.rotations:
            function = (
                f"<LinearFunction><coefficients>{each.sign} 0</coefficients></LinearFunction>"
            )
            x, y, z = direction(each.axis)
            turns.append(Axis("rotation", (x, y, z), each.column or "", function))
        sign = 1.0 if "right" in relation.segment else -1.0
        at = {"upper": (0.0, 0.37, sign * 0.17), "forea": (0.0, -0.29, 0.0)}.get(
            relation.segment.partition(" ")[2][:5], (0.0, 0.0, 0.0)
        )
        if relation.segment.endswith("hand"):
            forearm = next(each for each in convention.relations if each.segment == relation.parent)
            x, y, z = direction(forearm.rotations[-1].axis)
            at = (-0.25 * x / y, -0.25, -0.25 * z / y)
        parent, body = body_of(relation.parent), body_of(relation.segment)
        if len(turns) > 3:  # a joint has three axes of rotation
            turns, last = turns[:2], turns[2:]
            links.append(Link(parent, "between", "CustomJoint", (), at, axes=tuple(turns)))
            parent, turns, at = "between", last, (0.0, 0.0, 0.0)
        names = list(dict.fromkeys(names))
        links.append(
            Link(
                parent,
                body,
                "CustomJoint",
                tuple(names),
                at,
                axes=tuple(turns),
                ranges=tuple(
                    ranges.get(name.removesuffix("_l").removesuffix("_r"), (-1.2, 1.2))
                    for name in names
                ),
            )
        )
        columns += names
    return links, columns


def moving(names: list[str], count: int = 50) -> Array:
    """Smooth values, elbows flexed by 40 to 100 degrees."""
    rng = np.random.default_rng(3)
    waves = np.linspace(0.0, 2.0, count)[:, None] * rng.uniform(1, 3, len(names))
    values = 0.4 * np.sin(waves + rng.uniform(0, 6, len(names)))
    for i, name in enumerate(names):
        values[:, i] += 1.2 if "elbow" in name else 0.8 if "pro_sup" in name else 0.0
    return np.asarray(values)


def test_the_full_body_convention_and_a_model_with_its_axes(tmp_path: Path) -> None:
    """Both sides, a supinated zero pose.

    They define long axes differently by up to 3.2 degrees, the tilt of the axis of pronation.
    """
    ranges = {"pro_sup": (0.0, 1.6), "elbow_flex": (0.0, 2.6)}
    links, names = as_links(ANGLE_CONVENTIONS["opensim_full_body"], ranges)
    model = tmp_path / "m.osim"
    model.write_text(osim_text(links, 3))
    file = write_table(tmp_path / "t.mot", names, moving(names))
    read = go.read_motion(file, convention=model)
    wanted = go.read_motion(file, convention="opensim_full_body")
    assert read.joint_names == wanted.joint_names
    trunk = [name for name in read.joint_names if name[0] == "B"]
    assert read.select(trunk).q == pytest.approx(wanted.select(trunk).q, abs=1e-9)
    difference = np.abs(read.q - wanted.q).max(axis=0)
    assert (
        difference < np.radians([1.2 if name[1] in "BSE" else 4.5 for name in read.joint_names])
    ).all()
    assert wanted.trunk is None  # the table has no pelvis_tx


def test_the_upper_limb_convention_and_a_model_with_its_axes(tmp_path: Path) -> None:
    """The thumb points forward in the zero pose of the model, as its wrist flexes about x.

    The axis of pronation is tilted by 7 degrees, which the two attribute to different segments.
    """
    convention = ANGLE_CONVENTIONS["opensim_upper_limb"]
    links, names = as_links(convention, {"elbow_flexion": (0.0, 2.3), "pro_sup": (-1.6, 1.6)})
    axes = (
        Axis("rotation", (0.0, 0.0, 1.0), "deviation"),
        Axis("rotation", (1.0, 0.0, 0.0), "flexion"),
    )
    x, y, z = direction(convention.relations[2].rotations[-1].axis)
    at = (-0.25 * x, -0.25 * y, -0.25 * z)
    links.append(Link("radius_r", "hand_r", "CustomJoint", ("deviation", "flexion"), at, axes=axes))
    model = tmp_path / "m.osim"
    model.write_text(osim_text(links))
    file = write_table(
        tmp_path / "t.mot", [*names, "deviation", "flexion"], moving([*names, "d", "f"])
    )
    read = go.read_motion(file, convention=model)
    wanted = go.read_motion(file, convention="opensim_upper_limb")
    difference = read.select(wanted.joint_names).q - wanted.q
    assert np.abs(difference).max() < np.radians(9.0)
