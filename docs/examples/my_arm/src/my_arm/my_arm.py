# SPDX-License-Identifier: BSD-3-Clause
"""Hardware to begin with: copy the package, put the library of your arm where `Motors` is, and change what differs."""

from __future__ import annotations

import logging
import math

from modular_framework_control.hardware_interface import (
    JointHandle,
    JointStateHandle,
    JointStateInterface,
    PositionJointInterface,
    RobotHW,
)
from modular_framework_control.hardware_interface.joint_limits import JointLimitGuard
from modular_framework_ros.node_handle import NodeHandle, ParameterError, read_names, read_number

LOGGER = logging.getLogger("rosout.my_arm")  # below "rosout", so that it reaches ROS's log


class Motors:
    """In place of an arm's own library: motors that turn toward their targets, no faster than 3 rad/s."""

    def __init__(self, positions: list[float]) -> None:
        self.connected = True
        self.positions, self._targets = positions, positions

    def turn(self, period_s: float) -> None:
        """What the motors do in `period_s` [s]."""
        step = 3.0 * period_s
        self.positions = [
            position + min(max(target - position, -step), step)
            for position, target in zip(self.positions, self._targets, strict=True)
        ]

    def move_to(self, targets: list[float]) -> None:
        """Send targets [rad]."""
        self._targets = targets


class MyArm(RobotHW):
    """Joints commanded by position; parameters `joints`: their names, `start_positions/<joint>` [rad] 0: of the motors.

    A joint has no command until the control loop has read where it stands; then it is commanded to stay there.
    """

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        """Connects and says what controllers find here; after a False the framework ends, so say why in the log."""
        try:
            names = read_names(robot_hw_nh, "joints")
            positions = [read_number(robot_hw_nh, f"start_positions/{name}", 0.0, None) for name in names]
            states, commands = JointStateInterface(), PositionJointInterface()
            self._handles = [
                commands.register_handle(JointHandle(states.register_handle(JointStateHandle(name)))) for name in names
            ]
            self.register_interface(states)
            self.register_interface(commands)
            self._guard = JointLimitGuard(self, root_nh)
        except ParameterError as error:
            LOGGER.error("my_arm: %s", error)
            return False
        self._motors = Motors(positions)
        return True

    def read(self, time_s: float, period_s: float) -> None:
        """Each cycle, first: what is measured [rad, rad/s, Nm]. Must not wait."""
        self._motors.turn(period_s)
        for handle, position in zip(self._handles, self._motors.positions, strict=True):
            measured_before = period_s > 0.0 and not math.isnan(handle.position)
            handle.state.velocity = (position - handle.position) / period_s if measured_before else 0.0
            handle.state.position = position

    def write(self, time_s: float, period_s: float) -> None:
        """Each cycle, last: what controllers command, kept within the robot's limits. Must not wait."""
        self._guard.enforce(period_s)
        self._motors.move_to([handle.command for handle in self._handles])

    def fault(self) -> str:
        """Why the arm cannot follow just now; goals then end with this reason."""
        return "" if self._motors.connected else "no connection to the motors"

    def close(self) -> None:
        """Disconnects."""
        self._motors.connected = False
