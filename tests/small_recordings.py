"""A small valid recording in every format that is read, as bytes."""

from __future__ import annotations

import io
import struct

import numpy as np

LEGACY_MMM = """<?xml version='1.0'?>
<MMM>
  <Motion name='walker'>
    <ModelProcessorConfig type='Winter'><Height>1.7</Height><Mass>65</Mass></ModelProcessorConfig>
    <JointOrder><Joint name='BPx_joint'/><Joint name='BPz_joint'/><Joint name='BPy_joint'/>
      <Joint name='BTx_joint'/><Joint name='BTz_joint'/><Joint name='BTy_joint'/></JointOrder>
    <MotionFrames>
      <MotionFrame><Timestep>0</Timestep><RootPosition>0 0 900</RootPosition>
        <RootRotation>0 0 0.1</RootRotation>
        <JointPosition>0.5 -1.0 0 0.1 0.2 0.3</JointPosition></MotionFrame>
      <MotionFrame><Timestep>0.01</Timestep><RootPosition>0 1 901</RootPosition>
        <RootRotation>0 0 0.1</RootRotation>
        <JointPosition>0.6 -1.1 0 0.1 0.2 0.3</JointPosition></MotionFrame>
    </MotionFrames>
  </Motion>
</MMM>
"""
MMM_2 = """<MMM version="2.0">
  <Motion name="walker">
    <Sensors>
      <Sensor type="ModelPose"><Configuration/><Data>
        <Measurement timestep="0"><RootPosition>0 0 900</RootPosition>
          <RootRotation>0 0 0.1</RootRotation></Measurement>
        <Measurement timestep="0.01"><RootPosition>0 0 901</RootPosition>
          <RootRotation>0 0 0.1</RootRotation></Measurement></Data></Sensor>
      <Sensor type="Kinematic">
        <Configuration><Joint name="BPx_joint"/><Joint name="BPz_joint"/></Configuration>
        <Data>
          <Measurement timestep="0"><JointPosition>0.5 -1.0</JointPosition></Measurement>
          <Measurement timestep="0.01"><JointPosition>0.6 -1.1</JointPosition></Measurement>
        </Data>
      </Sensor>
    </Sensors>
  </Motion>
</MMM>
"""
TABLE = "# unit: deg\n# height: 1.7\n# subject: A\ntime,b,a\n0,0.5,-10\n0.01,0.6,-11\n0.02,1,-12\n"
OPENSIM = """Coordinates
version=1
nRows=3
nColumns=5
inDegrees=yes

Units are S.I. units (second, meters, Newtons, ...)

endheader
time\tarm_flex_r\tarm_add_r\tarm_rot_r\telbow_flex_r
0.0\t10.0\t-5.0\t3.0\t40.0
0.01\t11.0\t-5.5\t3.5\t41.0
0.02\t12.0\t-6.0\t4.0\t42.0
"""
TRC = """PathFileType\t4\t(X/Y/Z)\twalk.trc
DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames
100\t100\t3\t2\tmm\t100\t1\t3
Frame#\tTime\tRSHO\t\t\tRELB\t\t
\t\tX1\tY1\tZ1\tX2\tY2\tZ2

1\t0.00\t100.0\t200.0\t1400.0\t120.0\t210.0\t1100.0
2\t0.01\t101.0\t201.0\t1401.0\t\t\t
3\t0.02\t102.0\t202.0\t1402.0\t122.0\t212.0\t1102.0
"""
MARKER_TABLE = """# unit: mm
time,RSHO_x,RSHO_y,RSHO_z,RELB_x,RELB_y,RELB_z
0.00,100,200,1400,120,210,1100
0.01,101,201,1401,,,
0.02,102,202,1402,122,212,1102
"""
VICON = """Devices
1000
,,Anna:Force,,
Frame,Sub Frame,Fx,Fy,Fz
,,N,N,N
1,0,0.1,0.2,700
1,1,0.1,0.2,700

Trajectories
100
,,Anna:RSHO,,,Anna:RELB,,,*3,,
Frame,Sub Frame,X,Y,Z,X,Y,Z,X,Y,Z
,,mm,mm,mm,mm,mm,mm,mm,mm,mm
1,0,100,200,1400,120,210,1100,1,2,3
2,0,101,201,1401,,,,1,2,3
3,0,102,202,1402,122,212,1102,,,
"""
QUALISYS = """NO_OF_FRAMES\t3
NO_OF_CAMERAS\t8
NO_OF_MARKERS\t2
FREQUENCY\t100
NO_OF_ANALOG\t0
ANALOG_FREQUENCY\t0
DESCRIPTION\t--
TIME_STAMP\t2020-01-31, 12:00:00.000\t1234.5
EVENT\tstart\t1\t0.01
DATA_INCLUDED\t3D
MARKER_NAMES\tRSHO\tRELB
TRAJECTORY_TYPES\tMeasured\tMixed
Frame\tTime\tRSHO X\tRSHO Y\tRSHO Z\tRELB X\tRELB Y\tRELB Z
1\t0.00000\t100.0\t200.0\t1400.0\t120.0\t210.0\t1100.0
2\t0.01000\t101.0\t201.0\t1401.0\t\t\t
3\t0.02000\t102.0\t202.0\t1402.0\t122.0\t212.0\t1102.0
"""
BIDS = {
    "sub-01_motion.tsv": "0.1\t10\t0\n0.2\t11\tn/a\n0.3\t12\t0\n",
    "sub-01_motion.json": '{"SamplingFrequency": 100, "TaskName": "reach"}\n',
    "sub-01_channels.tsv": """name\tcomponent\ttype\ttracked_point\tunits
BPx_joint\tx\tJNTANG\ttrunk\trad
BPz_joint\tz\tJNTANG\ttrunk\tdeg
speed\tx\tVEL\ttrunk\tm/s
""",
}
# A joint or bone, the one before it, its offset in the T pose (x to the left, y up), its AMC name.
_BODY = (
    ("Hips", "", (0.0, 0.0, 0.0), "root"),
    ("RightUpLeg", "Hips", (-8.0, -4.0, 0.0), "rfemur"),
    ("LeftUpLeg", "Hips", (8.0, -4.0, 0.0), "lfemur"),
    ("Spine", "Hips", (0.0, 10.0, -1.0), "upperback"),
    ("Spine1", "Spine", (0.0, 12.0, 0.0), "thorax"),
    ("Neck", "Spine1", (0.0, 25.0, 1.0), "lowerneck"),
    ("RightShoulder", "Spine1", (-4.0, 20.0, 0.0), "rclavicle"),
    ("RightArm", "RightShoulder", (-14.0, 0.0, 0.0), "rhumerus"),
    ("RightForeArm", "RightArm", (-29.0, 0.0, 0.0), "rradius"),
    ("RightHand", "RightForeArm", (-26.0, 0.0, 0.0), "rhand"),
)
_FRAMES = 3


