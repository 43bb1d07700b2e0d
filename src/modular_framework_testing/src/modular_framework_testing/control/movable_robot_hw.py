# SPDX-License-Identifier: BSD-3-Clause
"""Mock hardware that a test can slow down, stop by a fault, and move by hand."""

from __future__ import annotations

from typing import Any

from modular_framework_control.hardware_interface.handles import SpeedScalingHandle
from modular_framework_control.hardware_interface.interfaces import COMMAND_INTERFACES, SpeedScalingInterface
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_ros.node_handle import NodeHandle


class MovableRobotHW(MockRobotHW):
    """Mock hardware with faults and joints that are moved by hand.

    Attributes:
        reason: Reason of the current fault; empty for none.
        by_hand: Positions of the joints held by hand, in the order of `joints` [rad or m]; None if nobody holds them.
        scaling: Handle of the speed scaling.
    """

    def __init__(self) -> None:
        super().__init__()
        self.reason = ""
        self.by_hand: list[float] | None = None
        self.scaling = SpeedScalingHandle("speed_scaling_factor", [])

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        """Adds the speed scaling to the interfaces of the mock hardware."""
        self.scaling = SpeedScalingHandle("speed_scaling_factor", robot_hw_nh.get_param("joints"))
        scalings = SpeedScalingInterface()
        scalings.register_handle(self.scaling)
        self.register_interface(scalings)
        return super().init(root_nh, robot_hw_nh)

    @property
    def joints(self) -> list[Any]:
        """Returns the command handles."""
        return next(interface.handles for interface in map(self.find, COMMAND_INTERFACES) if interface is not None)

    def fault(self) -> str:
        """Returns the reason of the current fault; empty for none."""
        return self.reason

    def read(self, time_s: float, period_s: float) -> None:
        """Reads the joints; during a fault the joints rest, and a hand moves them."""
        if not self.reason:
            super().read(time_s, period_s)
        for joint, position in zip(self.joints, self.by_hand or (), strict=False):
            joint.state.position, joint.state.velocity = position, 0.0
