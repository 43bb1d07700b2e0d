# SPDX-License-Identifier: BSD-3-Clause
"""`RobotHW` of the simulated robot.

The transmissions of the robot description define the hardware interfaces of each joint, as in ros_control.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from modular_framework_control.hardware_interface.handles import JointHandle, JointStateHandle
from modular_framework_control.hardware_interface.interfaces import (
    ControllerInfo,
    EffortJointInterface,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
    interface_from_name,
)
from modular_framework_control.hardware_interface.joint_limits import (
    JointLimiter,
    JointLimits,
    SoftJointLimits,
    limit_handle,
    limits_with_parameters,
    soft_limits_from_urdf,
    soft_limits_with_parameters,
)
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_ros.node_handle import NodeHandle
from modular_framework_simulation.physics.robot_body import Drive, Mode, RobotBody
from modular_framework_simulation.robots.robot_joint import RobotJoint

_INTERFACES = {
    Mode.POSITION: PositionJointInterface,
    Mode.VELOCITY: VelocityJointInterface,
    Mode.EFFORT: EffortJointInterface,
}
_ROUNDING = 1.0 + 1e-6
_MODES = {interface.type_name: mode for mode, interface in _INTERFACES.items()}


class SimulatedRobotHW(RobotHW):
    """Joint states and commands of a robot in the simulated world.

    A joint follows the interface that its running controller claims; before the first claim, it holds its position.

    Args:
        robot: The robot in the physics engine.
    """

    def __init__(self, robot: RobotBody) -> None:
        super().__init__()
        self._robot = robot
        self._states: list[JointStateHandle] = []
        self._handles: dict[str, dict[Mode, JointHandle]] = {}
        self._limiters: dict[str, dict[Mode, JointLimiter]] = {}
        self._drives: dict[str, Drive] = {}
        self._efforts: dict[str, float] = {}

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        """Registers a state handle for every movable joint, and the command handles of the transmissions.

        Args:
            root_nh: Node handle for `joint_limits/<joint>/...` and `robot_description` with its soft limits.
            robot_hw_nh: Not used.

        Raises:
            HardwareInterfaceError: A transmission names an unknown hardware interface.
            ParameterError: A parameter of the joint limits has the wrong type.
        """
        del robot_hw_nh
        states = JointStateInterface()
        commands = {mode: interface_class() for mode, interface_class in _INTERFACES.items()}
        joints = {joint.name: joint for joint in self._robot.description.joints}
        text = root_nh.get_param("robot_description")
        soft = soft_limits_from_urdf(text) if isinstance(text, str) else {}
        for name in self._robot.joint_names:
            state = states.register_handle(JointStateHandle(name))
            self._states.append(state)
            for interface in joints[name].interfaces:
                mode = _MODES[interface_from_name(interface).type_name]
                handle = JointHandle(state, supports_max_effort=True)
                commands[mode].register_handle(handle)
                limits = limits_with_parameters(name, _limits(joints[name]), root_nh)
                soft_limits = soft_limits_with_parameters(name, soft.get(name), root_nh)
                self._add_command(mode, handle, limits, soft_limits)
        self.register_interface(states)
        for interface_object in commands.values():
            if interface_object.names:
                self.register_interface(interface_object)
        self.read(0.0, 0.0)
        self.hold()
        return True

    def _add_command(self, mode: Mode, handle: JointHandle, limits: JointLimits, soft: SoftJointLimits | None) -> None:
        self._handles.setdefault(handle.name, {})[mode] = handle
        self._efforts[handle.name] = limits.max_effort
        limiter = limit_handle(_INTERFACES[mode], handle, limits, soft)
        self._limiters.setdefault(handle.name, {})[mode] = limiter

    def hold(self) -> None:
        """Sets the commands to the current positions; must be called after a reset of the joints."""
        for name, handles in self._handles.items():
            position = next(iter(handles.values())).position
            for mode, handle in handles.items():
                handle.command = position if mode is Mode.POSITION else 0.0
                self._limiters[name][mode].reset()
            active_mode = self._drives[name].mode if name in self._drives else next(iter(handles))
            self._drives[name] = Drive(active_mode, handles[active_mode].command, 0.0, self._efforts[name])
            if active_mode is Mode.POSITION:
                self._drives[name].command = position

    def read(self, time_s: float, period_s: float) -> None:
        """Updates the joint states from the physics engine."""
        del time_s, period_s
        for state, reading in zip(self._states, self._robot.read(), strict=True):
            state.position = reading.position
            state.velocity = reading.velocity
            state.effort = reading.effort

    def write(self, time_s: float, period_s: float) -> None:
        """Applies limits to the commands, and passes the commands to the motors for the next physics steps."""
        del time_s
        for name, drive in self._drives.items():
            handle = self._handles[name][drive.mode]
            self._limiters[name][drive.mode].enforce_limits(period_s)
            if drive.mode is Mode.POSITION and period_s > 0:
                drive.feed_forward = _feed_forward(handle, (handle.command - drive.command) / period_s)
            drive.command = handle.command
            limit = self._efforts[name]
            drive.effort_limit = min(limit, handle.max_effort) if handle.max_effort > 0 else limit
        self._robot.drive(self._drives)

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Switches each joint to the interface that a starting controller claims."""
        del stop
        for mode, joints in _claims(start):
            for name in joints:
                handle = self._handles[name][mode]
                handle.command = handle.position if mode is Mode.POSITION else 0.0
                if mode is Mode.POSITION and self._drives[name].mode is Mode.POSITION:
                    # The drive keeps its set point, because a loaded joint sags slightly below it.
                    handle.command = self._drives[name].command
                else:
                    self._limiters[name][mode].reset()
                self._drives[name] = Drive(mode, handle.command, 0.0, self._efforts[name])


def _claims(controllers: Iterable[ControllerInfo]) -> Iterable[tuple[Mode, tuple[str, ...]]]:
    for controller in controllers:
        for claim in controller.claimed_resources:
            if claim.hardware_interface in _MODES:
                yield _MODES[claim.hardware_interface], claim.resources


def _feed_forward(handle: JointHandle, velocity: float) -> float:
    """Returns `velocity`, or 0 above the joint's limit, because a command that is reset to the joint is no motion."""
    max_velocity = handle.limits.max_velocity if handle.limits is not None else float("inf")
    return velocity if abs(velocity) <= _ROUNDING * max_velocity else 0.0


def _limits(joint: RobotJoint) -> JointLimits:
    return JointLimits(
        min_position=joint.lower,
        max_position=joint.upper,
        max_velocity=joint.velocity,
        max_effort=joint.effort,
        continuous=joint.lower == float("-inf"),
    )
