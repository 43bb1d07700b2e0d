# SPDX-License-Identifier: BSD-3-Clause
"""Joints of a `RobotHW` whose actuators are known: the handles of both, and the conversion between them in each cycle.

def init(self, root_nh, robot_hw_nh):
    self._transmissions = RobotTransmissions(self, root_nh, ["motor_1", "motor_2"])
    self._guard = JointLimitGuard(self, root_nh)
    return True

def read(self, time_s, period_s):
    for motor in self._transmissions.actuators.values():
        motor.position, motor.velocity, motor.effort = ...      # what is measured
    self._transmissions.propagate_states()

def write(self, time_s, period_s):
    self._guard.enforce(period_s)
    self._transmissions.propagate_commands()
    ... = motor.command_position                                # what is sent
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
    """The commands of one kind of one transmission: from its joints to its actuators."""

    joints: tuple[JointHandle, ...]
    actuators: tuple[ActuatorHandle, ...]
    convert: Callable[[Values], Values]
    attribute: str


class RobotTransmissions:
    """The transmissions of `robot_description` whose actuators a hardware has.

    Makes the joints of these transmissions: they are in the JointStateInterface of the hardware, and in those
    interfaces that the transmissions name; interfaces that are not there yet are registered.

    Args:
        robot_hw: the hardware, in its `init`.
        root_nh: where `robot_description` is found.
        actuators: names of the actuators that the hardware has; transmissions of others are left to other hardware.

    Attributes:
        actuators: handles by name, in the order given.

    Raises:
        ParameterError: no description, or it is not XML.
        TransmissionError: a transmission is faulty, an actuator has none, or one needs an actuator that is not there.
    """

    def __init__(self, robot_hw: RobotHW, root_nh: NodeHandle, actuators: Iterable[str]) -> None:
        self.actuators = {name: ActuatorHandle(name) for name in actuators}
        description = root_nh.get_param("robot_description")
        if not isinstance(description, str):
            raise ParameterError(
                f"parameter {join_names(root_nh.namespace, 'robot_description')} is not set; the "
                "transmissions are found there: load the robot description first"
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
            f"{info.where}: actuator '{name}' is not there; this hardware has: {', '.join(self.actuators)}"
            for info in self._infos
            for name in info.actuators
            if name not in self.actuators
        ]
        faults += [
            f"robot_description: actuator '{name}' has no <transmission>; actuators that have one: "
            f"{', '.join(sorted(known)) or 'none'}"
            for name in self.actuators
            if name not in known
        ]
        if faults:
            raise TransmissionError("; ".join(faults))

    def _command_paths(self, robot_hw: RobotHW, info: TransmissionInfo) -> list[_CommandPath]:
        actuators = tuple(self.actuators[name] for name in info.actuators)
        transmission = info.transmission
        ways: tuple[tuple[type[CommandedInterface], Callable[[Values], Values], str], ...] = (
            (PositionJointInterface, transmission.actuator_positions, "command_position"),
            (VelocityJointInterface, transmission.actuator_velocities, "command_velocity"),
            (EffortJointInterface, transmission.actuator_efforts, "command_effort"),
        )
        paths = []
        for interface_class, convert, attribute in ways:
            if interface_class in info.interfaces:
                interface = _interface(robot_hw, interface_class)
                joints = tuple(interface.register_handle(JointHandle(self._states[name])) for name in info.joints)
                paths.append(_CommandPath(joints, actuators, convert, attribute))
        return paths

    def propagate_states(self) -> None:
        """Computes the joint states from those of the actuators."""
        for info in self._infos:
            actuators = [self.actuators[name] for name in info.actuators]
            joints = [self._states[name] for name in info.joints]
            positions = info.transmission.joint_positions([actuator.position for actuator in actuators])
            velocities = info.transmission.joint_velocities([actuator.velocity for actuator in actuators])
            efforts = info.transmission.joint_efforts([actuator.effort for actuator in actuators])
            for joint, position, velocity, effort in zip(joints, positions, velocities, efforts, strict=True):
                joint.position, joint.velocity, joint.effort = position, velocity, effort

    def propagate_commands(self) -> None:
        """Computes the commands of the actuators from those of the joints; not a number while a joint has none."""
        for path in self._paths:
            commands = path.convert([joint.command for joint in path.joints])
            for actuator, command in zip(path.actuators, commands, strict=True):
                setattr(actuator, path.attribute, command)


def _interface(robot_hw: RobotHW, kind: type[InterfaceT]) -> InterfaceT:
    """The interface of that class; registered if it was not there."""
    found = robot_hw.find(kind)
    if found is None:
        found = kind()
        robot_hw.register_interface(found)
    return found
