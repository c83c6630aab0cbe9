"""The links of one or several arms in a common base frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from geodesic_ocp.arrays import Array, as_rotation, as_vector
from geodesic_ocp.model.link_geometry import LinkGeometry
from geodesic_ocp.model.link_solids import LinkSolid, Pose, joint_poses, link_solids, reach_bound
from geodesic_ocp.model.model import Model

_SAME = 1e-9  # [m]: rounding


@dataclass(frozen=True, eq=False)
class PlacedSolid:
    """A link with geometry.

    Attributes:
        arm: index of the model that has it.
        name: of the link, unique among all arms.
        parent: name of the nearest link before it that has geometry; "" if there is none.
        solid: its geometry.
    """

    arm: int
    name: str
    parent: str
    solid: LinkSolid = field(repr=False)

    @property
    def moves(self) -> bool:
        """Whether one of the joints moves it."""
        return self.solid.joint > 0


@dataclass(frozen=True, eq=False)
class PlacedSolids:
    """The links of one or several arms in a common base frame.

    Attributes:
        models: the arms.
        bases: poses of their bases in the common base frame.
        solids: their links with geometry; what several arms of one robot share is there once.
        placed: whether it is known where the arms are relative to each other.
        unknown: what is not known, a sentence each.
    """

    models: tuple[Model, ...]
    bases: tuple[Pose, ...]
    solids: tuple[PlacedSolid, ...] = field(repr=False)
    placed: bool
    unknown: tuple[str, ...]

    @property
    def dof(self) -> int:
        """Number N of joints of all arms."""
        return sum(model.dof for model in self.models)

    def joint_poses(self, q: Array) -> list[Pose]:
        """For each arm rotations (k, j, 3, 3) and positions (k, j, 3) of its joints at q (k, N)."""
        poses, first = [], 0
        for model, (base, origin) in zip(self.models, self.bases, strict=True):
            rotations, positions = joint_poses(model, q[:, first : first + model.dof])
            poses.append((base @ rotations, positions @ base.T + origin))
            first += model.dof
        return poses


def place_solids(models: Sequence[Model], placements: Sequence[Any] | None = None) -> PlacedSolids:
    """The links of arms, placed as in `combine`.

    Args:
        models: one or more arms.
        placements: for each the position of its base in the common base frame, (3,) [m], or a pair
            of rotation (3, 3) and position. None: known only if the arms are of one robot, that is
            of the same file, with different joints and the same base.

    Raises:
        ValueError: no arms, or wrong placements.
    """
    models = tuple(models)
    if not models or not all(isinstance(model, Model) for model in models):
        raise ValueError(f"arms must be one or more models, got {models!r}")
    bases = _bases(placements, len(models))
    titles = _titles(models)
    found: list[tuple[LinkSolid, ...]] = []
    unknown = []
    for model, title in zip(models, titles, strict=True):
        try:
            found.append(link_solids(model))
        except ValueError as error:
            found.append(())
            unknown.append(f"clearance of {title} is not known: {error}")
            continue
        if not any(solid.joint > 0 for solid in found[-1]):
            unknown.append(f"clearance of {title} is not known: its links have no geometry")
    is_one_robot = _is_one_robot(models, bases, found)
    placed = placements is not None or len(models) == 1 or is_one_robot
    if not placed:
        unknown.append(
            f"clearance between {' and '.join(titles)} is not known without the placements of "
            "their bases"
        )
    if is_one_robot:
        found = _without_shared(found)
    solids = _within_reach(models, bases, _named(found, titles), placed)
    return PlacedSolids(models, bases, solids, placed, tuple(unknown))


def _bases(given: Sequence[Any] | None, count: int) -> tuple[Pose, ...]:
    if given is None:
        return ((np.eye(3), np.zeros(3)),) * count
    if not isinstance(given, (Sequence, np.ndarray)) or len(given) != count:
        raise ValueError(f"placements must be one for each of {count} arms, got {given!r}")
    poses = []
    for index, value in enumerate(given):
        rotation, position = np.eye(3), value
        if isinstance(value, (tuple, list)) and len(value) == 2 and np.ndim(value[0]) > 0:
            rotation, position = value
        name = f"placements[{index}]"
        poses.append((as_rotation(name, rotation), as_vector(name, position, 3)))
    return tuple(poses)


def _titles(models: Sequence[Model]) -> list[str]:
    """Names of the models, numbered where several share one."""
    counts = Counter(model.name for model in models)
    seen: Counter[str] = Counter()
    titles = []
    for model in models:
        seen[model.name] += 1
        several = counts[model.name] > 1
        titles.append(f"{model.name} {seen[model.name]}" if several else model.name)
    return titles


def _is_one_robot(
    models: Sequence[Model], bases: Sequence[Pose], found: Sequence[tuple[LinkSolid, ...]]
) -> bool:
    """Whether the models are different joints of one file, whose fixed links coincide."""
    shapes = [model.shapes for model in models]
    texts = {each.text for each in shapes if isinstance(each, LinkGeometry)}
    if not all(isinstance(each, LinkGeometry) for each in shapes) or len(texts) != 1:
        return False
    joints = [name for model in models for name in model.joint_names]
    if len(set(joints)) < len(joints):
        return False
    fixed = [{each.link: each for each in solids if each.joint == 0} for solids in found]
    shared = set.intersection(*map(set, fixed))
    for link in shared:
        poses = [
            (base @ own[link].at_joint.rotation, base @ own[link].at_joint.translation + origin)
            for (base, origin), own in zip(bases, fixed, strict=True)
        ]
        for rotation, position in poses[1:]:
            apart = np.abs(rotation - poses[0][0]).max(), np.abs(position - poses[0][1]).max()
            if max(apart) > _SAME:
                return False
    return True


def _without_shared(found: Sequence[tuple[LinkSolid, ...]]) -> list[tuple[LinkSolid, ...]]:
    """Each link once: with the arm that moves it, or else with the first arm."""
    owners: dict[str, int] = {}
    for arm, solids in enumerate(found):
        for solid in solids:
            if solid.joint > 0 or solid.link not in owners:
                owners[solid.link] = arm
    return [
        tuple(solid for solid in solids if owners[solid.link] == arm)
        for arm, solids in enumerate(found)
    ]


def _named(found: Sequence[tuple[LinkSolid, ...]], titles: Sequence[str]) -> list[PlacedSolid]:
    counts = Counter(solid.link for solids in found for solid in solids)

    def name(link: str, title: str) -> str:
        return f"{title}/{link}" if counts[link] > 1 else link

    return [
        PlacedSolid(arm, name(each.link, title), name(each.parent, title), each)
        for arm, (solids, title) in enumerate(zip(found, titles, strict=True))
        for each in solids
    ]


def _within_reach(
    models: Sequence[Model], bases: Sequence[Pose], solids: Sequence[PlacedSolid], placed: bool
) -> tuple[PlacedSolid, ...]:
    """All links but the fixed ones that no moving link can reach, by the lengths of all links."""
    balls = []
    for arm, model in enumerate(models):
        moving = [each.solid for each in solids if each.arm == arm and each.moves]
        if moving:
            centre, radius = reach_bound(model, moving)
            balls.append((arm, bases[arm][0] @ centre + bases[arm][1], radius))

    def is_reached(each: PlacedSolid) -> bool:
        rotation, position = bases[each.arm]
        return any(
            each.solid.least_distance(rotation.T @ (centre - position)) <= radius
            for arm, centre, radius in balls
            if placed or arm == each.arm
        )

    return tuple(each for each in solids if each.moves or is_reached(each))
