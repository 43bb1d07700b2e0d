# SPDX-License-Identifier: BSD-3-Clause
"""A body with a lift, two arms with grippers and a head, and its forward kinematics, computed independently."""

from __future__ import annotations

import functools

import numpy as np
from mobile_robots import shifted, turned

from modular_framework_planning.robot_model.robot_model import RobotModel

SHOULDERS = {"left": 0.3, "right": -0.3}  # y [m]
_ARM = """
<joint name="{s}_pan" type="revolute"><parent link="torso"/><child link="{s}_shoulder"/><origin xyz="0.1 {y} 0"/>
  <axis xyz="0 0 1"/><limit lower="-2.5" upper="2.5" velocity="2" effort="1"/></joint>
<link name="{s}_shoulder"/>
<joint name="{s}_lift" type="revolute"><parent link="{s}_shoulder"/><child link="{s}_upper"/><axis xyz="0 1 0"/>
  <limit lower="-2" upper="2" velocity="2" effort="1"/></joint>
<link name="{s}_upper"><collision><origin xyz="0.22 0 0"/><geometry><box size="0.3 0.05 0.05"/></geometry></collision>
</link>
<joint name="{s}_elbow" type="revolute"><parent link="{s}_upper"/><child link="{s}_fore"/><origin xyz="0.4 0 0"/>
  <axis xyz="0 1 0"/><limit lower="-2.5" upper="2.5" velocity="2" effort="1"/></joint>
<link name="{s}_fore"><collision><origin xyz="0.15 0 0"/><geometry><box size="0.2 0.04 0.04"/></geometry></collision>
</link>
<joint name="{s}_roll" type="continuous"><parent link="{s}_fore"/><child link="{s}_wrist"/><origin xyz="0.3 0 0"/>
  <axis xyz="1 0 0"/><limit velocity="2" effort="1"/></joint>
<link name="{s}_wrist"/>
<joint name="{s}_flange" type="fixed"><parent link="{s}_wrist"/><child link="{s}_tool"/><origin xyz="0.1 0 0"/></joint>
<link name="{s}_tool"/>
<joint name="{s}_finger" type="prismatic"><parent link="{s}_tool"/><child link="{s}_finger_link"/><axis xyz="0 1 0"/>
  <limit lower="0" upper="0.04" velocity="1" effort="1"/></joint>
<link name="{s}_finger_link"><collision><origin xyz="0.02 0.01 0"/><geometry><box size="0.03 0.01 0.01"/></geometry>
</collision></link>
<joint name="{s}_thumb" type="prismatic"><parent link="{s}_tool"/><child link="{s}_thumb_link"/><axis xyz="0 -1 0"/>
  <limit lower="0" upper="0.04" velocity="1" effort="1"/><mimic joint="{s}_finger"/></joint>
<link name="{s}_thumb_link"/>
<joint name="{s}_pad" type="revolute"><parent link="{s}_finger_link"/><child link="{s}_pad_link"/>
  <origin xyz="0.03 0 0"/><axis xyz="0 0 1"/><limit lower="-0.5" upper="0.5" velocity="1" effort="1"/></joint>
<link name="{s}_pad_link"/>"""
URDF = (
    """<robot name="wide"><link name="foot"/>
<joint name="hoist" type="prismatic"><parent link="foot"/><child link="torso"/><origin xyz="0 0 0.8"/>
  <axis xyz="0 0 1"/>
  <limit lower="0" upper="0.4" velocity="0.5" effort="1"/></joint>
<link name="torso"><collision><origin xyz="0 0 -0.2"/><geometry><box size="0.15 0.4 0.4"/></geometry></collision></link>
<joint name="head_pan" type="revolute"><parent link="torso"/><child link="head"/><origin xyz="0 0 0.3"/>
  <axis xyz="0 0 1"/>
  <limit lower="-1" upper="1" velocity="1" effort="1"/></joint><link name="head"/>"""
    + "".join(_ARM.format(s=side, y=y) for side, y in SHOULDERS.items())
    + "</robot>"
)
_SIDE = """<group name="{s}"><chain base_link="torso" tip_link="{s}_tool"/></group>
<group name="{s}_with_torso"><joint name="hoist"/><group name="{s}"/></group>
<group name="{s}_by_chain"><chain base_link="foot" tip_link="{s}_tool"/></group>
<group name="{s}_hand"><joint name="{s}_finger"/><joint name="{s}_thumb"/><joint name="{s}_pad"/></group>
<end_effector name="{s}_gripper" parent_link="{s}_tool" group="{s}_hand" parent_group="{s}"/>
<passive_joint name="{s}_pad"/>
<group_state name="wide" group="{s}"><joint name="{s}_pan" value="0.5"/></group_state>
<disable_collisions link1="{s}_upper" link2="{s}_fore"/><disable_collisions link1="{s}_upper" link2="torso"/>"""
SRDF = (
    '<robot name="wide">'
    + "".join(_SIDE.format(s=side) for side in SHOULDERS)
    + """<group name="arms"><group name="left"/><group name="right"/></group>
<group name="body"><joint name="hoist"/><group name="arms"/></group>
<group name="listed"><link name="torso"/><joint name="head_pan"/></group></robot>"""
)


@functools.cache
def robot() -> RobotModel:
    """The robot."""
    return RobotModel(URDF, SRDF)


def tool(side: str, values: dict[str, float]) -> np.ndarray:
    """Where the tool of an arm is in the frame of the foot; joints that are not named are at 0."""
    pan, lift, elbow, roll = (values.get(f"{side}_{name}", 0.0) for name in ("pan", "lift", "elbow", "roll"))
    torso = shifted(0, 0, 0.8 + values.get("hoist", 0.0))
    upper = torso @ shifted(0.1, SHOULDERS[side], 0) @ turned("z", pan) @ turned("y", lift)
    return upper @ shifted(0.4, 0, 0) @ turned("y", elbow) @ shifted(0.3, 0, 0) @ turned("x", roll) @ shifted(0.1, 0, 0)
