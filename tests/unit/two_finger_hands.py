# SPDX-License-Identifier: BSD-3-Clause
"""Two-finger hands for tests of grasp methods, as Pinocchio sees them: independent of what the product measures."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio

PARALLEL_JAWS = """<robot name="jaws">
  <link name="base"/>
  <link name="housing"><collision><origin xyz="0 0 0.03"/><geometry><{housing}/></geometry></collision></link>
  <joint name="mount" type="fixed"><parent link="base"/><child link="housing"/></joint>
  <link name="left"><collision><origin xyz="0 0 0.095"/><geometry><box size="0.01 0.02 0.07"/></geometry></collision>
  </link>
  <joint name="slide" type="prismatic"><parent link="housing"/><child link="left"/><axis xyz="1 0 0"/>
    <origin xyz="0.005 0 0"/><limit lower="0" upper="0.05" effort="1" velocity="1"/></joint>
  <link name="right"><collision><origin xyz="0 0 0.095"/><geometry><box size="0.01 0.02 0.07"/></geometry></collision>
  </link>
  <joint name="slide_2" type="prismatic"><parent link="housing"/><child link="right"/><axis xyz="-1 0 0"/>
    <origin xyz="-0.005 0 0"/><limit lower="0" upper="0.05" effort="1" velocity="1"/><mimic joint="slide"/></joint>
  <link name="tool"/>
  <joint name="tool_mount" type="fixed"><parent link="housing"/><child link="tool"/><origin xyz="0 0 0.115"/></joint>
</robot>"""
EZGRIPPER_XACRO = Path(__file__).parents[2] / "src/robots/ur5_ezgripper_robot/urdf/ur5_with_ezgripper.urdf.xacro"


def ezgripper() -> str:
    from xacro_rospkg import expand

    return str(expand(EZGRIPPER_XACRO, {}))


def jaws() -> str:
    return PARALLEL_JAWS.format(housing='cylinder radius="0.05" length="0.06"')


def fixed_jaw() -> str:
    """The jaws, of which only the left one moves."""
    moving = '<limit lower="0" upper="0.05" effort="1" velocity="1"/><mimic joint="slide"/>'
    return jaws().replace('name="slide_2" type="prismatic"', 'name="slide_2" type="fixed"').replace(moving, "")


def unequal_jaws() -> str:
    """The jaws, of which the right one moves a quarter as far as the left one."""
    return (
        jaws().replace('<mimic joint="slide"/>', '<mimic joint="slide" multiplier="0.25"/>').replace("slide", "drive")
    )


def _straight(angle: float) -> float:
    return math.pi / 2 - angle


FOLLOWERS: dict[str, dict[str, Callable[[float], float]]] = {
    "ezgripper_knuckle_palm_L1_1": {
        "ezgripper_knuckle_palm_L1_2": float,
        "ezgripper_knuckle_L1_L2_1": _straight,
        "ezgripper_knuckle_L1_L2_2": _straight,
    },
    "slide": {"slide_2": float},
    "drive": {"drive_2": lambda position: 0.25 * position},
}
GRIPPERS = [(ezgripper, "ezgripper_knuckle_palm_L1_1", "eg_manipulator"), (jaws, "slide", "tool")]
HAND_LINKS = ("finger", "palm", "left", "right", "housing")


class Hand:
    """The hand as Pinocchio sees it; the meshes of the arm are left out."""

    def __init__(self, urdf: str, joint: str, frame: str) -> None:
        urdf = re.sub(r"<collision>((?!</collision>).)*<mesh .*?</collision>", "", urdf, flags=re.DOTALL)
        self._model = pinocchio.buildModelFromXML(urdf)
        self._geometry = pinocchio.buildGeomFromUrdfString(self._model, urdf, pinocchio.GeometryType.COLLISION)
        self._data, self._frame = self._model.createData(), self._model.getFrameId(frame)
        self._joint = joint

    def shapes(self, position: Any, rotation: Any, joint: float) -> dict[str, tuple[Any, Any]]:
        """Coal's geometry of each shape and its pose in the world, the grasp frame at a position with a rotation."""
        values = pinocchio.neutral(self._model)
        self._set(values, self._joint, joint)
        for follower, rule in FOLLOWERS.get(self._joint, {}).items():
            if self._model.existJointName(follower):
                self._set(values, follower, rule(joint))
        pinocchio.framesForwardKinematics(self._model, self._data, values)
        to_world = pinocchio.SE3(rotation, np.array(position)) * self._data.oMf[self._frame].inverse()
        return {
            shape.name: (shape.geometry, to_world * self._data.oMi[shape.parentJoint] * shape.placement)
            for shape in self._geometry.geometryObjects
            if any(word in self._model.frames[shape.parentFrame].name for word in HAND_LINKS)
        }

    def _set(self, values: Any, name: str, value: float) -> None:
        values[self._model.joints[self._model.getJointId(name)].idx_q] = value
