"""Writers of skeleton files with known segment orientations, by kinematics of their own."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

import geodesic_ocp as go
from geodesic_ocp.arrays import Array
from geodesic_ocp.trajectory.motion import FrameMotion

ORDERS = ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
# From a space with z up (x right, y forward) to the files' with y up and z forward.
FILE = np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
# Axes of an arm in a T pose: abducted by 90 degrees, the palms down.
RIGHT, LEFT = (Rotation.from_euler("y", angle, degrees=True).as_matrix() for angle in (-90, 90))
SIDES = {"right": RIGHT, "left": LEFT}
# Joint, parent, offset in the file's axes, segment.
TREE = (
    ("Hips", None, (0.0, 0.0, 0.0), "pelvis"),
    ("RightUpLeg", "Hips", (-8.0, -4.0, 0.0), None),
    ("Spine", "Hips", (0.0, 10.0, -1.0), "abdomen"),
    ("Spine1", "Spine", (0.0, 12.0, 0.0), "thorax"),
    ("Neck", "Spine1", (0.0, 25.0, 1.0), None),
    ("RightShoulder", "Spine1", (-4.0, 20.0, 0.0), None),
    ("RightArm", "RightShoulder", (-14.0, 0.0, 0.0), "right upper arm"),
    ("RightForeArm", "RightArm", (-29.0, 0.0, 0.0), "right forearm"),
    ("RightHand", "RightForeArm", (-26.0, 0.0, 0.0), "right hand"),
    ("LeftShoulder", "Spine1", (4.0, 20.0, 0.0), None),
    ("LeftArm", "LeftShoulder", (14.0, 0.0, 0.0), "left upper arm"),
    ("LeftForeArm", "LeftArm", (29.0, 0.0, 0.0), "left forearm"),
    ("LeftHand", "LeftForeArm", (26.0, 0.0, 0.0), "left hand"),
)
LIMITS = {  # [rad] of MMM's joints, away from gimbal lock
    "Sx": (-0.8, 1.4),
    "Sz": (-0.8, 0.8),
    "Sy": (-1.2, 1.2),
    "Ex": (0.2, 2.3),
    "Ez": (-1.2, 1.2),
    "Wx": (-0.4, 0.4),
    "Wy": (-0.9, 0.9),
    "B": (-0.3, 0.3),
}
JOINTS = tuple(
    [f"{group}{axis}_joint" for group in ("BP", "BT") for axis in "xzy"]
    + [f"{side}{joint}_joint" for side in "RL" for joint in list(LIMITS)[:-1]]
)


def smooth_motion(seed: int, count: int = 12) -> go.Motion:
    """A motion of trunk and both arms, each angle a sine between its limits; the thorax moves."""
    random = np.random.default_rng(seed)
    time = np.arange(count) / 50.0
    columns = []
    for name in JOINTS:
        low, high = LIMITS["B" if name[0] == "B" else name[1:3]]
        phase, speed = random.uniform(0.0, 2.0 * np.pi), random.uniform(1.0, 4.0)
        columns.append(0.5 * (low + high) + 0.5 * (high - low) * np.sin(phase + speed * time))
    turning = Rotation.from_rotvec(0.3 * np.sin(time[:, None] + random.uniform(0.0, 6.0, 3)))
    moving = [0.1, 0.2, 1.3] + 0.1 * np.sin(time[:, None] + random.uniform(0.0, 6.0, 3))
    trunk = FrameMotion(turning.as_matrix(), moving)
    return go.Motion(time, np.stack(columns, axis=1), JOINTS, trunk=trunk)


def rotations_in_file(rotations: dict[str, Array]) -> dict[str, Array]:
    """Rotations (k, 3, 3) of the tree's joints in the file's space, identity in the T pose."""
    joints: dict[str, Array] = {}
    for name, parent, _, segment in TREE:
        if segment is None:
            joints[name] = joints[str(parent)]
            continue
        rest = SIDES[segment.split()[0]] if " " in segment else np.eye(3)
        joints[name] = FILE @ rotations[segment] @ rest.T @ FILE.T
    return joints


def local_rotations(joints: dict[str, Array]) -> dict[str, Array]:
    """Rotations of the joints relative to their parents."""
    return {
        name: np.swapaxes(joints[parent], 1, 2) @ joints[name] if parent else joints[name]
        for name, parent, _, _ in TREE
    }


def root_positions(joints: dict[str, Array], shoulders: Array, unit: float) -> Array:
    """Positions (k, 3) of the root in the file that bring the middle of the shoulders there [m]."""
    middle = np.zeros_like(shoulders)
    for side in ("Right", "Left"):
        for name, parent, offset, _ in TREE:
            if name in ("Spine", "Spine1", f"{side}Shoulder", f"{side}Arm"):
                middle += 0.5 * joints[str(parent)] @ np.array(offset)
    return shoulders @ FILE.T / unit - middle


def write_bvh(
    file: Path,
    joints: dict[str, Array],
    roots: Array,
    rate: float,
    orders: dict[str, str],
    turned: dict[str, Array] | None = None,
) -> Path:
    """Write the T pose skeleton and its motion; the channels follow these orders of axes.

    With the joints' frames turned by rotations (3, 3) the T pose is not that of zero angles.
    """
    children: dict[str | None, list[str]] = {}
    for name, parent, _, _ in TREE:
        children.setdefault(parent, []).append(name)
    turned = turned or {name: np.eye(3) for name, *_ in TREE}
    offsets = {
        name: np.array(offset) @ (turned[parent] if parent else np.eye(3))
        for name, parent, offset, _ in TREE
    }
    local = local_rotations({name: joints[name] @ turned[name] for name in joints})
    columns: list[Array] = []
    lines = ["HIERARCHY"]

    def write(name: str, depth: int) -> None:
        indent = "\t" * depth
        lines.append(f"{indent}{'ROOT' if not depth else 'JOINT'} {name}")
        lines.append(f"{indent}{{")
        lines.append(f"{indent}\tOFFSET " + " ".join(f"{x:.12g}" for x in offsets[name]))
        channels = [f"{axis}rotation" for axis in orders[name]]
        if not depth:
            channels = ["Xposition", "Yposition", "Zposition", *channels]
            columns.append(roots)
        lines.append(f"{indent}\tCHANNELS {len(channels)} {' '.join(channels)}")
        angles = Rotation.from_matrix(local[name]).as_euler(orders[name], degrees=True)
        columns.append(angles)
        for child in children.get(name, []):
            write(child, depth + 1)
        if name not in children:
            lines.extend([f"{indent}\tEnd Site", f"{indent}\t{{"])
            lines.extend([f"{indent}\t\tOFFSET 0.0 -5.0 0.0", f"{indent}\t}}"])
        lines.append(f"{indent}}}")

    write("Hips", 0)
    values = np.hstack(columns)
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1.0 / rate:.9f}"]
    lines += [" ".join(f"{x:.12g}" for x in row) for row in values]
    file.write_text("\n".join(lines) + "\n")
    return file


# From the files' axes to those of MVN: x forward, y left, z up.
MVN = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
SEGMENTS = {"Hips": "Pelvis", "Spine": "L3", "Spine1": "T8"} | {
    f"{side}{name}": f"{side}{other}"
    for side in ("Right", "Left")
    for name, other in (("Arm", "UpperArm"), ("ForeArm", "ForeArm"))
}


def write_mvnx(
    file: Path,
    joints: dict[str, Array],
    roots: Array,
    rate: float,
    rest: str = "identity",
    heading: float = 0.0,
) -> Path:
    """Write segments of MVN in metres; offsets are in centimetres.

    The T pose is a frame of type `rest`, in which the person faces a direction [rad] from x.
    """
    facing = Rotation.from_euler("z", heading).as_matrix()
    still = dict.fromkeys(joints, facing[None])
    poses = {"normal": {name: MVN @ each @ MVN.T for name, each in joints.items()}, rest: still}
    places: dict[str, dict[str, Array]] = {"normal": {"Hips": 0.01 * roots @ MVN.T}}
    places[rest] = {"Hips": np.array([[0.0, 0.0, 1.0]])}
    lines = ['<?xml version="1.0" encoding="UTF-8"?>']
    lines += [
        '<mvnx xmlns="http://www.xsens.com/mvn/mvnx" version="4">',
        '<mvn version="2022.0.0"/>',
    ]
    lines += [
        f'<subject label="Anna" frameRate="{rate:g}" segmentCount="{len(TREE)}">',
        "<segments>",
    ]
    connected = []
    for number, (name, parent, offset, _) in enumerate(TREE, start=1):
        label = SEGMENTS.get(name, name)
        lines.append(f'<segment label="{label}" id="{number}"><points/></segment>')
        if parent is None:
            continue
        above = SEGMENTS.get(parent, parent)
        connected.append(
            f'<joint label="j{label}"><connector1>{above}/j{label}</connector1>'
            f"<connector2>{label}/j{label}</connector2></joint>"
        )
        for kind, place in places.items():
            place[name] = place[parent] + poses[kind][parent] @ (0.01 * MVN @ np.array(offset))
    lines += ["</segments>", "<joints>", *connected, "</joints>", "<frames>"]
    for kind in (rest, "normal"):
        rotations = np.stack([poses[kind][name] for name, *_ in TREE], axis=1)
        quaternions = [Rotation.from_matrix(each).as_quat()[:, [3, 0, 1, 2]] for each in rotations]
        positions = np.stack([places[kind][name] for name, *_ in TREE], axis=1)
        for index in range(len(rotations)):
            at = str(index) if kind == "normal" else ""
            lines.append(f'<frame time="{round(1e3 * index / rate)}" index="{at}" type="{kind}">')
            for what, values in (("orientation", quaternions), ("position", positions)):
                numbers = " ".join(f"{x:.12g}" for x in np.ravel(values[index]))
                lines.append(f"<{what}>{numbers}</{what}>")
            lines.append("</frame>")
    file.write_text("\n".join([*lines, "</frames>", "</subject>", "</mvnx>"]) + "\n")
    return file


ACCLAIM = {  # names of the CMU database
    "Hips": "root",
    "RightUpLeg": "rfemur",
    "Spine": "upperback",
    "Spine1": "thorax",
    "Neck": "lowerneck",
    "RightShoulder": "rclavicle",
    "RightArm": "rhumerus",
    "RightForeArm": "rradius",
    "RightHand": "rhand",
    "LeftShoulder": "lclavicle",
    "LeftArm": "lhumerus",
    "LeftForeArm": "lradius",
    "LeftHand": "lhand",
}


def write_acclaim(
    folder: Path,
    joints: dict[str, Array],
    roots: Array,
    orders: dict[str, str],
    frames: dict[str, Array],
    radians: bool = False,
) -> Path:
    """Write 07.asf and 07_01.amc; bones turn about the axes of their frames, in these orders.

    Lengths are in inches / 2.54. Frames are given by angles (3,) about x, y, z [deg]; in ASF,
    "XYZ" turns about x first.
    """
    degrees, scale = not radians, 1.0 if radians else np.pi / 180.0
    offsets = {name: np.array(offset) for name, _, offset, _ in TREE}
    lines = [":version 1.10", ":name T", ":units", "  mass 1.0", "  length 2.54"]
    lines += [f"  angle {'deg' if degrees else 'rad'}", ":root"]
    lines += ["  order TX TY TZ RX RY RZ", f"  axis {orders['Hips']}", "  position 0 0 0"]
    lines += ["  orientation 0 0 0", ":bonedata"]
    hierarchy = []
    names = [name for name, *_ in TREE]
    children = {name: [child for child, above, _, _ in TREE if above == name] for name in names}
    for index, (name, parent, _, _) in enumerate(TREE[1:], start=1):
        start = ACCLAIM[str(parent)]
        if start == "root" or len(children[str(parent)]) > 1:  # an immovable bone in between
            lines += _bone(100 + index, f"to_{ACCLAIM[name]}", offsets[name])
            hierarchy.append(f"    {start} to_{ACCLAIM[name]}")
            start = f"to_{ACCLAIM[name]}"
        hierarchy.append(f"    {start} {ACCLAIM[name]}")
        end = offsets[children[name][0]] if len(children[name]) == 1 else np.zeros(3)
        angles = frames[name] if degrees else np.radians(frames[name])
        lines += _bone(index, ACCLAIM[name], end, angles, orders[name])
    lines += [":hierarchy", "  begin", *hierarchy, "  end"]
    (folder / "07.asf").write_text("\r\n".join(lines) + "\r\n")
    local = local_rotations(joints)
    values = {}
    for name in names:
        frame = Rotation.from_euler(orders[name].lower(), _in_order(frames[name], orders[name]))
        if name == "Hips":
            frame = Rotation.identity()
        moved = frame.as_matrix().T @ local[name] @ frame.as_matrix()
        angles = Rotation.from_matrix(moved).as_euler(orders[name].lower())
        values[name] = angles[:, [orders[name].index(axis) for axis in "XYZ"]]
    rows = ["# a comment", ":FULLY-SPECIFIED", ":DEGREES" if degrees else ":RADIANS"]
    for frame_index in range(len(roots)):
        rows.append(str(frame_index + 1))
        for name in names:
            numbers = values[name][frame_index] / scale
            if name == "Hips":
                numbers = np.concatenate([roots[frame_index], numbers])
            rows.append(f"{ACCLAIM[name]} " + " ".join(f"{x:.12g}" for x in numbers))
    motion = folder / "07_01.amc"
    motion.write_text("\r\n".join(rows) + "\r\n")
    return motion


def _in_order(degrees: Array, order: str) -> Array:
    return np.radians([degrees["XYZ".index(axis)] for axis in order])


def _bone(
    index: int, name: str, end: Array, axis: Array | None = None, order: str = "XYZ"
) -> list[str]:
    length = float(np.linalg.norm(end))
    direction = end / length if length else np.array([0.0, 1.0, 0.0])
    angles = np.zeros(3) if axis is None else axis
    lines = ["  begin", f"    id {index}", f"    name {name}"]
    lines += ["    direction " + " ".join(f"{x:.12g}" for x in direction)]
    lines += [f"    length {length:.12g}"]
    lines += ["    axis " + " ".join(f"{x:.12g}" for x in angles) + f"  {order}"]
    if axis is not None:
        lines += ["    dof rx ry rz", "    limits (-180 180)", "           (-180 180)"]
        lines += ["           (-180 180)"]
    return [*lines, "  end"]
