"""Small OpenSim models and tables, written for tests in the layouts of OpenSim 3 and 4."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
ZERO = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Axis:
    """One TransformAxis: "rotation" or "translation", its axis, coordinates and function."""

    kind: str
    axis: tuple[float, float, float]
    coordinates: str = ""
    function: str = "<LinearFunction><coefficients>1 0</coefficients></LinearFunction>"


@dataclass(frozen=True)
class Link:
    """A joint and the body that it carries; places are (x, y, z), angles body-fixed x, y, z."""

    parent: str
    body: str
    kind: str
    coordinates: tuple[str, ...] = ()
    at: tuple[float, float, float] = ZERO
    turned: tuple[float, float, float] = ZERO
    at_child: tuple[float, float, float] = ZERO
    turned_child: tuple[float, float, float] = ZERO
    axes: tuple[Axis, ...] = ()
    ranges: tuple[tuple[float, float], ...] = ()
    defaults: tuple[float, ...] = ()
    locked: bool = False

    @property
    def joint(self) -> str:
        return f"{self.body}_joint"


def numbers(values: Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _coordinates(link: Link) -> str:
    text = ""
    for i, name in enumerate(link.coordinates):
        limits = link.ranges[i] if link.ranges else (-3.0, 3.0)
        default = link.defaults[i] if link.defaults else 0.0
        text += (
            f'<Coordinate name="{name}"><default_value>{default}</default_value>'
            f"<range>{numbers(limits)}</range><locked>{str(link.locked).lower()}</locked>"
            "</Coordinate>\n"
        )
    return text


def _transform(link: Link, version: int) -> str:
    if link.kind != "CustomJoint":
        return ""
    text, counts = "", {"rotation": 0, "translation": 0}
    for axis in link.axes:
        counts[axis.kind] += 1
        function = axis.function if version == 4 else f"<function>{axis.function}</function>"
        text += (
            f'<TransformAxis name="{axis.kind}{counts[axis.kind]}"><coordinates>{axis.coordinates}'
            f"</coordinates><axis>{numbers(axis.axis)}</axis>{function}</TransformAxis>\n"
        )
    return f"<SpatialTransform>{text}</SpatialTransform>"


def osim_text(links: Sequence[Link], version: int = 4, extra: str = "") -> str:
    """The content of a file .osim."""
    bodies, joints = "", ""
    for link in links:
        if version == 3:
            bodies += (
                f'<Body name="{link.body}"><Joint><{link.kind} name="{link.joint}">'
                f"<parent_body>{link.parent}</parent_body>"
                f"<location_in_parent>{numbers(link.at)}</location_in_parent>"
                f"<orientation_in_parent>{numbers(link.turned)}</orientation_in_parent>"
                f"<location>{numbers(link.at_child)}</location>"
                f"<orientation>{numbers(link.turned_child)}</orientation>"
                f"<CoordinateSet><objects>{_coordinates(link)}</objects></CoordinateSet>"
                f"<reverse>false</reverse>{_transform(link, 3)}"
                f"</{link.kind}></Joint></Body>\n"
            )
            continue
        parent = "/ground" if link.parent == "ground" else f"/bodyset/{link.parent}"
        bodies += f'<Body name="{link.body}"><mass>1</mass></Body>\n'
        frames = (
            f'<PhysicalOffsetFrame name="{name}_offset"><socket_parent>{path}</socket_parent>'
            f"<translation>{numbers(place)}</translation><orientation>{numbers(angles)}"
            "</orientation></PhysicalOffsetFrame>"
            for name, path, place, angles in (
                (link.parent, parent, link.at, link.turned),
                (link.body, f"/bodyset/{link.body}", link.at_child, link.turned_child),
            )
        )
        joints += (
            f'<{link.kind} name="{link.joint}"><socket_parent_frame>{link.parent}_offset'
            f"</socket_parent_frame><socket_child_frame>{link.body}_offset</socket_child_frame>"
            f"<coordinates>{_coordinates(link)}</coordinates><frames>{''.join(frames)}</frames>"
            f"{_transform(link, 4)}</{link.kind}>\n"
        )
    sets = f"<BodySet><objects>{bodies}</objects></BodySet>"
    if version == 4:
        sets += f"<JointSet><objects>{joints}</objects></JointSet>"
    return (
        f'<?xml version="1.0" encoding="UTF-8" ?>\n<OpenSimDocument Version="{version}0000">'
        f'<Model name="m"><gravity>0 -9.80665 0</gravity>{sets}\n{extra}</Model></OpenSimDocument>'
    )


def coupler(dependent: str, independent: str, slope: float) -> str:
    return (
        "<ConstraintSet><objects><CoordinateCouplerConstraint><coupled_coordinates_function>"
        f"<LinearFunction><coefficients>{slope} 0</coefficients></LinearFunction>"
        f"</coupled_coordinates_function><independent_coordinate_names>{independent}"
        f"</independent_coordinate_names><dependent_coordinate_name>{dependent}"
        "</dependent_coordinate_name></CoordinateCouplerConstraint></objects></ConstraintSet>"
    )


def write_table(file: Path, names: Sequence[str], values: Array, degrees: bool = False) -> Path:
    """A .mot file of coordinates (k, n) [rad] at 100 Hz."""
    rows = [
        "\t".join(repr(float(value)) for value in (0.01 * i, *row))
        for i, row in enumerate(np.degrees(values) if degrees else values)
    ]
    head = f"Coordinates\nnRows={len(rows)}\nnColumns={len(names) + 1}\n"
    unit = f"inDegrees={'yes' if degrees else 'no'}\nendheader\n"
    file.write_text(head + unit + "\t".join(["time", *names]) + "\n" + "\n".join(rows) + "\n")
    return file


X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
ARM = ("Sx", "Sz", "Sy", "Ex", "Ez", "Wx", "Wy_flex")
TRUNK = ("lean", "tilt", "turn", "move_x", "move_y", "move_z")


def arm_links(
    side: str,
    *,
    hanging: float = 0.0,
    supinated: float = 0.0,
    suffix: bool = True,
    body_axes: dict[str, tuple[float, float, float]] | None = None,
) -> list[Link]:
    """An arm whose coordinates are the angles of the Master Motor Map.

    Its joints turn in the order of `human_arm`, about OpenSim's axes (x forward, y up, z right).

    Args:
        side: "right" or "left".
        hanging: Sy of the arm where its coordinate is zero [rad].
        supinated: Ez of the forearm where its coordinate is zero [rad].
        suffix: whether names of bodies have one.
        body_axes: by body, angles by which its axes are turned.
    """
    sign = 1.0 if side == "right" else -1.0
    end = f"_{side[0]}" if suffix else ""
    names = [f"{name}_{side[0]}" for name in ARM]
    axes = body_axes or {}

    def rotation(axis: tuple[float, float, float], name: str, constant: float = 0.0) -> Axis:
        function = f"<LinearFunction><coefficients>1 {constant}</coefficients></LinearFunction>"
        return Axis("rotation", axis, name, function)

    def link(parent: str, body: str, names: list[str], at: Array, turns: list[Axis]) -> Link:
        rotated = Rotation.from_euler("XYZ", axes.get(parent, ZERO))
        angles = axes.get(body, ZERO)
        return Link(
            parent,
            body,
            "CustomJoint",
            tuple(names),
            at=tuple(rotated.apply(at)),
            turned=tuple(rotated.as_euler("XYZ")),
            turned_child=angles,
            axes=tuple(turns),
            ranges=tuple(_range(name, supinated) for name in names),
        )

    shoulder = np.array([0.01, 0.4, sign * 0.17])
    return [
        link(
            "thorax",
            f"humerus{end}",
            names[:3],
            shoulder,
            [rotation(Z, names[0]), rotation(Y, names[1]), rotation(X, names[2], hanging)],
        ),
        link(
            f"humerus{end}",
            f"ulna{end}",
            names[3:4],
            np.array([0.0, -0.29, 0.0]),
            [rotation(Z, names[3])],
        ),
        link(
            f"ulna{end}",
            f"radius{end}",
            names[4:5],
            np.array([0.0, -0.02, 0.0]),
            [rotation(Y, names[4], supinated)],
        ),
        link(
            f"radius{end}",
            f"hand{end}",
            names[5:],
            np.array([0.0, -0.23, 0.0]),
            [rotation(Z, names[5]), rotation(X, names[6])],
        ),
    ]


def _range(name: str, supinated: float) -> tuple[float, float]:
    if name.startswith("Ex"):
        return (0.0, 2.6)
    if name.startswith("Ez"):
        return (-1.4 - supinated, 1.4 - supinated)
    return (-0.5, 0.5) if name.startswith("Wx") else (-1.4, 1.4)


def trunk_link() -> Link:
    """The thorax, free in space."""
    turns = [Axis("rotation", axis, name) for axis, name in zip((Z, X, Y), TRUNK, strict=False)]
    moves = [
        Axis("translation", axis, name) for axis, name in zip((X, Y, Z), TRUNK[3:], strict=True)
    ]
    return Link("ground", "thorax", "CustomJoint", TRUNK, axes=(*turns, *moves))
