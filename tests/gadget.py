"""A small robot in URDF, with joints and links that can be replaced, and another in MJCF."""

from __future__ import annotations

MIMIC = '<mimic joint="j_left" multiplier="-2" offset="0.1"/>'
OTHER = MIMIC.replace("left", "right")
INERTIAL = (
    '<inertial><origin xyz="0.1 0 0.2"/><mass value="2"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.2" iyz="0" izz="0.15"/></inertial>'
)
MASSLESS, POINT = "", INERTIAL.replace("0.15", "0").replace('0.1"', '0"').replace('0.2"', '0"')


def urdf(**changes: str) -> str:
    """A base, a lift, three revolute links with a two-finger gripper, and a link beside them.

    Args:
        changes: type of a joint by its name, or `<name>_inertial`, `_mimic`, `_origin` in XML.
    """
    types = {"lift": "prismatic", "one": "revolute", "two": "continuous", "three": "revolute"}
    types |= {"left": "revolute", "right": "revolute", "beside": "revolute"}
    parents = {"lift": "base", "one": "lift", "two": "one", "three": "two"}
    parents |= {"left": "three", "right": "three", "beside": "lift"}
    lines = ['<robot name="gadget">', '<link name="base"/>']
    for name, parent in parents.items():
        lines.append(f'<link name="{name}">{changes.get(f"{name}_inertial", INERTIAL)}</link>')
        mimic = changes.get(f"{name}_mimic", "")
        origin = changes.get(f"{name}_origin", 'rpy="0.1 0.2 0.3" xyz="0.1 0.2 0.3"')
        lines.append(
            f'<joint name="j_{name}" type="{changes.get(name, types[name])}">'
            f'<parent link="{parent}"/><child link="{name}"/><origin {origin}/>'
            f'<axis xyz="0 1 0"/><limit lower="0.2" upper="1" effort="1" velocity="1"/>'
            f"{mimic}</joint>"
        )
    lines.append('<link name="grip"/><joint name="fixed" type="fixed"><parent link="three"/>')
    lines.append('<child link="grip"/><origin xyz="0 0 0.1" rpy="0 1 0"/></joint></robot>')
    return "\n".join(lines)


MJCF = """
<mujoco model="two">
  <compiler angle="radian"/>
  <worldbody>
    <body name="trunk"><freejoint name="root"/><geom type="sphere" size="0.1" mass="1"/>
      <body name="upper" pos="0 0 0.1">
        <joint name="a" type="hinge" axis="0 1 0" range="-1 1" armature="0.5"/>
        <geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.5" mass="1"/>
        <body name="fore" pos="0 0 0.5">
          <joint name="b" type="slide" axis="1 0 0" range="-1 1"/>
          <geom type="capsule" size="0.02" fromto="0 0 0 0 0 0.5" mass="1"/>
          <site name="tip" pos="0 0 0.5"/>
          <body name="f1"><joint name="c1"/><geom type="sphere" size="0.1" mass="0.1"/></body>
          <body name="f2"><joint name="c2"/><geom type="sphere" size="0.1" mass="0.1"/></body>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="c2" joint2="c1" polycoef="0 -1 0 0 0"/></equality>
</mujoco>
"""
