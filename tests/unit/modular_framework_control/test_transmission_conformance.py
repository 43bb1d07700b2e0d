# SPDX-License-Identifier: BSD-3-Clause
"""The conformance suite over hardware whose joints stand behind transmissions, and whose motors answer late."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import pytest

from modular_framework_control.hardware_interface.handles import ActuatorHandle
from modular_framework_control.hardware_interface.interfaces import JointStateInterface
from modular_framework_control.hardware_interface.joint_limits import JointLimitGuard, JointLimits
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.hardware_interface.robot_hw_conformance import RobotHWConformance
from modular_framework_control.hardware_interface.robot_transmissions import RobotTransmissions
from modular_framework_ros.node_handle import MappingNodeHandle, NodeHandle

LIMIT = JointLimits(-1.0, 1.0, 2.0, 10.0)
JOINT = '<joint name="{name}" type="revolute"><limit lower="-1" upper="1" velocity="2" effort="10"/></joint>'
TURN = """
<transmission name="base"><type>transmission_interface/SimpleTransmission</type>
  <joint name="turn"><offset>0.1</offset>{interface}</joint>
  <actuator name="m1"><mechanicalReduction>-100</mechanicalReduction></actuator>
</transmission>"""
WRIST = """
<transmission name="wrist"><type>transmission_interface/DifferentialTransmission</type>
  <joint name="pitch"><role>joint1</role>{interface}</joint>
  <joint name="roll"><role>joint2</role><mechanicalReduction>2</mechanicalReduction>{interface}</joint>
  <actuator name="m2"><role>actuator1</role><mechanicalReduction>50</mechanicalReduction></actuator>
  <actuator name="m3"><role>actuator2</role><mechanicalReduction>-50</mechanicalReduction></actuator>
</transmission>"""
ARM = """
<transmission name="arm"><type>transmission_interface/FourBarLinkageTransmission</type>
  <joint name="lift"><role>joint1</role><offset>0.2</offset>{interface}</joint>
  <joint name="reach"><role>joint2</role><mechanicalReduction>-3</mechanicalReduction>{interface}</joint>
  <actuator name="m4"><role>actuator1</role><mechanicalReduction>40</mechanicalReduction></actuator>
  <actuator name="m5"><role>actuator2</role><mechanicalReduction>30</mechanicalReduction></actuator>
