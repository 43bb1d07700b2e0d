# SPDX-License-Identifier: BSD-3-Clause
"""The suite of all hardware on this one: run it with ``./install.sh exec python3 -m pytest <this file>``."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path

from modular_framework_control.hardware_interface.joint_limits import JointLimits
from modular_framework_control.hardware_interface.robot_hw_conformance import RobotHWConformance
from modular_framework_ros.node_handle import MappingNodeHandle

sys.path.insert(0, str(Path(__file__).parent / "src"))
from my_arm.my_arm import MyArm  # noqa: E402

LIMITS = JointLimits(-1.0, 1.0, 2.0)  # [rad, rad, rad/s]
URDF = """<robot name="my_robot">
<joint name="shoulder" type="revolute"><limit lower="-1" upper="1" velocity="2"/></joint>
<joint name="elbow" type="revolute"><limit lower="-1" upper="1" velocity="2"/></joint></robot>"""


class TestMyArm(RobotHWConformance):
    """Two joints with limits."""

    def make_robot_hw(self, positions: Mapping[str, float] | None = None) -> MyArm:
        my_arm = {"joints": ["shoulder", "elbow"], "start_positions": dict(positions or {})}
        root = MappingNodeHandle({"robot_description": URDF, "my_arm": my_arm})
        robot_hw = MyArm()
        assert robot_hw.init(root, root.child("my_arm"))
        return robot_hw

    def limits(self) -> Mapping[str, JointLimits]:
        return {"shoulder": LIMITS, "elbow": LIMITS}


def test_a_lost_connection_is_a_fault() -> None:
    """Goals end with this reason."""
    robot_hw = TestMyArm().make_robot_hw()
    assert robot_hw.fault() == ""
    robot_hw.close()
    assert robot_hw.fault() == "no connection to the motors"


def test_without_joints_it_cannot_be_used() -> None:
    """``init`` returns False, and the log names the parameter."""
    assert not MyArm().init(MappingNodeHandle({}), MappingNodeHandle({}))
