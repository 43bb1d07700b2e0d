# SPDX-License-Identifier: BSD-3-Clause
"""Mock hardware whose joints follow their commands exactly, for demonstrations and tests without robot or physics."""

from __future__ import annotations

import logging

from modular_framework_control.hardware_interface.handles import JointHandle, JointStateHandle
from modular_framework_control.hardware_interface.interfaces import (
    COMMAND_INTERFACES,
    CommandInterface,
    EffortJointInterface,
    JointStateInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.joint_limits import JointLimitGuard, JointLimits
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names
from modular_framework_ros.parameter_declarations import parameters_below

LOGGER = logging.getLogger("rosout.mock_robot_hw")


class MockRobotHW(RobotHW):
    """Joints that follow their commands exactly, one cycle later.

    A position command is reached, a velocity command is integrated once, and an effort command twice, as for joints
    with inertia 1 and without friction or gravity. Joints stop at once at the ends of their ranges, or at their initial
    position if this is outside.

    Parameters: `parameters/MockRobotHW.yaml`; optional limits from `robot_description` in the root namespace and from
    `joint_limits`.
    """

    def __init__(self) -> None:
        super().__init__()
        self._handles: list[JointHandle] = []
        self._limits: list[JointLimits] = []
        self._sent: list[float] = []
        self._sent_period_s = 0.0

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        try:
            parameters = parameters_below("modular_framework_control", "MockRobotHW", robot_hw_nh, root_nh)
            names, initial, requested = parameters.values("~joints", "~initial_positions", "~command_interface")
            positions = [float(initial.get(name, 0.0)) for name in names]
            interface_class = next(kind for kind in COMMAND_INTERFACES if requested in (kind.__name__, kind.type_name))
            self._by_velocity = interface_class is VelocityJointInterface
            self._by_effort = interface_class is EffortJointInterface
            self._register(interface_class, names, positions)
            self._guard = JointLimitGuard(self, root_nh)
        except ParameterError as error:
            LOGGER.error("%s in %s: %s", type(self).__name__, join_names(robot_hw_nh.namespace, ""), error)
            return False
        self._limits = [self._guard.limits[name] for name in names]
        self._sent = [0.0] * len(names) if self._by_velocity or self._by_effort else positions
        return True

    def _register(self, interface_class: type[CommandInterface], names: list[str], positions: list[float]) -> None:
        states, commands = JointStateInterface(), interface_class()
        for name, position in zip(names, positions, strict=True):
            state = states.register_handle(JointStateHandle(name, position))
            self._handles.append(commands.register_handle(interface_class.handle_class(state)))
        self.register_interface(states)
        self.register_interface(commands)

    def read(self, time_s: float, period_s: float) -> None:
        if self._by_velocity or self._by_effort:
            self._integrate(period_s)
            return
        for handle, position in zip(self._handles, self._sent, strict=True):
            state = handle.state
            if self._sent_period_s > 0.0:  # a cycle of zero length does not change the velocity
                state.velocity = (position - state.position) / self._sent_period_s
            state.position = position

    def _integrate(self, period_s: float) -> None:
        """Integrates the commanded velocities or efforts over `period_s`."""
        for handle, sent, limit in zip(self._handles, self._sent, self._limits, strict=True):
            state, velocity = handle.state, sent
            if self._by_effort:
                state.effort = sent
                velocity = state.velocity + sent * period_s
            min_position, max_position = limit.range_from(state.position)
            position = min(max(state.position + velocity * period_s, min_position), max_position)
            if period_s > 0.0:
                state.velocity = (position - state.position) / period_s
            state.position = position

    def write(self, time_s: float, period_s: float) -> None:
        self._guard.enforce(period_s)
        self._sent_period_s = period_s  # the period used by the controllers; the next period may differ
        self._sent = [handle.command for handle in self._handles]