def bvh() -> str:
    """The body's right arm, with angles of a few degrees."""

    def joint(name: str, depth: int) -> list[str]:
        offset = next(offset for each, _, offset, _ in _BODY if each == name)
        children = [each for each, parent, _, _ in _BODY if parent == name]
        channels = "3 Zrotation Xrotation Yrotation"
        if depth == 0:
            channels = "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
        turned = " 10 0 -20" if name == "RightHand" else ""  # in the rest pose, as SOMA has it
        inner = [f"OFFSET {' '.join(map(str, offset))}{turned}", f"CHANNELS {channels}"]
        for child in children:
            inner += joint(child, depth + 1)
        if not children:
            inner += ["End Site", "{", "OFFSET 0 -5 0", "}"]
        return [f"{'JOINT' if depth else 'ROOT'} {name}", "{", *inner, "}"]

    rows = [[0.0, 90.0 + frame, 0.0] + [2.0 * frame] * 3 * len(_BODY) for frame in range(_FRAMES)]
    lines = ["HIERARCHY", *joint("Hips", 0), "MOTION", f"Frames: {_FRAMES}", "Frame Time: 0.01"]
    return "\n".join([*lines, *(" ".join(map(str, row)) for row in rows)]) + "\n"


def mvnx() -> str:
    """The same body in a T pose, about to turn to the left."""
    names = {"Hips": "Pelvis", "Spine": "L3", "Spine1": "T8", "RightArm": "RightUpperArm"}
    lines = ['<mvnx version="4">', '<subject label="Anna" frameRate="100">', "<segments>"]
    lines += [f'<segment label="{names.get(name, name)}"/>' for name, *_ in _BODY]
    lines += ["</segments>", "<joints>"]
    places: dict[str, np.ndarray] = {"": np.array([0.0, 0.0, 1.0])}
    for name, parent, (left, up, forward), _ in _BODY:
        places[name] = places[parent] + 0.01 * np.array([forward, left, up])
        ends = (names.get(each, each) for each in (parent, name))
        if parent:
            tags = (f"<connector{k}>{end}/j</connector{k}>" for k, end in enumerate(ends, start=1))
            lines.append(f"<joint>{''.join(tags)}</joint>")
    lines += ["</joints>", "<frames>"]
    for frame in range(-1, _FRAMES):
        angle = 0.1 * max(frame, 0)
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        kind = f'index="{frame}" type="normal"' if frame >= 0 else 'index="" type="identity"'
        quaternion = f"{np.cos(angle / 2):.6f} 0 0 {np.sin(angle / 2):.6f}"
        positions = [[*(turn @ places[name][:2]), places[name][2]] for name, *_ in _BODY]
        numbers = " ".join(f"{value:.4f}" for value in np.ravel(positions))
        lines += [f'<frame time="{10 * max(frame, 0)}" {kind}>']
        lines += [f"<orientation>{' '.join([quaternion] * len(_BODY))}</orientation>"]
        lines += [f"<position>{numbers}</position>", "</frame>"]
    return "\n".join([*lines, "</frames>", "</subject>", "</mvnx>"]) + "\n"


