"""named_segments: the joints of a skeleton that carry the segments of the body."""

from __future__ import annotations

from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.skeletons.known_conventions import SKELETON_CONVENTIONS
from geodesic_ocp.recordings.skeletons.skeleton import Skeleton
from geodesic_ocp.recordings.skeletons.skeleton_convention import SkeletonConvention

SIDES = ("right", "left")
_SHOWN = 60  # names of joints in a message


def named_segments(
    file: Path, skeleton: Skeleton, convention: SkeletonConvention | None
) -> tuple[SkeletonConvention, dict[str, int]]:
    """The convention, or the known one that fits best, and the joint of every segment it finds.

    A convention fits if it finds the thorax, and upper arm and forearm of at least one arm; the
    best is the one that finds most segments. Joints must follow each other as the segments do:
    pelvis, abdomen and thorax come before the upper arm, then forearm and hand.

    Raises:
        RecordingError: the convention does not fit, or no known one does.
    """
    if convention is not None:
        found = _found(file, skeleton, convention)
        if not _fits(found):
            known = {_plain(name) for name in skeleton.names}
            absent = [
                name
                for names in convention.joints.values()
                for name in names
                if _plain(name) not in known
            ]
            raise RecordingError(
                f"{file}: by the convention {convention.name!r} there must be a thorax, and an "
                f"upper arm with its forearm. The skeleton has no joint "
                f"{', '.join(absent[:_SHOWN]) or 'that the convention lacks'}; found are "
                f"{', '.join(found) or 'no segments'} among the joints {_listed(skeleton)}"
            )
        return convention, found
    fits, ambiguous = [], []
    for each in SKELETON_CONVENTIONS:
        try:
            fits.append((each, _found(file, skeleton, each)))
        except RecordingError as failure:
            ambiguous.append(failure)
    fits = [(each, found) for each, found in fits if _fits(found)]
    if not fits and ambiguous:
        raise ambiguous[0]
    if not fits:
        raise RecordingError(
            f"{file}: no known convention names the segments of this skeleton. Its joints are "
            f"{_listed(skeleton)}. State which of them carry the thorax and an arm, such as "
            "convention=SkeletonConvention('mine', {'thorax': 'Torso', 'right upper arm': 'RArm', "
            "'right forearm': 'RElbow', 'right hand': 'RWrist'}), or in a JSON or TOML file "
            "(--convention FILE)"
        )
    return max(fits, key=lambda fit: len(fit[1]))


def _fits(found: dict[str, int]) -> bool:
    arms = [f"{side} forearm" in found for side in SIDES]
    return "thorax" in found and any(arms)


def _listed(skeleton: Skeleton) -> str:
    names = [name for name in skeleton.names if name]
    return ", ".join(names[:_SHOWN]) + (", ..." if len(names) > _SHOWN else "")


def _plain(name: str) -> str:
    """The name as it is compared: no namespace, case, spaces, hyphens or underscores."""
    letters = name.rpartition(":")[2].lower()
    return "".join(letter for letter in letters if letter not in " -_\t")


def _found(file: Path, skeleton: Skeleton, convention: SkeletonConvention) -> dict[str, int]:
    plain = [_plain(name) for name in skeleton.names]

    def first(segment: str, above: int | None, below: list[int]) -> int | None:
        """The best-named joint of the segment, under the joint `above` and over those `below`."""
        for name in convention.joints.get(segment, ()):
            matches = [
                joint
                for joint, given in enumerate(plain)
                if given == _plain(name)
                and (above is None or above in skeleton.path(joint)[:-1])
                and all(joint in skeleton.path(other)[:-1] for other in below)
            ]
            if len(matches) > 1:
                raise RecordingError(
                    f"{file}: {len(matches)} joints are named {name}, any of which may carry the "
                    f"{segment}: their names must differ"
                )
            if matches:
                return matches[0]
        return None

    found: dict[str, int] = {}
    for side in SIDES:
        above: int | None = None
        for segment in ("upper arm", "forearm", "hand"):
            joint = first(f"{side} {segment}", above, [])
            if joint is None:
                break
            above = found[f"{side} {segment}"] = joint
        if f"{side} forearm" not in found:
            found.pop(f"{side} upper arm", None)
    below = [found[f"{side} upper arm"] for side in SIDES if f"{side} upper arm" in found]
    for segment in ("thorax", "abdomen", "pelvis"):
        joint = first(segment, None, below)
        if joint is not None:
            found[segment] = joint
            below = [joint]
    return found
