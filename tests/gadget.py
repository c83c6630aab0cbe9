"""Small robots: one in URDF with joints and links that can be replaced, others, one in MJCF."""

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

_LINK = """<inertial><origin xyz="0.5 0 0"/><mass value="2"/>
  <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>"""
# Both links hang in a vertical plane: the axes are horizontal.
TWO_LINKS = f"""<robot name="two links"><link name="base"/><link name="a">{_LINK}</link>
<link name="b">{_LINK}</link>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="3" effort="60"/></joint>
<joint name="elbow" type="revolute"><parent link="a"/><child link="b"/><origin xyz="1 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="3" velocity="3" effort="40"/></joint>
</robot>"""

# It turns without limits.
FAN = (
    '<robot name="fan"><link name="base"/><link name="blade"><inertial><mass value="1"/>'
    '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="2"/></inertial></link>'
    '<joint name="axle" type="continuous"><parent link="base"/><child link="blade"/>'
    '<axis xyz="0 0 1"/></joint></robot>'
)
