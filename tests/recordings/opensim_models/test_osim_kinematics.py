"""Forward kinematics of OpenSim models against products of 4 x 4 matrices, in both layouts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from recordings.opensim_models.osim_files import Axis, Link, coupler, osim_text

import geodesic_ocp as go
from geodesic_ocp.recordings.conventions.osim_file import read_osim, simm_spline
from geodesic_ocp.recordings.conventions.osim_model import body_poses

Array = NDArray[np.float64]

# What every kind of joint does with its coordinates, as axes (r)otated or (t)ranslated along.
KINDS = {
    "PinJoint": "rz",
    "SliderJoint": "tx",
    "UniversalJoint": "rx ry",
    "BallJoint": "rx ry rz",
    "GimbalJoint": "rx ry rz",
    "FreeJoint": "rx ry rz tx ty tz",
    "PlanarJoint": "rz tx ty",
    "WeldJoint": "",
}


def moved(axis: Array, amount: float, kind: str) -> Array:
    """Rodrigues' formula, or a translation, as a 4 x 4 matrix."""
    matrix = np.eye(4)
    if kind == "t":
        matrix[:3, 3] = amount * axis
        return matrix
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    matrix[:3, :3] += np.sin(amount) * cross + (1.0 - np.cos(amount)) * cross @ cross
    return matrix


def placed(at: tuple[float, ...], angles: tuple[float, ...]) -> Array:
    matrix = moved(np.array(at), 1.0, "t")
    for axis, angle in zip(np.eye(3), angles, strict=True):
        matrix = matrix @ moved(axis, angle, "r")
    return matrix


def random_links(seed: int) -> list[Link]:
    rng = np.random.default_rng(seed)
    links, parents = [], ["ground"]
    kinds = [*KINDS, "CustomJoint"]
    for number, kind in enumerate(rng.permutation(kinds)):
        count = 3 if kind == "CustomJoint" else len(KINDS[kind].split())
        names = tuple(f"q{number}{i}" for i in range(count))
        axes = tuple(
            Axis("rotation", tuple(rng.normal(size=3)), name) for name in names[:2]
        ) + tuple(Axis("translation", tuple(rng.normal(size=3)), name) for name in names[2:])
        places = [tuple(rng.uniform(-1.0, 1.0, 3)) for _ in range(4)]
        links.append(
            Link(str(rng.choice(parents)), f"b{number}", str(kind), names, *places, axes=axes)
        )
        parents.append(f"b{number}")
    return links


def expected(links: list[Link], values: dict[str, float]) -> dict[str, Array]:
    poses = {"ground": np.eye(4)}
    for link in links:
        pose = poses[link.parent] @ placed(link.at, link.turned)
        if link.kind == "CustomJoint":
            for axis in link.axes:
                if axis.kind == "translation":
                    unit = np.array(axis.axis) / np.linalg.norm(axis.axis)
                    pose = pose @ moved(unit, values[axis.coordinates], "t")
            for axis in link.axes:
                if axis.kind == "rotation":
                    pose = pose @ moved(np.array(axis.axis), values[axis.coordinates], "r")
        else:
            motions = list(zip(KINDS[link.kind].split(), link.coordinates, strict=True))
            for motion, name in sorted(motions, key=lambda each: each[0][0] == "r"):
                axis = np.eye(3)["xyz".index(motion[1])]
                pose = pose @ moved(axis, values[name], motion[0])
        poses[link.body] = pose @ np.linalg.inv(placed(link.at_child, link.turned_child))
    return poses


