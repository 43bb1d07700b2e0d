# SPDX-License-Identifier: BSD-3-Clause
"""A trajectory controller that makes mistakes on command, for `benchmarks/arm_faults`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import rospy
from std_msgs.msg import String

from modular_framework_control.controllers.joint_trajectory_controller import JointTrajectoryController
from modular_framework_ros.node_handle import NodeHandle, join_names

PACKAGE = "fault_benchmark"
TYPE = f"{PACKAGE}/FaultyTrajectoryController"
RAISE = "raise"


class FaultyTrajectoryController(JointTrajectoryController):
    """A position_controllers/JointTrajectoryController with mistakes.

    Subscribes to `<name>/mistake` (std_msgs/String): a number commands the third joint there in every cycle, "raise"
    raises an exception, and an empty text ends the mistake.
    """

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        self._mistake = ""
        initialised = super().init(hw, root_nh, controller_nh)
        self._mistaken_joint = hw.get_handle(self.joint_names[2])
        self._subscriber = rospy.Subscriber(join_names(controller_nh.namespace, "mistake"), String, self._on_mistake)
        return initialised

    def _on_mistake(self, message: Any) -> None:
        self._mistake = message.data

    def update(self, time_s: float, period_s: float) -> None:
        super().update(time_s, period_s)
        mistake = self._mistake
        if mistake == RAISE:
            raise RuntimeError("a mistake in the controller")
        if mistake:
            self._mistaken_joint.command = float(mistake)


def write_package(folder: Path) -> None:
    """Writes a package that offers the controller; the folder of this module must be on the path of Python.

    Args:
        folder: New folder, to be put on ROS_PACKAGE_PATH.
    """
    folder.mkdir()
    (folder / "package.xml").write_text(
        f'<package format="3"><name>{PACKAGE}</name><version>0.0.0</version><description>d</description>'
        '<maintainer email="a@b.cd">a</maintainer><license>BSD-3-Clause</license>'
        '<export><modular_framework_control plugin="${prefix}/plugins.xml"/></export></package>'
    )
    (folder / "plugins.xml").write_text(
        f'<library path="{Path(__file__).stem}"><class name="{TYPE}" type="FaultyTrajectoryController" '
        'base_class_type="controller_interface::ControllerBase"/></library>'
    )
