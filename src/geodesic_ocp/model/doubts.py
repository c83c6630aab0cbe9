"""Numbers in a robot's file that can hardly be right: moments, masses and limits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from geodesic_ocp.model.joints import link_of, motion_subspace

NO_LIMIT = 1e5  # [rad, rad/s or N m]: numbers in files from here on stand for no limit
_DENSEST = 22_590.0  # [kg/m^3], osmium (CRC Handbook of Chemistry and Physics)
_PER_KG_CM2 = 1e-4  # [kg m^2], of the units of CAD programs the next larger numbers


@dataclass(frozen=True)
class _Link:
    """A link that turns, with all that is fixed to it.

    Attributes:
        name: of its frame.
        mass: [kg].
        moments: principal moments of inertia, the largest one last (3,) [kg m^2].
    """

    name: str
    mass: float
    moments: tuple[float, ...]

    @property
    def described(self) -> str:
        listed = ", ".join(f"{moment:.3g}" for moment in self.moments)
        return f"{self.mass:.3g} kg, moments {listed} kg m^2"

    @property
    def is_possible(self) -> bool:
        """True if the moments satisfy the triangle inequality."""
        first, second, largest = self.moments
        # With three digits, the first of which is 1, the largest moment and the sum of the others
        # are rounded by up to 0.5 % each.
        return largest <= 1.01 * (first + second)

    @property
    def is_too_dense(self) -> bool:
        """True if a ball of this mass and of the densest material has larger moments."""
        radius = (3.0 * self.mass / (4.0 * np.pi * _DENSEST)) ** (1.0 / 3.0)
        return bool(sum(self.moments) < 6.0 / 5.0 * self.mass * radius**2)

    @property
    def may_be_in_kg_cm2(self) -> bool:
        """True if a solid ellipsoid of this mass and of these moments in kg cm^2 is not too dense.

        Its semi-axes are a^2 = 5 (B + C - A) / (2 m), where A, B, C are the moments.
        """
        moments = _PER_KG_CM2 * np.array(self.moments)
        squares = 2.5 * (moments.sum() - 2.0 * moments) / self.mass
        volume = 4.0 / 3.0 * np.pi * np.sqrt(np.prod(np.maximum(squares, 0.0)))
        return bool(self.mass < _DENSEST * volume)


def doubts_of(model: pin.Model) -> tuple[str, ...]:
    """Return what can hardly be right in a model with one coordinate per joint, a sentence each.

    - Principal moments of inertia a <= b <= c of a body satisfy c <= a + b.
    - Of all bodies of a mass m, a solid ball has the least moments, a + b + c = 6/5 m r^2. If it
      had to be denser than any material, the mass is in grams or the moments are placeholders.
    - The other way round, moments that are possible in kg cm^2, ten thousand times smaller, are in
      this unit or in one with larger numbers, or placeholders. Links would have to be as dense as
      22.6 g/m^3 for it.
    - The same mass of most links, and of at least four, is a placeholder.
    - Revolute joints do not have limits of more than two turns; as degrees they are possible.
      Nor are all of their limits smaller than those of two turns whose radians are read as degrees.
    - They do not turn more than ten times a second; as degrees per second they are slow.
    - A limit of 0 on speed or effort is an unknown one.
    """
    links = _turning_links(model)
    return (
        *_inertia_doubts(links),
        *_placeholder_doubts(links),
        *_limit_doubts(model),
    )


def _first_of(noun: str, names: Sequence[str]) -> str:
    """Return the first name, and the number of the others."""
    rest = len(names) - 1
    others = f" and {rest} other{'s' if rest > 1 else ''}" if rest else ""
    return f"{noun} {names[0]!r}{others}"


def _links(links: Sequence[_Link]) -> str:
    return _first_of("link", [link.name for link in links])


def _joints(names: Sequence[str], rows: Sequence[int]) -> str:
    return _first_of("joint", [names[row] for row in rows])


def _turning_links(model: pin.Model) -> list[_Link]:
    turns = [False] * model.njoints
    links = []
    for index in range(1, model.njoints):
        own = bool(np.any(motion_subspace(model, index)[3:]))
        turns[index] = own or turns[model.parents[index]]
        body = model.inertias[index]
        if turns[index] and body.mass > 0.0:
            moments = tuple(np.linalg.eigvalsh(body.inertia).tolist())
            links.append(_Link(link_of(model, index), float(body.mass), moments))
    return links


def _inertia_doubts(links: Sequence[_Link]) -> Iterator[str]:
    impossible = [link for link in links if not link.is_possible]
    if impossible:
        yield (
            f"{_links(impossible)}: no rigid body has moments of which the largest is "
            f"larger than the sum of the others ({impossible[0].described})"
        )
    large = [link for link in links if link.is_possible and link.may_be_in_kg_cm2]
    if large:
        yield (
            f"{_links(large)}: such large moments are not those of a body of this mass "
            f"({large[0].described}); are they in kg cm^2 or kg mm^2, or placeholders?"
        )
    dense = [link for link in links if link.is_possible and link.is_too_dense]
    if dense:
        yield (
            f"{_links(dense)}: no material is as dense as a body of this mass and these "
            f"moments ({dense[0].described}); are masses in grams, or moments placeholders?"
        )


def _placeholder_doubts(links: Sequence[_Link]) -> Iterator[str]:
    seen = Counter(f"{link.mass:.6g}" for link in links)
    for mass, count in seen.most_common(1):
        # Two or three equal links are the pendulums and planar arms of textbooks.
        if count > 3 and count > len(links) / 2.0:
            yield f"{count} of {len(links)} links weigh {mass} kg each; is this a placeholder?"


def _limit_doubts(model: pin.Model) -> Iterator[str]:
    names = list(map(str, model.names))[1:]
    turning = [bool(np.any(motion_subspace(model, k)[3:])) for k in range(1, model.njoints)]
    limits = np.maximum(np.abs(model.lowerPositionLimit), np.abs(model.upperPositionLimit))
    # Cables allow no joint more than two turns either way; as degrees these numbers are possible.
    in_range = (limits > 4.0 * np.pi) & (limits <= 720.0)
    wide = [k for k in range(model.nv) if turning[k] and in_range[k]]
    if wide:
        first = wide[0]
        shown = f"{model.lowerPositionLimit[first]:.4g} to {model.upperPositionLimit[first]:.4g}"
        yield f"{_joints(names, wide)}: limits of {shown} rad; are these degrees?"
    limited = [k for k in range(model.nv) if turning[k] and 0.0 < limits[k] < NO_LIMIT]
    narrow = [k for k in limited if limits[k] <= np.deg2rad(4.0 * np.pi)]
    if len(narrow) > 1 and len(narrow) == np.count_nonzero(turning):
        first = narrow[0]
        shown = f"{model.lowerPositionLimit[first]:.3g} to {model.upperPositionLimit[first]:.3g}"
        yield f"{_joints(names, narrow)}: limits of {shown} rad; were radians read as degrees?"
    speeds = model.velocityLimit
    turns = speeds / (2.0 * np.pi)  # per second
    # The fastest joints of legged robots turn 8 times a second (52 rad/s, Unitree Laikago), those
    # of arms 4 times; slow arms turn by 60 and more degrees per second.
    in_range = (turns > 10.0) & (speeds < NO_LIMIT)
    fast = [k for k in range(model.nv) if turning[k] and in_range[k]]
    if fast:
        first = fast[0]
        yield (
            f"{_joints(names, fast)}: a limit of {speeds[first]:.4g} rad/s, {turns[first]:.3g} "
            "turns per second; are these degrees, or does it stand for none?"
        )
    efforts = np.maximum(np.abs(model.lowerEffortLimit), np.abs(model.upperEffortLimit))
    for what, values in (("speed", speeds), ("effort", efforts)):
        if unknown := np.flatnonzero(values == 0.0).tolist():
            yield f"{_joints(names, unknown)}: no limit on {what} is known, as it is 0 or left out"
