"""A robot arm with six joints that no package knows, as a URDF without geometry."""

from __future__ import annotations

_AXES = {"z": "0 0 1", "y": "0 1 0", "x": "1 0 0"}
# Joint, axis, origin in the link before: pan, lift, elbow, and three wrist axes; straight up at 0.
_JOINTS = (
    ("pan", "z", (0.0, 0.0, 0.20)),
    ("lift", "y", (0.0, 0.0, 0.15)),
    ("bend", "y", (0.0, 0.0, 0.40)),
    ("roll", "z", (0.0, 0.0, 0.20)),
    ("pitch", "y", (0.0, 0.0, 0.18)),
    ("spin", "z", (0.0, 0.0, 0.05)),
)
_LIMIT = '<limit lower="-2.8" upper="2.8" velocity="3" effort="80"/>'
_INERTIAL = (  # with the mass [kg]
    '<inertial><origin xyz="0 0 0.1"/><mass value="{}"/>'
    '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.01"/></inertial>'
)


def six_joints(lift: bool = False) -> str:
    """The robot's URDF; with `lift`, on a vertical axis that moves all of it up."""
    lines = ['<robot name="six-joints">', '<link name="floor"/>']
    parent = "floor"
    joints = [("column", "z", (0.0, 0.0, 0.0)), *_JOINTS] if lift else list(_JOINTS)
    for number, (name, axis, origin) in enumerate(joints):
        kind = "prismatic" if name == "column" else "revolute"
        lines += [
            f'<link name="{name}_link">{_INERTIAL.format(3.0 - 0.4 * number)}</link>',
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="{name}_link"/><origin xyz="{" ".join(map(str, origin))}"/>'
            f'<axis xyz="{_AXES[axis]}"/>{_LIMIT}</joint>',
        ]
        parent = f"{name}_link"
    lines += [
        '<link name="flange"/>',
        f'<joint name="mount" type="fixed"><parent link="{parent}"/><child link="flange"/>'
        '<origin xyz="0 0 0.08"/></joint>',
        "</robot>",
    ]
    return "\n".join(lines)