def asf() -> str:
    """The skeleton of the same body; every bone points to where the next one begins."""
    lines = [
        *(":version 1.10", ":name VICON", ":units", "mass 1.0", "length 0.45", "angle deg"),
        *(":root", "order TX TY TZ RX RY RZ", "axis XYZ", "position 0 0 0", "orientation 0 0 0"),
        ":bonedata",
    ]
    ends = {"rfemur": (0, -1, 0), "lfemur": (0, -1, 0), "rhand": (-1, 0, 0)}
    for name, _, _, bone in _BODY[1:]:
        after = [offset for _, parent, offset, _ in _BODY if parent == name]
        x, y, z = after[0] if after else ends.get(bone, (0, 1, 0))
        lines += ["begin", f"id {len(lines)}", f"name {bone}", f"direction {x} {y} {z}"]
        lines += ["length 5", "axis 0 0 20 XYZ", "dof rx ry rz", "limits (-90 90)", "(-90 90)"]
        lines += ["(-90 90)", "end"]
    bones = {name: bone for name, _, _, bone in _BODY}
    lines += [":hierarchy", "begin"]
    for name, bone in bones.items():
        children = [bones[each] for each, parent, _, _ in _BODY if parent == name]
        lines += [f"{bone} {' '.join(children)}"] if children else []
    return "\n".join([*lines, "end"]) + "\n"


def amc() -> str:
    """A motion of the skeleton."""
    lines = [":FULLY-SPECIFIED", ":DEGREES"]
    for frame in range(_FRAMES):
        lines += [str(frame + 1), f"root 0 {10 + frame} 0 0 {frame} 0"]
        lines += [f"{bone} {2 * frame} 1 -{frame}" for _, _, _, bone in _BODY[1:]]
    return "\n".join(lines) + "\n"


def smpl(poses: np.ndarray | None = None, **others: object) -> bytes:
    """An archive with the poses of AMASS."""
    stream = io.BytesIO()
    values = 0.01 * np.arange(_FRAMES * 156).reshape(_FRAMES, 156) % 0.7
    arrays = {"poses": values if poses is None else poses, "mocap_framerate": 60.0} | others
    np.savez(stream, **arrays)  # type: ignore[arg-type]
    return stream.getvalue()


