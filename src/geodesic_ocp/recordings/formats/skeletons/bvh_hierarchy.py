"""The hierarchy of joints in a BVH file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from geodesic_ocp.errors import RecordingError
from geodesic_ocp.recordings.formats.skeletons.text_lines import numbers

_CHANNELS = tuple(f"{axis}{what}" for what in ("rotation", "position") for axis in "xyz")
_DEEPEST = 200  # joints from the root to the end of a limb


@dataclass(eq=False)
class BvhJoint:
    """A joint of the hierarchy.

    Attributes:
        line: on which it begins.
        name: None for an end site.
        parent: index of its parent; -1 for the root.
        offset: (3,), in the file's unit.
        channels: names in lower case, such as "zrotation", in the order of the file.
        first: column of its first channel.
    """

    line: int
    name: str | None
    parent: int
    offset: list[float] | None = None
    channels: tuple[str, ...] | None = None
    first: int = 0

    def columns(self, what: str) -> tuple[str, list[int]]:
        """Axes of the channels of a kind, "rotation" or "position", and their columns."""
        channels = [(i, name) for i, name in enumerate(self.channels or ()) if name.endswith(what)]
        return "".join(name[0] for _, name in channels), [self.first + i for i, _ in channels]


@dataclass(eq=False)
class BvhHierarchy:
    """Joints, parents before their children; the number of channels; the index of line MOTION."""

    joints: list[BvhJoint] = field(default_factory=list)
    columns: int = 0
    end: int = 0


def read_hierarchy(file: Path, lines: list[str]) -> BvhHierarchy:
    """Read everything before the line MOTION.

    Raises:
        RecordingError: the hierarchy is malformed; the message names the line.
    """
    tree = BvhHierarchy()
    parent, opened, begun = -1, True, False
    for index, line in enumerate(lines):
        number = index + 1
        words = line.replace("{", " { ").replace("}", " } ").split()
        if words and not begun:
            if words[0].upper() != "HIERARCHY":
                raise RecordingError(
                    f"{file}: line {number}: a BVH begins with HIERARCHY, not {line.strip()[:40]!r}"
                )
            begun, words = True, words[1:]
        while words:
            key = words[0].upper()
            if not opened and key != "{":
                raise RecordingError(f"{file}: line {number}: expected '{{', found {words[0]!r}")
            joint = tree.joints[parent] if parent >= 0 else None
            if key == "MOTION":
                _check_complete(file, tree, number, parent)
                tree.end = index
                return tree
            if key == "{":
                if opened:
                    raise RecordingError(f"{file}: line {number}: '{{' without a joint")
                opened, words = True, words[1:]
            elif key in ("ROOT", "JOINT", "END"):
                end = words.index("{") if "{" in words else len(words)
                name = " ".join(words[1:end])
                if (key == "ROOT") != (parent < 0) or (key == "ROOT" and tree.joints):
                    raise RecordingError(
                        f"{file}: line {number}: "
                        + (
                            "a second ROOT: more than one person, or a file of several skeletons, "
                            "cannot be read"
                            if key == "ROOT" and parent < 0
                            else f"{words[0]} {'within' if key == 'ROOT' else 'outside of'} a joint"
                        )
                    )
                if not name or (joint is not None and joint.name is None):
                    raise RecordingError(
                        f"{file}: line {number}: "
                        + ("an end site has no joints" if name else f"{words[0]} without a name")
                    )
                tree.joints.append(BvhJoint(number, None if key == "END" else name, parent))
                parent, opened, words = len(tree.joints) - 1, False, words[end:]
                _check_depth(file, tree, parent)
            elif joint is None:
                raise RecordingError(
                    f"{file}: line {number}: {words[0][:40]!r} is outside of the skeleton"
                )
            elif key == "}":
                parent, words = joint.parent, words[1:]
            elif key == "OFFSET" and joint.offset is None:
                joint.offset = numbers(file, number, "OFFSET", words[1:4], 3)
                words = words[4:]
            elif key == "CHANNELS" and joint.channels is None and joint.name is not None:
                joint.channels, words = _channels(file, number, words[1:])
                joint.first = tree.columns
                tree.columns += len(joint.channels)
            else:
                raise RecordingError(
                    f"{file}: line {number}: did not expect {words[0][:40]!r} in "
                    f"{joint.name or 'an end site'}"
                )
    raise RecordingError(f"{file}: the line MOTION is missing: is the file cut off?")


def _channels(file: Path, line: int, words: list[str]) -> tuple[tuple[str, ...], list[str]]:
    """Names of the channels in lower case, and the words after them."""
    count = words[0] if words else ""
    if not (count.isdecimal() and len(count) == 1 and int(count) <= len(_CHANNELS)):
        raise RecordingError(f"{file}: line {line}: CHANNELS needs a number up to 6, has {count!r}")
    names = tuple(word.lower() for word in words[1 : int(count) + 1])
    if len(names) < int(count) or not set(names) <= set(_CHANNELS) or len(set(names)) < len(names):
        raise RecordingError(
            f"{file}: line {line}: CHANNELS {count} must be followed by {count} different names "
            f"such as Xposition or Zrotation, is followed by {' '.join(words[1:])[:80]!r}"
        )
    return names, words[int(count) + 1 :]


def _check_depth(file: Path, tree: BvhHierarchy, joint: int) -> None:
    depth, line = 0, tree.joints[joint].line
    while joint >= 0:
        depth, joint = depth + 1, tree.joints[joint].parent
    if depth > _DEEPEST:
        raise RecordingError(f"{file}: line {line}: more than {_DEEPEST} joints within each other")


def _check_complete(file: Path, tree: BvhHierarchy, line: int, parent: int) -> None:
    if not tree.joints:
        raise RecordingError(f"{file}: line {line}: MOTION, but there is no joint")
    if parent >= 0:
        name = tree.joints[parent].name
        raise RecordingError(
            f"{file}: line {line}: MOTION, but the joint {name} is not closed by '}}'"
        )
    for joint in tree.joints:
        for what, given in (("OFFSET", joint.offset), ("CHANNELS", joint.channels)):
            if given is None and (what == "OFFSET" or joint.name is not None):
                raise RecordingError(
                    f"{file}: line {joint.line}: {joint.name or 'the end site'} has no {what}"
                )
    if not tree.columns:
        raise RecordingError(f"{file}: no joint has CHANNELS")