@pytest.mark.slow
@pytest.mark.parametrize("version", [3, 4])
@given(seed=st.integers(0, 2**32 - 1))
def test_every_kind_of_joint(
    version: int, seed: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    links = random_links(seed)
    file = tmp_path_factory.mktemp("model") / "m.osim"
    file.write_text(osim_text(links, version))
    model = read_osim(file)
    rng = np.random.default_rng(seed + 1)
    values = {name: rng.uniform(-2.0, 2.0, 2) for link in links for name in link.coordinates}
    poses = body_poses(model, values, model.bodies)
    for sample in range(2):
        wanted = expected(links, {name: each[sample] for name, each in values.items()})
        for link in links:
            rotation, position = poses[link.body]
            assert rotation[sample] == pytest.approx(wanted[link.body][:3, :3], abs=1e-12)
            assert position[sample] == pytest.approx(wanted[link.body][:3, 3], abs=1e-12)


def turning(function: str, coordinates: str = "q") -> list[Link]:
    axes = (Axis("rotation", (1.0, 0.0, 0.0), coordinates, function),)
    return [Link("ground", "b", "CustomJoint", tuple(coordinates.split()), axes=axes)]


@pytest.mark.parametrize("version", [3, 4])
@pytest.mark.parametrize(
    ("function", "angle"),
    [
        ("<Constant><value>0.3</value></Constant>", 0.3),
        ("<LinearFunction><coefficients>2 -0.1</coefficients></LinearFunction>", 0.7),
        ("<PolynomialFunction><coefficients>1 0 0.1</coefficients></PolynomialFunction>", 0.26),
        (
            "<MultiplierFunction><function><Constant><value>0.3</value></Constant></function>"
            "<scale>2</scale></MultiplierFunction>",
            0.6,
        ),
        ("<SimmSpline><x>0 1</x><y>0 0.5</y></SimmSpline>", 0.2),
    ],
)
def test_functions_of_a_coordinate(
    version: int, function: str, angle: float, tmp_path: Path
) -> None:
    file = tmp_path / "m.osim"
    file.write_text(osim_text(turning(function), version))
    rotation = body_poses(read_osim(file), {"q": np.array([0.4])}, ["b"])["b"][0][0]
    assert np.arctan2(rotation[2, 1], rotation[1, 1]) == pytest.approx(angle)


def test_a_linear_function_of_two_coordinates(tmp_path: Path) -> None:
    function = "<LinearFunction><coefficients>1 10 100</coefficients></LinearFunction>"
    file = tmp_path / "m.osim"
    file.write_text(osim_text(turning(function, "p q")))
    model = read_osim(file)
    values = {"p": np.array([0.1]), "q": np.array([-10.0])}
    rotation = body_poses(model, values, ["b"])["b"][0][0]
    assert np.arctan2(rotation[2, 1], rotation[1, 1]) == pytest.approx(0.1)


def test_couplers_and_default_values(tmp_path: Path) -> None:
    """A dependent coordinate follows unless the table has it; others have their default."""
    links = [
        Link("ground", "a", "PinJoint", ("p",), defaults=(0.25,)),
        Link("a", "b", "PinJoint", ("q",), defaults=(9.0,)),
    ]
    file = tmp_path / "m.osim"
    file.write_text(osim_text(links, 3, coupler("q", "p", 3.0)))
    model = read_osim(file)

    def angle(values: dict[str, Array]) -> float:
        rotation = body_poses(model, values, ["b"])["b"][0][0]
        return float(np.arctan2(rotation[1, 0], rotation[0, 0]))

    assert angle({}) == pytest.approx(1.0)
    assert angle({"p": np.array([0.1])}) == pytest.approx(0.4)
    assert angle({"p": np.array([0.1]), "q": np.array([0.1])}) == pytest.approx(0.2)
    assert model.independent(model.path("b")) == ("p",)


@given(
    coefficients=st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4),
    points=st.lists(st.integers(-50, 50), min_size=4, max_size=9, unique=True),
)
def test_the_spline_of_a_cubic_is_that_cubic(coefficients: list[float], points: list[int]) -> None:
    """Its ends have the third derivative of the cubic through four points: exact for cubics."""
    x = np.sort(np.array(points)) / 25.0
    at = np.linspace(x[0], x[-1], 40)
    spline = simm_spline(x, np.polyval(coefficients, x))
    assert spline(at[None]) == pytest.approx(np.polyval(coefficients, at), abs=1e-7)


def test_a_spline_does_not_leave_its_points() -> None:
    x, y = np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 0.0])
    spline = simm_spline(x, y)
    # third derivatives of zero at the ends: a parabola
    assert spline(np.array([[0.5, -0.01]])) == pytest.approx([0.75, -0.02])
    with pytest.raises(go.RecordingError, match=r"from 0 to 2, but its coordinate is 2\.1"):
        spline(np.array([[0.5, 2.1]]))


def test_frames_in_frames_and_bodies_as_frames(tmp_path: Path) -> None:
    """OpenSim 4 connects joints to bodies, to frames of the model, and to frames in frames."""

    def frame(name: str, parent: str, place: str, angles: str = "0 0 0") -> str:
        return (
            f'<PhysicalOffsetFrame name="{name}"><socket_parent>{parent}</socket_parent>'
            f"<translation>{place}</translation><orientation>{angles}</orientation>"
            "</PhysicalOffsetFrame>"
        )

    def joint(parent: str, child: str, frames: str = "") -> str:
        return (
            f'<WeldJoint name="{child}"><socket_parent_frame>{parent}</socket_parent_frame>'
            f"<socket_child_frame>{child}</socket_child_frame><frames>{frames}</frames></WeldJoint>"
        )

    inner = frame("outer", "/bodyset/a", "0 0 1", f"0 0 {np.pi / 2}") + frame(
        "in", "outer", "1 0 0"
    )
    joints = joint("/ground", "/bodyset/a") + joint("in", "/bodyset/b", inner)
    joints += joint("/shelf", "/bodyset/c")
    bodies = "".join(f'<Body name="{name}"/>' for name in "abc")
    file = tmp_path / "m.osim"
    file.write_text(
        '<OpenSimDocument Version="40000"><Model name="m"><BodySet><objects>'
        f"{bodies}</objects></BodySet><JointSet><objects>{joints}</objects></JointSet>"
        f"<components>{frame('shelf', '/bodyset/b', '5 0 0')}</components>"
        "</Model></OpenSimDocument>"
    )
    poses = body_poses(read_osim(file), {}, ["b", "c"])
    assert poses["b"][1][0] == pytest.approx([0.0, 1.0, 1.0])
    assert poses["c"][1][0] == pytest.approx([0.0, 6.0, 1.0])
