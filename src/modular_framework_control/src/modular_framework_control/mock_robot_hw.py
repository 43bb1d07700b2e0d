# SPDX-License-Identifier: BSD-3-Clause
"""Fake hardware: joints that do what they are told, for demonstrations and tests without a robot or physics."""
from __future__ import annotations

import logging

from modular_framework_control.hardware_interface import (
    EffortJointInterface,
    JointHandle,
    JointStateHandle,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from modular_framework_control.joint_limits import (
    JointLimits,
    PositionJointSaturation,
    SymmetricSaturation,
    enforce_all,
    limits_from_urdf,
    limits_with_parameters,
)
from modular_framework_control.node_handle import NodeHandle, ParameterError, join_names, read_names, read_number
from modular_framework_control.robot_hw import RobotHW

_CommandInterface = PositionJointInterface | VelocityJointInterface | EffortJointInterface
LOGGER = logging.getLogger("rosout.mock_robot_hw")


class MockRobotHW(RobotHW):
    """Joints that do, one cycle later, exactly what they were commanded to do.

    Commanded by position they are there; by velocity they have moved on with it; by effort they have been accelerated
    by it, as bodies of inertia 1 without friction or weight. They stop dead at the ends of their range.

    Parameters: `joints`, a list of names; `initial_positions/<joint>` [rad|m] 0; `command_interface`
    PositionJointInterface, or VelocityJointInterface, EffortJointInterface. Limits come from `robot_description` in the
    root namespace and from `joint_limits`, when they are there.
    """

    def __init__(self) -> None:
        super().__init__()
        self._interface_class: type[_CommandInterface] = PositionJointInterface
        self._handles: list[JointHandle] = []
        self._saturations: list[PositionJointSaturation | SymmetricSaturation] = []
        self._limits: list[JointLimits] = []
        self._sent: list[float] = []

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        try:
            names = read_names(robot_hw_nh, "joints")
            positions = [read_number(robot_hw_nh, f"initial_positions/{name}", 0.0, None) for name in names]
            limits = self._read_limits(names, root_nh)
            self._interface_class = _read_interface(robot_hw_nh)
        except ParameterError as error:
            LOGGER.error("%s in %s: %s", type(self).__name__, join_names(robot_hw_nh.namespace, ""), error)
            return False
        states, commands = JointStateInterface(), self._interface_class()
        for name, position, limit in zip(names, positions, limits, strict=True):
            state = states.register_handle(JointStateHandle(name, position))
            by_position = self._interface_class is PositionJointInterface
            handle = commands.register_handle(JointHandle(state, position if by_position else 0.0))
            self._handles.append(handle)
            self._saturations.append(self._saturation(handle, limit))
        self._limits = limits
        self._sent = [handle.command for handle in self._handles]
        self.register_interface(states)
        self.register_interface(commands)
        return True

    def _read_limits(self, names: list[str], root_nh: NodeHandle) -> list[JointLimits]:
        description = root_nh.get_param("robot_description")
        known = limits_from_urdf(description) if isinstance(description, str) else {}
        return [limits_with_parameters(name, known.get(name, JointLimits()), root_nh) for name in names]

    def _saturation(self, handle: JointHandle, limit: JointLimits) -> PositionJointSaturation | SymmetricSaturation:
        if self._interface_class is PositionJointInterface:
            return PositionJointSaturation(handle, limit)
        by_velocity = self._interface_class is VelocityJointInterface
        return SymmetricSaturation(handle, limit.max_velocity if by_velocity else limit.max_effort)

    def read(self, time_s: float, period_s: float) -> None:
        for handle, sent, limit in zip(self._handles, self._sent, self._limits, strict=True):
            state, position = handle.state, sent
            if self._interface_class is not PositionJointInterface:
                velocity = sent
                if self._interface_class is EffortJointInterface:
                    state.effort = sent
                    velocity = state.velocity + sent * period_s
                position = min(max(state.position + velocity * period_s, limit.min_position), limit.max_position)
            state.velocity = (position - state.position) / period_s if period_s > 0.0 else 0.0
            state.position = position

    def write(self, time_s: float, period_s: float) -> None:
        enforce_all(self._saturations, period_s)
        self._sent = [handle.command for handle in self._handles]


def _read_interface(robot_hw_nh: NodeHandle) -> type[_CommandInterface]:
    value = robot_hw_nh.get_param("command_interface", "PositionJointInterface")
    for interface in (PositionJointInterface, VelocityJointInterface, EffortJointInterface):
        if value in (interface.__name__, interface.type_name):
            return interface
    raise ParameterError(f"parameter {join_names(robot_hw_nh.namespace, 'command_interface')}: got {value!r}; expected "
                         "PositionJointInterface, VelocityJointInterface or EffortJointInterface")