def c3d(
    points: np.ndarray,
    labels: list[str],
    *,
    processor: str = "Intel",
    scale: float = -1.0,
    unit: str = "mm",
    strings: dict[str, list[str]] | None = None,
    frames: int | None = None,
    analog: int = 0,
    rotations: list[str] | None = None,
) -> bytes:
    """A c3d file of points (k, m, 4): coordinates, and the residual's word.

    Coordinates are floats if the scale is negative, else integers in units of the scale. The
    floats of DEC have their words swapped and are a fourth of what IEEE's would be. Counts of more
    than 16 bits are in the group TRIAL.
    """
    order, number = {"Intel": ("<", 84), "DEC": ("<", 85), "MIPS": (">", 86)}[processor]

    def floats(values: np.ndarray) -> bytes:
        if processor != "DEC":
            return values.astype(f"{order}f4").tobytes()
        words = (4.0 * values).astype("<f4").reshape(-1).view("<u2").reshape(-1, 2)
        return words[:, ::-1].tobytes()

    def parameter(group: int, name: str, kind: int, size: bytes, values: bytes) -> bytes:
        head = struct.pack(f"bb{len(name)}s", len(name), group, name.encode())
        data = struct.pack("bB", kind, len(size)) + size + values + b"\0"
        return head + struct.pack(f"{order}H", len(data) + 2) + data

    count = len(points) if frames is None else frames
    chain = b""
    groups = ["POINT", "ANALOG", "TRIAL", *(["ROTATION"] if rotations else [])]
    for group, name in enumerate(groups, start=1):
        head = struct.pack(f"{order}bb{len(name)}sHB", len(name), -group, name.encode(), 3, 0)
        chain += head
    for group, name, value in (
        (1, "USED", points.shape[1]),
        (1, "FRAMES", min(count, 65535)),
        (2, "USED", analog),
    ):
        chain += parameter(group, name, 2, b"", struct.pack(f"{order}H", value))
    if count > 65535:
        for name, value in {"ACTUAL_START_FIELD": 1, "ACTUAL_END_FIELD": count}.items():
            words = struct.pack(f"{order}HH", value % 65536, value // 65536)
            chain += parameter(3, name, 2, b"\2", words)
    rates = ((1, "RATE", 100.0), (1, "SCALE", scale), (2, "RATE", 100.0), (2, "GEN_SCALE", 1.0))
    for group, name, amount in rates:
        chain += parameter(group, name, 4, b"", floats(np.array([amount])))
    texts = {"LABELS": labels, "UNITS": [unit], **(strings or {})}
    named = [(1, *item) for item in texts.items()]
    if rotations:
        named.append((4, "LABELS", rotations))
    for group, name, given in named:
        width = max(map(len, given), default=0)
        text = "".join(each.ljust(width) for each in given).encode("latin-1")
        chain += parameter(group, name, -1, bytes([width, len(given)]), text)
    blocks = -(-(len(chain) + 6) // 512)
    section = (bytes([1, 80, blocks, number]) + chain).ljust(512 * blocks, b"\0")
    header = struct.pack(f"{order}5H", points.shape[1], analog, 1, min(count, 65535), 10)
    header += floats(np.array([scale])) + struct.pack(f"{order}HH", 2 + blocks, int(analog > 0))
    header += floats(np.array([100.0]))
    rows = np.concatenate([points.reshape(len(points), -1), np.ones((len(points), analog))], axis=1)
    data = floats(rows) if scale < 0.0 else rows.round().astype(f"{order}i2").tobytes()
    return (bytes([2, 80]) + header).ljust(512, b"\0") + section + data


def small_c3d() -> bytes:
    """Two markers in three frames; the second marker is missing once."""
    points = np.full((_FRAMES, 2, 4), 500.0) + np.arange(_FRAMES)[:, None, None]
    points[:, :, 3] = 0.0
    points[1, 1, 3] = -1.0
    return c3d(points, ["RSHO", "RELB"])


def small_recordings() -> dict[str, bytes]:
    """A valid file by its name; motion.asf and the files sub-01 belong to one recording each."""
    texts = {
        "legacy.xml": LEGACY_MMM,
        "two.xml": MMM_2,
        "table.csv": TABLE,
        "motion.mot": OPENSIM,
        "motion.bvh": bvh(),
        "motion.mvnx": mvnx(),
        "motion.asf": asf(),
        "motion.amc": amc(),
        "markers.trc": TRC,
        "markers.csv": MARKER_TABLE,
        "markers_vicon.csv": VICON,
        "markers_qualisys.tsv": QUALISYS,
        **BIDS,
    }
    return {name: text.encode() for name, text in texts.items()} | {
        "motion.npz": smpl(),
        "markers.c3d": small_c3d(),
    }
