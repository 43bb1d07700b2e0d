# SPDX-License-Identifier: BSD-3-Clause
"""Joints of a `RobotHW` that are moved by actuators through transmissions: handles, and conversions in each cycle.

def init(self, root_nh, robot_hw_nh):
    self._transmissions = RobotTransmissions(self, root_nh, ["motor_1", "motor_2"])
    self._guard = JointLimitGuard(self, root_nh)
    return True

def read(self, time_s, period_s):
    for motor in self._transmissions.actuators.values():
        motor.position, motor.velocity, motor.effort = ...      # measured values
    self._transmissions.propagate_states()

def write(self, time_s, period_s):
    self._guard.enforce(period_s)
    self._transmissions.propagate_commands()
    ... = motor.command_position                                # value to send
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from modular_framework_control.hardware_interface.handles import ActuatorHandle, JointHandle, JointStateHandle
from modular_framework_control.hardware_interface.interfaces import (
    EffortJointInterface,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.robot_hw import InterfaceT, RobotHW
from modular_framework_control.hardware_interface.transmission_parser import TransmissionInfo, read_transmissions
from modular_framework_control.hardware_interface.transmissions import TransmissionError, Values
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names

CommandedInterface = PositionJointInterface | VelocityJointInterface | EffortJointInterface


@dataclass(frozen=True, slots=True)
class _CommandPath:
    """Conversion of one kind of command of one transmission, from joints to actuators."""

    joints: tuple[JointHandle, ...]
    actuators: tuple[ActuatorHandle, ...]
    convert: Callable[[Values], Values]
    attribute: str


class RobotTransmissions:
    """The transmissions of `robot_description` for the actuators of a hardware.

    The constructor creates the joints of these transmissions, in the JointStateInterface of the hardware and in the
    interfaces that the transmissions name; missing interfaces are registered.

    Args:
        robot_hw: Hardware, during its `init`.
        root_nh: Namespace of `robot_description`.
        actuators: Names of the hardware's actuators; transmissions without these actuators are ignored.

    Attributes:
        actuators: Actuator handles by name, in the given order.

    Raises:
        ParameterError: The description is missing or not XML.
        TransmissionError: A transmission is faulty, an actuator has no transmission, or a transmission needs an unknown
            actuator.
    """

    def __init__(self, robot_hw: RobotHW, root_nh: NodeHandle, actuators: Iterable[str]) -> None:
        self.actuators = {name: ActuatorHandle(name) for name in actuators}
        description = root_nh.get_param("robot_description")
        if not isinstance(description, str):
            raise ParameterError(
                f"parameter {join_names(root_nh.namespace, 'robot_description')} is not set, but needed for "
                "transmissions; load the robot description first"
            )
        self._infos = [
            info for info in read_transmissions(description) if not self.actuators.keys().isdisjoint(info.actuators)
        ]
        self._check_actuators()
        states = _interface(robot_hw, JointStateInterface)
        self._states = {
            name: states.register_handle(JointStateHandle(name)) for info in self._infos for name in info.joints
        }
        self._paths = [path for info in self._infos for path in self._command_paths(robot_hw, info)]

    def _check_actuators(self) -> None:
        known = {name for info in self._infos for name in info.actuators}
        faults = [
            f"{info.where}: unknown actuator '{name}'; this hardware has: {', '.join(self.actuators)}"
            for info in self._infos
            for name in info.actuators
            if name not in self.actuators
        ]
        faults += [
            f"robot_description: actuator '{name}' has no <transmission>; actuators with a transmission: "
            f"{', '.join(sorted(known)) or 'none'}"
            for name in self.actuators
            if name not in known
        ]
        if faults:
            raise TransmissionError("; ".join(faults))

    def _command_paths(self, robot_hw: RobotHW, info: TransmissionInfo) -> list[_CommandPath]:
        actuators = tuple(self.actuators[name] for name in info.actuators)
        transmission = info.transmission
        conversions: tuple[tuple[type[CommandedInterface], Callable[[Values], Values], str], ...] = (
            (PositionJointInterface, transmission.actuator_positions, "command_position"),
            (VelocityJointInterface, transmission.actuator_velocities, "command_velocity"),
            (EffortJointInterface, transmission.actuator_efforts, "command_effort"),
        )
        paths = []
        for interface_class, convert, attribute in conversions:
            if interface_class in info.interfaces:
                interface = _interface(robot_hw, interface_class)
                joints = tuple(interface.register_handle(JointHandle(self._states[name])) for name in info.joints)
                paths.append(_CommandPath(joints, actuators, convert, attribute))
        return paths

    def propagate_states(self) -> None:
        """Computes the joint states from the actuator states."""
        for info in self._infos:
            actuators = [self.actuators[name] for name in info.actuators]
            joints = [self._states[name] for name in info.joints]
            positions = info.transmission.joint_positions([actuator.position for actuator in actuators])
            velocities = info.transmission.joint_velocities([actuator.velocity for actuator in actuators])
            efforts = info.transmission.joint_efforts([actuator.effort for actuator in actuators])
            for joint, position, velocity, effort in zip(joints, positions, velocities, efforts, strict=True):
                joint.position, joint.velocity, joint.effort = position, velocity, effort

    def propagate_commands(self) -> None:
        """Computes the actuator commands from the joint commands; NaN if a joint has no command."""
        for path in self._paths:
            commands = path.convert([joint.command for joint in path.joints])
            for actuator, command in zip(path.actuators, commands, strict=True):
                setattr(actuator, path.attribute, command)


def _interface(robot_hw: RobotHW, kind: type[InterfaceT]) -> InterfaceT:
    """Returns the interface of a class, registering a missing interface."""
    interface = robot_hw.find(kind)
    if interface is None:
        interface = kind()
        robot_hw.register_interface(interface)
    return interface
