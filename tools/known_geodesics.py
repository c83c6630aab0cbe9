"""Compute the table of known geodesics and cubics, src/geodesic_ocp/data/known_geodesics.json.

Usage:  python tools/known_geodesics.py [--check]

Nothing here is shared with the package. Surfaces and the tip mass are evaluated from their closed
forms, or from Clairaut's relation by quadrature. For mechanisms the geodesic equation is forward
dynamics without gravity and torque, q'' = ABA(q, q', 0), by Pinocchio's articulated-body
algorithm; it is integrated with the collocation method of Gauss and Legendre of order 16, and again
with steps of half the size. Initial velocities of geodesics between two given configurations come
from Newton's method on the end point.

With --check the table is compared with the one in the file instead of written, and the exit status
is 1 where they differ by more than 1e-12. Newton's method then starts from the velocities in the
file.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.polynomial import legendre
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Curve = Callable[[float], Array]

DATA = Path(__file__).resolve().parents[1] / "src" / "geodesic_ocp" / "data"
FORMAT, VERSION = "geodesic_ocp known geodesics", 1
DECIMALS = 13  # of every number in the table
SAME = 1e-12  # two tables are the same up to this
CONVERGED = 1e-13  # change of every value when steps are halved, endpoint errors of Newton's method
# Tolerances of the package. Its exp is called with the first as its own; its log ends within 1e-9
# of the goal, and the derivative of the logarithm may multiply this by a few.
EXP_TOLERANCE, LOG_TOLERANCE = 1e-11, 1e-8
QUARTERS = (0.25, 0.5, 0.75)
KNOWN: dict[str, list[float]] = {}  # initial velocities in the file, by name, with --check


@dataclass(frozen=True)
class Entry:
    """One geodesic q(s), s in [0, 1], and the metric it belongs to.

    Attributes:
        name: unique in the table.
        metric: description of the metric, with its kind.
        q0, v0, q1: q(0), q'(0) and q(1), (n,).
        length: |v0| at q0.
        source: where the values come from, a sentence.
        log: whether the logarithm that starts from the straight line is to find it.
        points: s and q(s) on the way.
    """

    name: str
    metric: Mapping[str, Any]
    q0: Array
    v0: Array
    q1: Array
    length: float
    source: str
    log: bool = True
    points: tuple[tuple[float, Array], ...] = ()


# -- closed forms ----------------------------------------------------------------------------------


def from_curve(
    name: str,
    metric: Mapping[str, Any],
    curve: Curve,
    v0: ArrayLike,
    length: float,
    source: str,
    *,
    log: bool = True,
) -> Entry:
    """Entry of a curve at constant speed, given in closed form."""
    points = tuple((s, curve(s)) for s in QUARTERS)
    return Entry(
        name, metric, curve(0.0), np.array(v0), curve(1.0), length, source, log=log, points=points
    )


def straight(q0: ArrayLike, q1: ArrayLike) -> Curve:
    """The straight line between two points."""
    a, b = np.array(q0), np.array(q1)
    return lambda s: (1.0 - s) * a + s * b


def polar(point: Array, near: float) -> Array:
    """Radius and angle of a point of the plane, the angle within half a revolution of another."""
    angle = np.arctan2(point[1], point[0])
    turns = np.round((near - angle) / (2.0 * np.pi))
    return np.array([np.hypot(*point), angle + 2.0 * np.pi * turns])


def euclidean() -> Entry:
    """A straight line."""
    q0, q1 = np.array([0.3, -1.2, 2.0]), np.array([-0.5, 0.4, 1.1])
    return from_curve(
        "Euclidean space",
        {"kind": "euclidean", "dim": 3},
        straight(q0, q1),
        q1 - q0,
        float(np.linalg.norm(q1 - q0)),
        "Straight line between two points.",
    )


def sphere(
    name: str, colatitude: float, heading: float, length: float, *, log: bool = True
) -> Entry:
    """A great circle from longitude 0.2; headings are measured from the meridian to the south."""
    longitude = 0.2

    def curve(s: float) -> Array:
        position = np.cos(length * s) * start + np.sin(length * s) * tangent
        # The longitude grows by less than pi along every half of the great circle.
        near = longitude + np.sign(np.sin(heading)) * length * s
        around = polar(position[:2], near)
        return np.array([np.arctan2(around[0], position[2]), around[1]])

    c, s, cp, sp = (f(x) for x in (colatitude, longitude) for f in (np.cos, np.sin))
    start = np.array([s * cp, s * sp, c])
    south, east = np.array([c * cp, c * sp, -s]), np.array([-sp, cp, 0.0])
    tangent = np.cos(heading) * south + np.sin(heading) * east
    return from_curve(
        name,
        {"kind": "sphere"},
        curve,
        length * np.array([np.cos(heading), np.sin(heading) / s]),
        length,
        "Great circle, x(s) = cos(L s) x(0) + sin(L s) x'(0) / L.",
        log=log,
    )


def half_plane_circle() -> Entry:
    """Part of a half circle centred on the boundary."""
    centre, radius, a, b = 0.4, 1.5, -0.8, 1.1
    slope = np.array([1.0 / np.cosh(a) ** 2, -np.tanh(a) / np.cosh(a)])
    return from_curve(
        "half-plane, half circle",
        {"kind": "half-plane"},
        lambda s: np.array(
            [
                centre + radius * np.tanh(a + (b - a) * s),
                radius / np.cosh(a + (b - a) * s),
            ]
        ),
        (b - a) * radius * slope,
        b - a,
        "Half circle x = c + R tanh(t), y = R / cosh(t) of arc length t.",
    )


def half_plane_vertical() -> Entry:
    """A vertical line upwards."""
    height, length = 0.6, 1.4
    return from_curve(
        "half-plane, vertical line",
        {"kind": "half-plane"},
        lambda s: np.array([-0.3, height * np.exp(length * s)]),
        [0.0, length * height],
        length,
        "Vertical line y = y(0) exp(t) of arc length t.",
    )


def developed(
    name: str, metric: Mapping[str, Any], share: float, p0: Array, p1: Array, source: str
) -> Entry:
    """A straight line of the plane in polar coordinates (r, phi), with scaled angles."""
    start = polar(p0, 0.0)

    def curve(s: float) -> Array:
        radius, angle = polar((1.0 - s) * p0 + s * p1, start[1])
        return np.array([radius, angle / share])

    along = p1 - p0
    radial = float(p0 @ along) / start[0]
    turning = float(p0[0] * along[1] - p0[1] * along[0]) / (start[0] ** 2 * share)
    return from_curve(name, metric, curve, [radial, turning], float(np.linalg.norm(along)), source)


def polar_plane() -> Entry:
    """A straight line past the origin."""
    return developed(
        "plane in polar coordinates",
        {"kind": "polar plane"},
        1.0,
        np.array([1.2, -0.4]),
        np.array([-0.3, 1.6]),
        "Straight line in Cartesian coordinates.",
    )


def cone() -> Entry:
    """A straight line of the unrolled cone; its half angle is the arc sine of 0.6."""
    return developed(
        "cone",
        {"kind": "surface of revolution", "profile": "cone", "half_angle": float(np.arcsin(0.6))},
        0.6,
        np.array([1.0, -0.5]),
        np.array([0.6, 1.3]),
        "Straight line on the unrolled cone, whose angle is phi sin(half angle).",
    )


def cylinder() -> Entry:
    """A helix of more than one revolution."""
    radius, q0, q1 = 0.7, np.array([-0.2, 0.5]), np.array([1.6, 8.3])
    return from_curve(
        "cylinder, helix of more than a turn",
        {"kind": "surface of revolution", "profile": "cylinder", "radius": radius},
        straight(q0, q1),
        q1 - q0,
        float(np.hypot(q1[0] - q0[0], radius * (q1[1] - q0[1]))),
        "Helix, a straight line on the unrolled cylinder.",
    )


def torus_equator() -> Entry:
    """Along the outer equator, further than the conjugate point at pi sqrt(r (R + r))."""
    major, minor, turn = 2.0, 0.8, 2.3
    return from_curve(
        "torus, outer equator past its conjugate point",
        {"kind": "surface of revolution", "profile": "torus", "major": major, "minor": minor},
        straight([0.0, 0.0], [0.0, turn]),
        [0.0, turn],
        (major + minor) * turn,
        "The outer equator u = 0 is a geodesic, conjugate at pi sqrt(r (R + r)).",
        log=False,
    )


def hold(value: float, bound: float, what: str) -> None:
    """Raise ArithmeticError if a value exceeds its bound."""
    if not value <= bound:
        raise ArithmeticError(f"{what} by {value:.1e}, more than {bound:.0e}")


def integral(function: Callable[[float], float], a: float, b: float) -> float:
    """Integral of a smooth function by Gauss quadrature, checked with half of the nodes."""
    values = []
    for count in (100, 200):
        nodes, weights = legendre.leggauss(count)
        at = (a + b) / 2 + (b - a) / 2 * nodes
        values.append(float(weights @ [function(x) for x in at]) * (b - a) / 2)
    hold(abs(values[1] - values[0]), CONVERGED, "doubling the nodes changes an integral")
    return values[1]


def clairaut(
    name: str,
    metric: Mapping[str, Any],
    radius: Callable[[float], float],
    stretch: Callable[[float], float],
    u0: float,
    u1: float,
    moment: float,
) -> Entry:
    """From the parallel u0 to the parallel u1, with u monotone.

    On ds^2 = E du^2 + r^2 dphi^2 at unit speed r^2 phi' = c, so that
    dphi/du = c sqrt(E) / (r sqrt(r^2 - c^2)) and ds/du = r sqrt(E) / sqrt(r^2 - c^2).

    Args:
        name: of the entry.
        metric: its description.
        radius, stretch: r(u) and sqrt(E(u)).
        u0, u1: the parallels, in this order upwards.
        moment: Clairaut's constant c, below r on the way.
    """

    def along(u: float) -> float:
        return stretch(u) / float(np.sqrt((radius(u) - moment) * (radius(u) + moment)))

    angle = integral(lambda u: moment * along(u) / radius(u), u0, u1)
    length = integral(lambda u: radius(u) * along(u), u0, u1)
    v0 = length * np.array([1.0 / (radius(u0) * along(u0)), moment / radius(u0) ** 2])
    q0, q1 = np.array([u0, 0.0]), np.array([u1, angle])
    source = f"Clairaut's relation r^2 phi' = {moment:g} at unit speed, by quadrature."
    return Entry(name, metric, q0, v0, q1, length, source)


def torus() -> list[Entry]:
    """From outside to inside, and once around the tube."""
    major, minor = 2.0, 0.8
    metric = {"kind": "surface of revolution", "profile": "torus", "major": major, "minor": minor}

    def radius(u: float) -> float:
        return float(major + minor * np.cos(u))

    arguments = (metric, radius, lambda u: minor)
    return [
        clairaut("torus, from outside to inside", *arguments, -0.4, 2.2, 0.9),
        clairaut("torus, over the inner equator", *arguments, 1.5, 4.6, 0.5),
    ]


def catenoid() -> list[Entry]:
    """Through the neck, and back from before it."""
    neck = 0.9
    metric = {"kind": "surface of revolution", "profile": "catenoid", "neck": neck}

    def radius(u: float) -> float:
        return float(neck * np.cosh(u / neck))

    def stretch(u: float) -> float:
        return float(np.cosh(u / neck))

    through = clairaut("catenoid, through the neck", metric, radius, stretch, -0.7, 0.9, 0.5)

    # The way back is that to the turning point at u = nearest, mirrored. In w, u = nearest + w^2,
    # the integrand has no singularity; r^2 - c^2 is a product of sines without cancellation.
    start, nearest = 1.1, 0.4
    moment = radius(nearest)

    def along(w: float) -> float:
        u = nearest + w**2
        square = neck**2 * np.sinh((u + nearest) / neck) * np.sinh(w**2 / neck) / w**2
        return float(2.0 * stretch(u) / np.sqrt(square))

    def at(w: float) -> float:
        return radius(nearest + w**2)

    furthest = float(np.sqrt(start - nearest))
    angle = 2.0 * integral(lambda w: moment * along(w) / at(w), 0.0, furthest)
    length = 2.0 * integral(lambda w: at(w) * along(w), 0.0, furthest)
    inwards = -np.sqrt(1.0 - (moment / radius(start)) ** 2) / stretch(start)
    return [
        through,
        Entry(
            "catenoid, back from before the neck",
            metric,
            np.array([start, 0.0]),
            length * np.array([inwards, moment / radius(start) ** 2]),
            np.array([start, angle]),
            length,
            "Clairaut's relation by quadrature, twice the way to the parallel u = 0.4 where the "
            "geodesic turns.",
            points=((0.5, np.array([nearest, angle / 2.0])),),
        ),
    ]


def tip_mass(name: str, start: tuple[float, float], goal: tuple[float, float]) -> Entry:
    """Two links with all mass at the tip, which moves as a free particle.

    The tip is at l1 (cos q1, sin q1) + l2 (cos(q1 + q2), sin(q1 + q2)).
    """
    l1, l2, mass = 1.0, 0.8, 2.0

    def tip(q: Sequence[float]) -> Array:
        first, second = q[0], q[0] + q[1]
        return np.array(
            [
                l1 * np.cos(first) + l2 * np.cos(second),
                l1 * np.sin(first) + l2 * np.sin(second),
            ]
        )

    def curve(s: float) -> Array:
        x, y = (1.0 - s) * tip(start) + s * tip(goal)
        elbow = np.arccos((x * x + y * y - l1**2 - l2**2) / (2.0 * l1 * l2))
        across = np.arctan2(l2 * np.sin(elbow), l1 + l2 * np.cos(elbow))
        return np.array([np.arctan2(y, x) - across, elbow])

    a, b = start[0], start[0] + start[1]
    jacobian = np.array(
        [
            [-l1 * np.sin(a) - l2 * np.sin(b), -l2 * np.sin(b)],
            [l1 * np.cos(a) + l2 * np.cos(b), l2 * np.cos(b)],
        ]
    )
    straight_line = tip(goal) - tip(start)
    return from_curve(
        name,
        # Robot formats require a moment of inertia: this one is below rounding errors.
        planar((l1, l2), (0.0, mass), (0.0, l2), (0.0, 1e-15)),
        curve,
        np.linalg.solve(jacobian, straight_line),
        float(np.sqrt(mass) * np.linalg.norm(straight_line)),
        "The tip moves on a straight line at constant speed; joint angles by the law of cosines.",
    )


# -- mechanisms ------------------------------------------------------------------------------------


def planar(
    lengths: Sequence[float],
    masses: Sequence[float],
    centres: Sequence[float],
    inertias: Sequence[float],
) -> dict[str, Any]:
    """Description of links [m] that rotate about z; inertias [kg m^2] are about the centres."""
    figures = (list(lengths), list(masses), list(centres), list(inertias))
    names = ("lengths", "masses", "centres", "inertias")
    return {"kind": "planar arm", **dict(zip(names, figures, strict=True))}


def rods(count: int) -> dict[str, Any]:
    """Description of uniform rods of 1 m and 1 kg in a row."""
    return planar([1.0] * count, [1.0] * count, [0.5] * count, [1 / 12] * count)


def planar_model(figures: Mapping[str, Any]) -> pin.Model:
    """The planar arm of a description."""
    model, parent, offset = pin.Model(), 0, 0.0
    columns = (figures[name] for name in ("lengths", "masses", "centres", "inertias"))
    for index, (length, mass, centre, inertia) in enumerate(zip(*columns, strict=True)):
        placement = pin.SE3(np.eye(3), np.array([offset, 0.0, 0.0]))
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"joint{index}")
        body = pin.Inertia(mass, np.array([centre, 0.0, 0.0]), inertia * np.eye(3))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        offset = length
    return model


@dataclass(frozen=True)
class Segment:
    """Of an arm that hangs along -z, x to the right and y forward.

    Per body height and mass; moments are about the centre of mass.
    """

    length: float
    mass: float
    centre: tuple[float, float, float]
    moments: tuple[float, float, float]


def winter(side: str) -> tuple[Segment, Segment, Segment]:
    """Upper arm, forearm and hand of the Master Motor Map's reference model, after Winter.

    Terlemez et al., "Master Motor Map (MMM) - framework and toolkit for capturing, representing,
    and reproducing human motion on humanoid robots", Humanoids 2014. The small offsets of the
    centres of mass in x and y are the model's; on the left that in x is rounding noise there.
    """
    x, y = (2.03848e-5 if side == "right" else 0.0), 3.81383e-8
    hand = {
        "right": (5.188e-6, 3.90222e-6, 1.41993e-6),
        "left": (5.1963e-6, 3.91221e-6, 1.41814e-6),
    }[side]
    return (
        Segment(0.188, 0.027, (x, y, -0.082), (5.90063e-5, 5.90086e-5, 3.96211e-6)),
        Segment(0.145, 0.016, (x, y, -0.0624), (2.35586e-5, 2.33400e-5, 1.50684e-6)),
        Segment(0.0, 0.006, (x, y, -0.0546), hand),
    )


def de_leva(sex: str) -> tuple[Segment, Segment, Segment]:
    """Upper arm, forearm and hand after de Leva, J. Biomech. 29 (1996), 1223-1230, table 4.

    Length [mm], mass [body mass], centre of mass from the proximal joint and radii of gyration
    about the sagittal, transverse and longitudinal axes [length]. In forearm and hand, with the
    palm towards the body, the sagittal axis is x; in the upper arm it is y.
    """
    stature, *lines = {
        "male": (
            1741.0,
            (281.7, 0.0271, 0.5772, (0.285, 0.269, 0.158)),
            (268.9, 0.0162, 0.4574, (0.276, 0.265, 0.121)),
            (86.2, 0.0061, 0.7900, (0.628, 0.513, 0.401)),
        ),
        "female": (
            1735.0,
            (275.1, 0.0255, 0.5754, (0.278, 0.260, 0.148)),
            (264.3, 0.0138, 0.4559, (0.261, 0.257, 0.094)),
            (78.0, 0.0056, 0.7474, (0.531, 0.454, 0.335)),
        ),
    }[sex]
    segments = []
    for index, (millimetres, mass, centre, gyration) in enumerate(lines):
        length = millimetres / stature
        sagittal, transverse, along = (mass * (radius * length) ** 2 for radius in gyration)
        moments = (transverse, sagittal, along) if index == 0 else (sagittal, transverse, along)
        segments.append(Segment(length, mass, (0.0, 0.0, -centre * length), moments))
    upper_arm, forearm, hand = segments
    return upper_arm, forearm, hand


def human_model(figures: Mapping[str, Any]) -> pin.Model:
    """The human arm of a description: shoulder x, z, y, elbow x, z, wrist x, y."""
    height, mass = figures["height"], figures["mass"]
    table = winter(figures["side"]) if figures["table"] == "winter" else de_leva(figures["sex"])
    model, parent, offset = pin.Model(), 0, 0.0
    for axes, segment in zip(("xzy", "xz", "xy"), table, strict=True):
        for axis in axes:
            joint = {"x": pin.JointModelRX, "y": pin.JointModelRY, "z": pin.JointModelRZ}[axis]()
            placement = pin.SE3(np.eye(3), np.array([0.0, 0.0, -offset]))
            parent, offset = model.addJoint(parent, joint, placement, f"joint{model.njoints}"), 0.0
        moments = mass * height**2 * np.diag(segment.moments)
        body = pin.Inertia(mass * segment.mass, height * np.array(segment.centre), moments)
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
        offset = height * segment.length
    return model


def urdf_model(figures: Mapping[str, Any]) -> pin.Model:
    """The arm of a URDF file in the data folder, all of its joints."""
    return pin.buildModelFromUrdf(str(DATA / figures["file"]))


MODELS: dict[str, Callable[[Mapping[str, Any]], pin.Model]] = {
    "planar arm": planar_model,
    "human arm": human_model,
    "urdf": urdf_model,
}


class GaussLegendre:
    """The collocation method of Gauss and Legendre with 8 stages, of order 16.

    Hairer, Lubich, Wanner, *Geometric Numerical Integration*, II.1.3. Stage derivatives of
    y' = f(y) are found by fixed-point iteration, to rounding.
    """

    stages = 8

    def __init__(self) -> None:
        nodes, weights = legendre.leggauss(self.stages)
        # Integrals from -1 of the Legendre polynomials P_k: x + 1, (P_k+1 - P_k-1) / (2 k + 1).
        values = legendre.legvander(nodes, self.stages)
        integrals = np.empty((self.stages, self.stages))
        integrals[:, 0] = nodes + 1.0
        for k in range(1, self.stages):
            integrals[:, k] = (values[:, k + 1] - values[:, k - 1]) / (2 * k + 1)
        self.matrix = 0.5 * np.linalg.solve(values[:, : self.stages].T, integrals.T).T
        self.weights = 0.5 * weights

    def step(self, rate: Callable[[Array], Array], y: Array, h: float) -> Array:
        """The state after a step h."""
        slopes = np.tile(rate(y), (self.stages, 1))
        change = np.inf
        for _ in range(60):
            found = np.array([rate(y + h * (row @ slopes)) for row in self.matrix])
            last, change = change, float(np.abs(found - slopes).max())
            slopes = found
            size = max(1.0, float(np.abs(found).max()))
            if change <= 1e-15 * size or last <= change <= 1e-11 * size:
                return y + h * (self.weights @ slopes)
            if not change <= 1e6 * size:
                break
        raise ArithmeticError(f"stages do not converge, last change {change:.1e}: h is too large")


GAUSS = GaussLegendre()


class Mechanism:
    """Geodesics of a mechanism: its motions without gravity and torque."""

    def __init__(self, description: Mapping[str, Any]) -> None:
        self.model = MODELS[description["kind"]](description)
        self.model.gravity = pin.Motion.Zero()
        self.data = self.model.createData()
        self._neutral = pin.neutral(self.model)
        self._free = np.zeros(self.model.nv)

    def configuration(self, q: Array) -> Array:
        """Pinocchio's configuration, with cosine and sine for continuous joints."""
        return np.asarray(pin.integrate(self.model, self._neutral, q))

    def rate(self, y: Array) -> Array:
        """(q, q') -> (q', q'')."""
        n = self.model.nv
        q = self.configuration(y[:n])
        acceleration = pin.aba(self.model, self.data, q, y[n:], self._free)
        return np.concatenate([y[n:], acceleration])

    def path(self, q0: Array, v0: Array, steps: int) -> Array:
        """Configurations (5, n) at s = 0, 1/4, 1/2, 3/4 and 1; `steps` is a multiple of 4."""
        y, passed = np.concatenate([q0, v0]), [q0]
        for index in range(1, steps + 1):
            y = GAUSS.step(self.rate, y, 1.0 / steps)
            if index % (steps // 4) == 0:
                passed.append(y[: self.model.nv])
        return np.array(passed)

    def length(self, q0: Array, v0: Array) -> float:
        """Square root of twice the kinetic energy."""
        pin.computeKineticEnergy(self.model, self.data, self.configuration(q0), v0)
        return float(np.sqrt(2.0 * self.data.kinetic_energy))

    def velocity(
        self, q0: Array, q1: Array, guess: Array, steps: int, error: float = CONVERGED / 2.0
    ) -> Array:
        """v0 of the geodesic from q0 to q1 near a guess, by Newton's method, to an endpoint error.

        The derivative of the end point is taken by central differences, from larger steps.
        ArithmeticError where Newton's method does not converge.
        """
        v0, coarse = guess.copy(), max(8, steps // 4)
        for _ in range(8):
            residual = self.path(q0, v0, steps)[-1] - q1
            if np.abs(residual).max() <= error:
                return v0
            delta = 1e-5 * max(1.0, float(np.abs(v0).max()))
            columns = [
                (self.path(q0, v0 + e, coarse)[-1] - self.path(q0, v0 - e, coarse)[-1])
                / (2 * delta)
                for e in delta * np.eye(v0.size)
            ]
            v0 = v0 - np.linalg.solve(np.array(columns).T, residual)
        raise ArithmeticError(
            f"Newton's method leaves an endpoint error of {np.abs(residual).max():.1e}"
        )

    def followed(self, q0: Array, q1: Array, steps: int) -> Array:
        """v0 of the geodesic from q0 to q1 that grows from the short ones, by continuation."""
        v0, reached, share = np.zeros_like(q0), 0.0, 0.25
        while reached < 1.0:
            part = min(reached + share, 1.0)
            guess = v0 * part / reached if reached else (q1 - q0) * part
            try:
                v0 = self.velocity(q0, q0 + (q1 - q0) * part, guess, 8, 1e-4)
                reached = part
            except ArithmeticError:
                share /= 2.0
                if share < 1e-3:
                    raise
        return self.velocity(q0, q1, v0, steps)


ABA = (
    "Forward dynamics without gravity and torque (Pinocchio's articulated-body algorithm), "
    "Gauss-Legendre integration of order 16, the same to 1e-13 with steps twice as large"
)


FIGURES = {
    "winter": "Figures of the Master Motor Map (Terlemez et al., Humanoids 2014), after Winter. ",
    "de_leva": "Figures of de Leva (J. Biomech. 29, 1996, table 4). ",
}


def mechanical(
    name: str,
    metric: Mapping[str, Any],
    q0: Sequence[float],
    *,
    v0: Sequence[float] | None = None,
    q1: Sequence[float] | None = None,
    near: Sequence[float] | None = None,
    steps: int = 32,
    log: bool = True,
) -> Entry:
    """Geodesic of a mechanism.

    Args:
        name: of the entry.
        metric: its description.
        q0: where it starts.
        v0: its velocity there, or
        q1: where it ends, with
        near: a velocity near that of the geodesic that is meant, or None for the one that grows
            from short ones.
        steps: of the coarser of two integrations.
        log: whether the logarithm that starts from the straight line is to find it.
    """
    mechanism, start = Mechanism(metric), np.round(np.array(q0), DECIMALS)
    source = FIGURES.get(metric.get("table", ""), "") + ABA
    goal = None if q1 is None else np.round(np.array(q1), DECIMALS)
    if goal is None:
        velocity = np.array(v0)
    else:
        near = KNOWN.get(name, near)
        if near is None:
            velocity = mechanism.followed(start, goal, steps)
        else:
            velocity = mechanism.velocity(start, goal, np.array(near), steps)
        velocity = np.round(velocity, DECIMALS)
        source += "; v0 by Newton's method on the end point"
    coarse, fine = (mechanism.path(start, velocity, n) for n in (steps, 2 * steps))
    change = float(np.abs(fine - coarse).max())
    hold(change, CONVERGED, f"{name}: halving the steps changes values")
    end = fine[-1]
    if goal is not None:
        error = float(np.abs(end - goal).max())
        hold(error, SAME, f"{name}: the rounded velocity has an endpoint error")
        end = goal
    print(f"{name}: halving the step of 1/{steps} changes values by {change:.1e}")
    points = tuple(zip(QUARTERS, fine[1:-1], strict=True))
    length = mechanism.length(start, velocity)
    return Entry(name, metric, start, velocity, end, length, f"{source}.", log=log, points=points)


def planar_arms() -> list[Entry]:
    """Arms of two and three links."""
    uneven = planar((0.4, 0.3), (1.4, 0.9), (0.17, 0.12), (0.025, 0.009))
    three = planar((0.35, 0.3, 0.2), (2.1, 1.3, 0.4), (0.15, 0.14, 0.07), (0.03, 0.012, 0.002))
    return [
        mechanical("two rods", rods(2), [0.3, 1.1], v0=[0.8, -0.6]),
        mechanical("two rods, through the stretched arm", rods(2), [0.2, -0.7], v0=[-0.5, 1.6]),
        mechanical(
            "two rods, far apart, the shortest known",
            rods(2),
            [-np.pi / 4, -np.pi / 4],
            q1=[3 * np.pi / 4, 3 * np.pi / 4],
            near=[-1.402, 10.205],
            steps=64,
            log=False,
        ),
        mechanical("two uneven links", uneven, [-0.4, 0.9], q1=[0.7, 1.8]),
        mechanical("three rods", rods(3), [0.1, 0.6, 0.8], q1=[0.9, 1.2, -0.3]),
        mechanical("three uneven links", three, [-0.8, 0.5, 1.0], v0=[0.7, 0.5, -1.1]),
        mechanical(
            "three rods, long", rods(3), [0.2, 0.9, 0.4], v0=[3.0, -4.0, 5.0], log=False, steps=64
        ),
    ]


def human_arms() -> list[Entry]:
    """Arms of men and women, short and wide reaches."""

    def arm(side: str, height: float, mass: float, table: str = "winter", **sex: str) -> Any:
        figures = {"side": side, "height": height, "mass": mass, "table": table, **sex}
        return {"kind": "human arm", **figures}

    right, left = arm("right", 1.75, 70.0), arm("left", 1.8, 82.0)
    return [
        mechanical(
            "human right arm, reach",
            right,
            [0.3, 0.1, -0.4, 0.6, 0.2, 0.0, 0.1],
            q1=[0.9, 0.4, -0.9, 1.3, -0.3, 0.15, -0.4],
        ),
        mechanical(
            "human right arm, wide reach",
            right,
            [0.0, 0.3, -1.6, 0.4, -0.5, 0.1, -0.3],
            q1=[1.9, -0.2, -0.5, 1.8, 0.5, -0.2, 0.4],
            steps=64,
        ),
        mechanical(
            "human right arm of 1 m and 1 kg",
            arm("right", 1.0, 1.0),
            [0.5, 0.2, -0.6, 1.1, 0.3, 0.1, -0.2],
            v0=[0.7, -0.3, 0.4, -0.8, 1.0, -0.9, 0.6],
        ),
        mechanical(
            "human right arm, long",
            right,
            [0.8, 0.2, -0.7, 1.2, -0.2, 0.0, 0.1],
            v0=[2.5, -1.5, 2.0, -3.0, 2.5, 3.0, -2.0],
            steps=64,
            log=False,
        ),
        mechanical(
            "human left arm, reach",
            left,
            [0.4, -0.2, 0.5, 0.9, -0.3, 0.1, 0.2],
            q1=[1.3, 0.1, 1.2, 1.6, 0.3, -0.2, -0.3],
        ),
        mechanical(
            "human right arm, de Leva, male",
            arm("right", 1.82, 78.0, "de_leva", sex="male"),
            [0.6, 0.3, -1.0, 1.0, 0.1, -0.1, 0.3],
            v0=[-0.4, 0.3, 0.2, 0.5, -0.3, 0.6, 0.9],
        ),
        mechanical(
            "human left arm, de Leva, female",
            arm("left", 1.66, 59.0, "de_leva", sex="female"),
            [0.2, -0.1, 0.3, 0.7, 0.2, 0.0, -0.1],
            q1=[0.8, -0.3, 0.6, 1.2, -0.1, 0.1, 0.2],
        ),
    ]


def urdf_arms() -> list[Entry]:
    """The fictitious arm of the data folder."""
    arm = {"kind": "urdf", "file": "known_arm.urdf", "hand": "tool"}
    start = [0.3, -0.4, 0.1, 0.5, 0.8, -0.3]
    return [
        mechanical("URDF arm", arm, start, v0=[0.6, 0.5, 0.2, -0.7, 0.9, 0.4]),
        mechanical("URDF arm, reach", arm, start, q1=[-0.5, 0.6, 0.3, 1.1, -0.4, 0.7]),
        mechanical(
            "URDF arm, long",
            arm,
            start,
            v0=[2.0, -1.5, 0.3, 3.0, -4.0, 2.5],
            steps=64,
            log=False,
        ),
    ]


# -- Riemannian cubics -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Cubic:
    """A Riemannian cubic q(t), t in [0, duration], in closed form.

    Attributes:
        name: unique in the table.
        metric: description of the metric, with its kind.
        duration: of the motion [s].
        motion: q(t) and q'(t).
        action: int (|D_t q'|^2 + tension^2 |q'|^2) / 2 dt.
        source: where it comes from, a sentence.
        tension: zero for cubics [1/s].
    """

    name: str
    metric: Mapping[str, Any]
    duration: float
    motion: Callable[[float], tuple[Array, Array]]
    action: float
    source: str
    tension: float = 0.0


class TimeLaw:
    """An arc length s(t): a cubic polynomial, or c0 + c1 t + a cosh(k t) + b sinh(k t).

    With s'''' = k^2 s'', any geodesic at this arc length is a cubic in tension k: with its unit
    velocity e, D_t q' = s'' e, and R(s'' e, s' e) vanishes.
    """

    def __init__(self, coefficients: Sequence[float], tension: float = 0.0) -> None:
        self.coefficients, self.tension = np.array(coefficients), tension

    def __call__(self, t: float, order: int = 0) -> float:
        """Derivative of this order at t."""
        if self.tension == 0.0:
            polynomial = np.polynomial.Polynomial(self.coefficients)
            return float((polynomial.deriv(order) if order else polynomial)(t))
        c0, c1, a, b = self.coefficients
        pair = [np.cosh(self.tension * t), np.sinh(self.tension * t)]
        pair = pair[::-1] if order % 2 else pair
        line = (c0 + c1 * t, c1, 0.0)[order]
        return float(line + self.tension**order * (a * pair[0] + b * pair[1]))

    def action(self, duration: float) -> float:
        """Half of the integral of s''^2 + tension^2 s'^2."""
        square = self.tension**2
        return integral(lambda t: self(t, 2) ** 2 + square * self(t, 1) ** 2, 0.0, duration) / 2.0


def great_circle_cubic(name: str, law: TimeLaw, duration: float) -> Cubic:
    """Along a great circle."""
    start, tangent = np.array([0.8, 0.0, 0.6]), np.array([-0.36, 0.8, 0.48])

    def motion(t: float) -> tuple[Array, Array]:
        c, s = np.cos(law(t)), np.sin(law(t))
        x, rate = c * start + s * tangent, law(t, 1) * (c * tangent - s * start)
        around = np.hypot(x[0], x[1])
        turning = (x[0] * rate[1] - x[1] * rate[0]) / around**2
        q = [np.arctan2(around, x[2]), np.arctan2(x[1], x[0])]
        return np.array(q), np.array([-rate[2] / around, turning])

    source = "Great circle of arc length s(t) with s'''' = tension^2 s''."
    action = law.action(duration)
    return Cubic(name, {"kind": "sphere"}, duration, motion, action, source, law.tension)


def vertical_line_cubic() -> Cubic:
    """Along a vertical line of the half-plane."""
    law, duration = TimeLaw([-0.2, 0.3, 1.1, -0.7]), 1.2

    def motion(t: float) -> tuple[Array, Array]:
        height = float(np.exp(law(t)))
        return np.array([0.5, height]), np.array([0.0, law(t, 1) * height])

    source = "Vertical line y = exp(s) with a cubic time law s(t)."
    name, metric = "half-plane, vertical line", {"kind": "half-plane"}
    return Cubic(name, metric, duration, motion, law.action(duration), source)


def helix_cubic() -> Cubic:
    """Along a helix on a cylinder."""
    radius, law, duration = 0.7, TimeLaw([0.1, 1.5, -2.0, 1.2]), 1.0
    along = np.array([0.6, 0.8 / radius])

    def motion(t: float) -> tuple[Array, Array]:
        return law(t) * along, law(t, 1) * along

    metric = {"kind": "surface of revolution", "profile": "cylinder", "radius": radius}
    source = "Helix of arc length s with a cubic time law s(t)."
    return Cubic("cylinder, helix", metric, duration, motion, law.action(duration), source)


def plane_cubic() -> Cubic:
    """Cubic polynomials in Cartesian coordinates."""
    x, y = TimeLaw([1.0, 0.3, -0.4, 0.2]), TimeLaw([0.2, 0.9, 0.5, -0.6])

    def motion(t: float) -> tuple[Array, Array]:
        position = np.array([x(t), y(t)])
        dx, dy, radius = x(t, 1), y(t, 1), np.hypot(*position)
        rate = [(x(t) * dx + y(t) * dy) / radius, (x(t) * dy - y(t) * dx) / radius**2]
        return polar(position, 0.0), np.array(rate)

    name, metric = "plane in polar coordinates", {"kind": "polar plane"}
    source = "Cubic polynomials in Cartesian coordinates."
    return Cubic(name, metric, 1.0, motion, x.action(1.0) + y.action(1.0), source)


def circle_of_curvature_one() -> Cubic:
    """The parallel at 45 degrees of the unit sphere, at constant speed: no geodesic."""
    speed, duration = 1.3, 1.1
    rate = np.array([0.0, np.sqrt(2.0) * speed])

    def motion(t: float) -> tuple[Array, Array]:
        return np.array([np.pi / 4.0, 0.2]) + t * rate, rate

    source = (
        "Circle of geodesic curvature k at constant speed c, with normal n: D_t^3 q' = -k^3 c^4 n "
        "and R(D_t q', q') q' = k c^4 n, so that k = 1."
    )
    name, metric = "sphere, circle of geodesic curvature 1", {"kind": "sphere"}
    return Cubic(name, metric, duration, motion, speed**4 * duration / 2.0, source)


def lie_quadratic() -> Cubic:
    """Two rotations at constant rates about two axes at right angles: no geodesic."""
    a, b, duration = 1.4, 0.9, 1.0

    def turn(axis: int, angle: float) -> Array:
        c, s = np.cos(angle), np.sin(angle)
        about_x = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        return np.roll(about_x, (axis, axis), (0, 1))

    first = turn(0, 0.4) @ turn(1, -0.5) @ turn(2, 0.3)

    def motion(t: float) -> tuple[Array, Array]:
        m = first @ turn(0, b * t) @ turn(2, a * t)
        x, y, z = b * np.cos(a * t), -b * np.sin(a * t), a  # the body's angular velocity
        rate = m @ np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        square = 1.0 - m[0, 2] ** 2
        angles = [np.arctan2(-m[1, 2], m[2, 2]), np.arcsin(m[0, 2]), np.arctan2(-m[0, 1], m[0, 0])]
        rates = [
            (m[1, 2] * rate[2, 2] - m[2, 2] * rate[1, 2]) / square,
            rate[0, 2] / np.sqrt(square),
            (m[0, 1] * rate[0, 0] - m[0, 0] * rate[0, 1]) / square,
        ]
        return np.array(angles), np.array(rates)

    source = (
        "R(t) = R(0) exp(b t e_x) exp(a t e_z): the body's angular velocity "
        "V = (b cos a t, -b sin a t, a) satisfies V''' = V'' x V, a Lie quadratic that is not null "
        "(Noakes, J. Math. Phys. 44, 2003)."
    )
    name, metric = "rotations, Lie quadratic", {"kind": "rotations"}
    return Cubic(name, metric, duration, motion, (a * b) ** 2 * duration / 2.0, source)


def cubics() -> list[Cubic]:
    """All Riemannian cubics of the table."""
    law, in_tension = TimeLaw([0.1, 0.4, 1.2, -0.6]), TimeLaw([0.1, 0.9, 0.08, -0.06], 4.0)
    return [
        great_circle_cubic("sphere, great circle", law, 1.0),
        great_circle_cubic("sphere, great circle in tension", in_tension, 0.8),
        vertical_line_cubic(),
        helix_cubic(),
        plane_cubic(),
        circle_of_curvature_one(),
        lie_quadratic(),
    ]


# -- the table -------------------------------------------------------------------------------------


def entries() -> list[Entry]:
    """All geodesics of the table."""
    return [
        euclidean(),
        sphere("sphere, great circle", 0.9, 1.1, 1.3),
        sphere("sphere, near the pole", 0.35, 2.4, 0.8),
        sphere("sphere, past the antipode", 1.3, 1.2, 4.0, log=False),
        half_plane_circle(),
        half_plane_vertical(),
        polar_plane(),
        cylinder(),
        cone(),
        *torus(),
        torus_equator(),
        *catenoid(),
        tip_mass("tip mass", (0.2, 1.2), (1.1, 0.6)),
        tip_mass("tip mass, past the shoulder", (-0.6, 1.9), (1.4, 1.7)),
        *planar_arms(),
        *human_arms(),
        *urdf_arms(),
    ]


def numbers(values: ArrayLike) -> list[float]:
    """Numbers rounded as in the table; without minus zero."""
    return [float(value) + 0.0 for value in np.round(np.asarray(values), DECIMALS)]


def record(entry: Entry) -> dict[str, Any]:
    """The entry as in the table."""
    fields: dict[str, Any] = {
        "name": entry.name,
        "metric": dict(entry.metric),
        "q0": numbers(entry.q0),
        "v0": numbers(entry.v0),
        "q1": numbers(entry.q1),
        "length": round(entry.length, DECIMALS),
        "log": entry.log,
        "tolerances": {"exp": EXP_TOLERANCE, "log": LOG_TOLERANCE},
    }
    if entry.points:
        fields["points"] = [{"s": s, "q": numbers(q)} for s, q in entry.points]
    return {**fields, "source": entry.source}


def record_of_cubic(cubic: Cubic) -> dict[str, Any]:
    """The cubic as in the table."""
    (q0, v0), (q1, v1) = cubic.motion(0.0), cubic.motion(cubic.duration)
    ends = {"q0": q0, "v0": v0, "q1": q1, "v1": v1}
    fields: dict[str, Any] = {"name": cubic.name, "metric": dict(cubic.metric)}
    fields |= {name: numbers(values) for name, values in ends.items()}
    fields |= {"duration": cubic.duration, "tension": cubic.tension}
    fields |= {"action": round(cubic.action, DECIMALS), "tolerance": LOG_TOLERANCE}
    points = ((s, cubic.motion(s * cubic.duration)[0]) for s in QUARTERS)
    fields["points"] = [{"s": s, "q": numbers(q)} for s, q in points]
    return fields | {"source": cubic.source}


def written(lists: Mapping[str, Sequence[Mapping[str, Any]]]) -> str:
    """The table as JSON, with one line for each field."""
    parts = [f'  "format": {json.dumps(FORMAT)}', f'  "version": {VERSION}']
    for name, records in lists.items():
        blocks = []
        for fields in records:
            lines = [f"      {json.dumps(key)}: {json.dumps(each)}" for key, each in fields.items()]
            blocks.append("    {\n" + ",\n".join(lines) + "\n    }")
        parts.append(f"  {json.dumps(name)}: [\n" + ",\n".join(blocks) + "\n  ]")
    return "{\n" + ",\n".join(parts) + "\n}\n"


def difference(a: Any, b: Any) -> float:
    """Largest difference between corresponding numbers; infinite if anything else differs."""
    if isinstance(a, bool) or isinstance(b, bool) or isinstance(a, str) or a is None:
        return 0.0 if a == b else np.inf
    if isinstance(a, (int, float)) and isinstance(b, (int, float)):
        return abs(a - b)
    if isinstance(a, dict) and isinstance(b, dict) and a.keys() == b.keys():
        return max((difference(a[key], b[key]) for key in a), default=0.0)
    if isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        return max((difference(x, y) for x, y in zip(a, b, strict=True)), default=0.0)
    return float(np.inf)


def main() -> int:
    """Write the table, or compare it with the existing one."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare with the table in the file")
    arguments = parser.parse_args()
    file = DATA / "known_geodesics.json"
    known = json.loads(file.read_text(encoding="utf-8")) if arguments.check else {"entries": []}
    KNOWN.update({entry["name"]: entry["v0"] for entry in known["entries"]})
    lists = {"entries": [record(entry) for entry in entries()]}
    table = written(lists | {"cubics": [record_of_cubic(cubic) for cubic in cubics()]})
    if not arguments.check:
        file.write_text(table, encoding="utf-8")
        print(f"written: {file}")
        return 0
    apart = difference(json.loads(table), known)
    same = apart <= SAME
    print(f"{file}: {'agrees' if same else 'DIFFERS'}, by {apart:.1e} at most")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())
