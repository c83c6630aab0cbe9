"""Fewer synergies for a robot: short ones are dropped, small ones merged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Literal, NamedTuple

import numpy as np

from geodesic_ocp.arrays import as_number
from geodesic_ocp.synergies.synergy import Synergy

# Of the arm's longest synergy.
_DROPPED = 0.03
_MERGED = 0.15
_REST = 0.1  # [s], shortest pause that becomes a rest

Kind = Literal["kept", "merged", "rest"]


@dataclass(frozen=True)
class SynergyGroup:
    """One synergy of the robot, and the person's synergies from which it is made.

    Attributes:
        start, stop: indices of its first and last sample in the recording.
        members: indices of the person's synergies in this time span, from 0.
        dropped: indices of those that were dropped as too short.
        kind: "kept", a single synergy; "merged", several; or "rest", during which the arm does not
            move, as all members were dropped.
    """

    start: int
    stop: int
    members: tuple[int, ...]
    dropped: tuple[int, ...]
    kind: Kind


class _Piece(NamedTuple):
    """Neighbouring synergies that are being merged."""

    first: int
    last: int
    length: float
    seconds: float
    still: bool = False

    def with_(self, other: _Piece) -> _Piece:
        first = min(self.first, other.first)
        last = max(self.last, other.last)
        return _Piece(first, last, self.length + other.length, self.seconds + other.seconds)


def merge_synergies(
    synergies: Sequence[Synergy], *, drop: float | None = None, merge: float | None = None
) -> tuple[SynergyGroup, ...]:
    """Group synergies, each group to become one synergy of the robot; in order, without gaps.

    1. Neighbours shorter than `drop` are joined. If they are shorter than `drop` even together,
       they are dropped: they become a rest if they last 0.1 s or longer, or are at the beginning or
       the end; otherwise the following synergy takes their time.
    2. Remaining neighbours shorter than `merge` are joined until they are as long as that together.
    3. Those still shorter join their shorter neighbour, unless both neighbours are rests.
    Synergies at least as long as `merge` are never joined with each other.

    >>> import numpy as np
    >>> import geodesic_ocp as go
    >>> arm, time = go.human_arm(), np.linspace(0.0, 1.0, 101)
    >>> reach = np.outer(3.0 * time**2 - 2.0 * time**3, np.full(7, 0.5))
    >>> analysis = go.analyse(arm, go.Motion(time, reach, arm.joint_names).filtered())
    >>> [(group.start, group.stop) for group in go.retargeting.merge_synergies(analysis.synergies)]
    [(0, 51), (51, 100)]

    Args:
        synergies: synergies of one arm, one after the other.
        drop, merge: lengths in the synergies' metric; by default 3 % and 15 % of the longest one.

    Raises:
        ValueError: there are no synergies, `drop` is negative or above `merge`.
    """
    if not synergies:
        raise ValueError("there are no synergies to merge")
    lengths = [synergy.length for synergy in synergies]
    drop = _DROPPED * max(lengths) if drop is None else as_number("drop", drop)
    merge = max(drop, _MERGED * max(lengths)) if merge is None else as_number("merge", merge)
    if not 0.0 <= drop <= merge:
        raise ValueError(f"drop and merge must be 0 <= drop <= merge, got {drop:g} and {merge:g}")
    pieces = [_Piece(k, k, each.length, each.duration) for k, each in enumerate(synergies)]
    pieces = _rested(_joined(pieces, drop, np.inf), drop)
    pieces = _attached(_joined(pieces, merge, merge), merge)
    return tuple(_group(piece, synergies, drop) for piece in pieces)


def moving(group: SynergyGroup) -> SynergyGroup:
    """Return a rest as a movement."""
    kind: Kind = "kept" if len(group.members) == 1 else "merged"
    return replace(group, dropped=(), kind=kind)


def _joined(pieces: list[_Piece], below: float, enough: float) -> list[_Piece]:
    """Join neighbours below a length until they are long enough together."""
    result: list[_Piece] = []
    is_open = False
    for piece in pieces:
        small = not piece.still and piece.length < below
        if small and is_open:
            result[-1] = result[-1].with_(piece)
        else:
            result.append(piece)
        is_open = small and result[-1].length < enough
    return result


def _rested(pieces: list[_Piece], drop: float) -> list[_Piece]:
    """Turn pieces below `drop` into rests, or join them to the next piece if they are brief."""
    result: list[_Piece] = []
    waiting: _Piece | None = None
    for index, piece in enumerate(pieces):
        if piece.length >= drop and piece.length > 0.0:
            # A dropped piece contributes its time, not its length.
            result.append(piece if waiting is None else piece.with_(waiting._replace(length=0.0)))
            waiting = None
        elif piece.seconds >= _REST or index in (0, len(pieces) - 1):
            result.append(piece._replace(still=True))
        else:
            waiting = piece
    return result


def _attached(pieces: list[_Piece], merge: float) -> list[_Piece]:
    """Join pieces below `merge` to the shorter of their moving neighbours."""
    while True:
        for index, piece in enumerate(pieces):
            if piece.still or piece.length >= merge:
                continue
            around = [
                other
                for other in (index - 1, index + 1)
                if 0 <= other < len(pieces) and not pieces[other].still
            ]
            if around:
                other = min(around, key=lambda each: pieces[each].length)
                low = min(index, other)
                pieces = [*pieces[:low], piece.with_(pieces[other]), *pieces[low + 2 :]]
                break
        else:
            return pieces


def _group(piece: _Piece, synergies: Sequence[Synergy], drop: float) -> SynergyGroup:
    members = tuple(range(piece.first, piece.last + 1))
    start = synergies[piece.first].start
    stop = synergies[piece.last].stop
    if piece.still:
        return SynergyGroup(start, stop, members, members, "rest")
    # Several short ones in a row may be a movement together.
    dropped: list[int] = []
    for short, run in groupby(members, key=lambda index: synergies[index].length < drop):
        numbers = list(run)
        if short and sum(synergies[index].length for index in numbers) < drop:
            dropped += numbers
    kind: Kind = "kept" if len(members) - len(dropped) == 1 else "merged"
    return SynergyGroup(start, stop, members, tuple(dropped), kind)
