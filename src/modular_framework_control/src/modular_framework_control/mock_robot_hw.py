# SPDX-License-Identifier: BSD-3-Clause
"""Fake hardware: joints that do what they are told, for demonstrations and tests without a robot or physics."""
from __future__ import annotations

import logging

from modular_framework_control.hardware_interface import (
    JointHandle,
    JointStateHandle,
    JointStateInterface,
    PositionJointInterface,
)
from modular_framework_control.joint_limits import (
    JointLimits,
    PositionJointSaturation,
    limits_from_urdf,
    limits_with_parameters,
)
from modular_framework_control.node_handle import NodeHandle, ParameterError, join_names, read_names, read_number
from modular_framework_control.robot_hw import RobotHW

LOGGER = logging.getLogger("rosout.mock_robot_hw")


class MockRobotHW(RobotHW):
    """Position-controlled joints that are, one cycle later, exactly where they were commanded to be.

    Parameters: `joints`, a list of names; `initial_positions/<joint>` [rad|m] 0. Limits come from `robot_description`
    in the root namespace and from `joint_limits`, when they are there.
    """

    def __init__(self) -> None:
        super().__init__()
        self._handles: list[JointHandle] = []
        self._saturations: list[PositionJointSaturation] = []
        self._sent: list[float] = []

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        try:
            names = read_names(robot_hw_nh, "joints")
            positions = [read_number(robot_hw_nh, f"initial_positions/{name}", 0.0, None) for name in names]
            limits = self._read_limits(names, root_nh)
        except ParameterError as error:
            LOGGER.error("%s in %s: %s", type(self).__name__, join_names(robot_hw_nh.namespace, ""), error)
            return False
        states, commands = JointStateInterface(), PositionJointInterface()
        for name, position, limit in zip(names, positions, limits, strict=True):
            state = states.register_handle(JointStateHandle(name, position))
            handle = commands.register_handle(JointHandle(state, position))
            self._handles.append(handle)
            self._saturations.append(PositionJointSaturation(handle, limit))
        self._sent = positions
        self.register_interface(states)
        self.register_interface(commands)
        return True

    def _read_limits(self, names: list[str], root_nh: NodeHandle) -> list[JointLimits]:
        description = root_nh.get_param("robot_description")
        known = limits_from_urdf(description) if isinstance(description, str) else {}
        return [limits_with_parameters(name, known.get(name, JointLimits()), root_nh) for name in names]

    def read(self, time_s: float, period_s: float) -> None:
        for handle, position in zip(self._handles, self._sent, strict=True):
            state = handle.state
            state.velocity = (position - state.position) / period_s if period_s > 0.0 else 0.0
            state.position = position

    def write(self, time_s: float, period_s: float) -> None:
        for saturation in self._saturations:
            saturation.enforce_limits(period_s)
        self._sent = [handle.command for handle in self._handles]