</transmission>"""


def motor_positions(joints: Mapping[str, float]) -> dict[str, float]:
    """Returns where the motors stand, by hand from the descriptions above [rad]."""
    turn, pitch, roll = joints["turn"], joints["pitch"], joints["roll"]
    lift, reach = joints.get("lift", 0.0) - 0.2, joints.get("reach", 0.0)
    return {
        "m1": -100.0 * (turn - 0.1),
        "m2": 50.0 * (pitch + 2.0 * roll),
        "m3": -50.0 * (pitch - 2.0 * roll),
        "m4": 40.0 * lift,
        "m5": 30.0 * (lift - 3.0 * reach),
    }


@dataclass
class Motor:
    """A motor that follows its commands exactly, one cycle later, and whose first answers are lost.

    Attributes:
        position: Shaft position [rad].
        lost_answers: Number of reads without an answer.
        velocity: Shaft velocity [rad/s].
        answered: Whether an answer has arrived.
    """

    position: float
    lost_answers: int
    velocity: float = 0.0
    answered: bool = False

    def answer(self, handle: ActuatorHandle) -> None:
        """Writes the measurement, if the motor answers."""
        if self.lost_answers > 0:
            self.lost_answers -= 1
            return
        handle.position, handle.velocity = self.position, self.velocity
        self.answered = True

    def follow(self, handle: ActuatorHandle, period_s: float) -> None:
        """Follows whichever command is a number."""
        if period_s <= 0.0:
            return
        if math.isfinite(handle.command_position):
            self.velocity = (handle.command_position - self.position) / period_s
            self.position = handle.command_position
        elif math.isfinite(handle.command_velocity):
            self.velocity = handle.command_velocity
            self.position += self.velocity * period_s


@dataclass
class Wrist:
    """Dynamics of the motors m1, m2 and m3: a moment of inertia of 1 kg m^2 at each joint, and no friction.

    Attributes:
        velocities: Joint velocities of turn, pitch and roll [rad/s].
    """

    velocities: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])

    def push(self, motors: Mapping[str, Motor], handles: Mapping[str, ActuatorHandle], period_s: float) -> None:
        """Accelerates the joints by the torques of the motors, which keep their power in the gears."""
        base, left, right = (
            handle.command_effort if math.isfinite(handle.command_effort) else 0.0 for handle in handles.values()
        )
        torques = (-100.0 * base, 50.0 * left - 50.0 * right, 2.0 * (50.0 * left + 50.0 * right))
        self.velocities = [
            velocity + torque * period_s for velocity, torque in zip(self.velocities, torques, strict=True)
        ]
        turn, pitch, roll = self.velocities
        speeds = (-100.0 * turn, 50.0 * (pitch + 2.0 * roll), -50.0 * (pitch - 2.0 * roll))
        for (name, motor), speed in zip(motors.items(), speeds, strict=True):
            motor.velocity = speed
            motor.position += speed * period_s
            handles[name].effort = handles[name].command_effort if math.isfinite(handles[name].command_effort) else 0.0


class GearedArm(RobotHW):
    """Hardware that knows motors; the transmissions of the robot description move the joints."""

    def __init__(self) -> None:
        super().__init__()
        self.motors: dict[str, Motor] = {}
        self._dynamics: Wrist | None = None

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        self._transmissions = RobotTransmissions(self, root_nh, self.motors)
        self._guard = JointLimitGuard(self, root_nh)
        if robot_hw_nh.get_param("by_effort"):
            self._dynamics = Wrist()
        return True

    def read(self, time_s: float, period_s: float) -> None:
        for name, handle in self._transmissions.actuators.items():
            self.motors[name].answer(handle)
        self._transmissions.propagate_states()

    def write(self, time_s: float, period_s: float) -> None:
        self._guard.enforce(period_s)
        self._transmissions.propagate_commands()
        handles = self._transmissions.actuators
        if self._dynamics is not None:
            self._dynamics.push(self.motors, handles, period_s)
            return
        for name, handle in handles.items():
            self.motors[name].follow(handle, period_s)

    def fault(self) -> str:
        silent = [name for name, motor in self.motors.items() if not motor.answered]
        return f"no answer yet of {', '.join(silent)}" if silent else ""


class GearedSuite(RobotHWConformance):
    """An arm behind three kinds of transmissions, whose motors answer one after the other.

    Attributes:
        interface: Command interface of the joints.
        transmissions: Transmissions of the robot description.
        joints: Joints of these transmissions.
    """

    settle_s = 0.2
    interface: ClassVar[str]
    transmissions: ClassVar[str] = TURN + WRIST + ARM
    joints: ClassVar[tuple[str, ...]] = ("turn", "pitch", "roll", "lift", "reach")

    def make_robot_hw(self, positions: Mapping[str, float] | None = None) -> GearedArm:
        starts = positions or {"turn": 0.5, "pitch": -0.3, "roll": 0.2, "lift": 0.1, "reach": -0.4}
        interface = f"<hardwareInterface>hardware_interface/{self.interface}</hardwareInterface>"
        description = "".join(JOINT.format(name=name) for name in self.joints)
        description += self.transmissions.format(interface=interface)
        root = MappingNodeHandle(
            {
                "robot_description": f'<robot name="geared">{description}</robot>',
                "hw": {"by_effort": self.interface == "EffortJointInterface"},
            }
        )
        robot_hw = GearedArm()
        robot_hw.motors = {
            name: Motor(position, lost_answers=1 + index)
            for index, (name, position) in enumerate(motor_positions(starts).items())
            if f'"{name}"' in self.transmissions
        }
        assert robot_hw.init(root, root.child("hw"))
        return robot_hw

    def limits(self) -> Mapping[str, JointLimits]:
        return dict.fromkeys(self.joints, LIMIT)

    def test_joints_whose_motors_have_not_answered_are_neither_measured_nor_commanded(self) -> None:
        robot_hw = self.make_robot_hw()
        starts = {name: motor.position for name, motor in robot_hw.motors.items()}
        while self._in_loop(robot_hw.fault):
            self._cycle(robot_hw, {})
            assert {name: motor.position for name, motor in robot_hw.motors.items()} == pytest.approx(starts)
        states = robot_hw.get(JointStateInterface).handles
        assert all(math.isfinite(state.position) for state in states)


class TestGearedByPosition(GearedSuite):
    """Joints that take positions."""

    interface = "PositionJointInterface"


class TestGearedByVelocity(GearedSuite):
    """Joints that take velocities."""

    interface = "VelocityJointInterface"


class TestGearedByEffort(GearedSuite):
    """Joints that take efforts, without the linkage: ros_control's formula of its efforts does not conserve power."""

    interface = "EffortJointInterface"
    transmissions = TURN + WRIST
    joints = ("turn", "pitch", "roll")
