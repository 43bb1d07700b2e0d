# SPDX-License-Identifier: BSD-3-Clause
"""Transmissions between actuators and joints: formulas, the robot description, and hardware that has them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_control.hardware_interface.handles import JointStateHandle
from modular_framework_control.hardware_interface.interfaces import (
    EffortJointInterface,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.joint_limit_parameters import limits_from_urdf
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.hardware_interface.robot_transmissions import RobotTransmissions
from modular_framework_control.hardware_interface.transmission_parser import read_transmissions
from modular_framework_control.hardware_interface.transmissions import (
    DifferentialTransmission,
    FourBarLinkageTransmission,
    SimpleTransmission,
    Transmission,
    TransmissionError,
)
from modular_framework_control.hardware_interface.urdf_xml import parse_description
from modular_framework_ros.node_handle import MappingNodeHandle, NodeHandle, ParameterError

REDUCTIONS = st.floats(0.01, 1000.0).flatmap(lambda n: st.sampled_from([n, -n]))
NUMBERS = st.floats(-1000.0, 1000.0)
PAIRS = st.tuples(REDUCTIONS, REDUCTIONS)
TRANSMISSIONS = st.one_of(
    st.builds(SimpleTransmission, REDUCTIONS, NUMBERS),
    st.builds(DifferentialTransmission, PAIRS, PAIRS, st.tuples(NUMBERS, NUMBERS)),
    st.builds(FourBarLinkageTransmission, PAIRS, PAIRS, st.tuples(NUMBERS, NUMBERS)),
)


@given(TRANSMISSIONS, st.tuples(NUMBERS, NUMBERS))
def test_the_way_to_the_actuators_is_the_inverse_of_the_way_to_the_joints(
    transmission: Transmission, values: tuple[float, float]
) -> None:
    joints = values[: transmission.size]
    for there, back in (
        (transmission.actuator_positions, transmission.joint_positions),
        (transmission.actuator_velocities, transmission.joint_velocities),
        (transmission.actuator_efforts, transmission.joint_efforts),
    ):
        assert back(there(joints)) == pytest.approx(joints, rel=1e-6, abs=1e-6)


@given(
    st.one_of(st.builds(SimpleTransmission, REDUCTIONS), st.builds(DifferentialTransmission, PAIRS, PAIRS)),
    st.tuples(NUMBERS, NUMBERS),
    st.tuples(NUMBERS, NUMBERS),
)
def test_no_power_is_lost_in_gears_and_differentials(
    transmission: Transmission, velocities: tuple[float, float], efforts: tuple[float, float]
) -> None:
    speeds, pushes = velocities[: transmission.size], efforts[: transmission.size]
    taken = sum(v * e for v, e in zip(speeds, pushes, strict=True))
    given_ = sum(
        v * e for v, e in zip(transmission.joint_velocities(speeds), transmission.joint_efforts(pushes), strict=True)
    )
    assert given_ == pytest.approx(taken, rel=1e-6, abs=1e-3)


@pytest.mark.parametrize(
    ("transmission", "inputs", "positions", "velocities", "efforts"),
    [
        # the values of transmission_interface's own tests
        (SimpleTransmission(10.0, 1.0), ((1.0,), (1.0,), (1.0,)), (1.1,), (0.1,), (10.0,)),
        (
            DifferentialTransmission((10.0, 10.0), (2.0, 2.0), (1.0, 1.0)),
            ((0.0, 0.0),) * 3,
            (1.0, 1.0),
            (0.0, 0.0),
            (0.0, 0.0),
        ),
        (DifferentialTransmission((10.0, 10.0), (2.0, 2.0)), ((10.0, 10.0),) * 3, (0.5, 0.0), (0.5, 0.0), (400.0, 0.0)),
        (
            DifferentialTransmission((10.0, 10.0), (2.0, 2.0)),
            ((10.0, -10.0),) * 3,
            (0.0, 0.5),
            (0.0, 0.5),
            (0.0, 400.0),
        ),
        (
            DifferentialTransmission((10.0, -20.0), (-2.0, 4.0), (-2.0, 4.0)),
            ((3.0, 5.0),) * 3,
            (-2.0125, 4.06875),
            (-0.0125, 0.06875),
            (140.0, 520.0),
        ),
        (
            FourBarLinkageTransmission((10.0, 10.0), (2.0, 2.0)),
            ((10.0, 5.0), (10.0, 5.0), (5.0, 10.0)),
            (0.5, 0.0),
            (0.5, 0.0),
            (100.0, 0.0),
        ),
        (
            FourBarLinkageTransmission((10.0, 10.0), (2.0, 2.0)),
            ((0.0, 10.0),) * 3,
            (0.0, 0.5),
            (0.0, 0.5),
            (0.0, 200.0),
        ),
        (
            FourBarLinkageTransmission((10.0, -20.0), (-2.0, 4.0), (-2.0, 4.0)),
            ((3.0, 5.0),) * 3,
            (-2.15, 3.975),
            (-0.15, -0.025),
            (-60.0, -160.0),
        ),
    ],
)
def test_joints_move_as_in_ros_control(
    transmission: Transmission, inputs: Any, positions: Any, velocities: Any, efforts: Any
) -> None:
    assert transmission.joint_positions(inputs[0]) == pytest.approx(positions)
    assert transmission.joint_velocities(inputs[1]) == pytest.approx(velocities)
    assert transmission.joint_efforts(inputs[2]) == pytest.approx(efforts)


@pytest.mark.parametrize(
    "make",
    [
        lambda: SimpleTransmission(0.0),
        lambda: SimpleTransmission(math.nan),
        lambda: SimpleTransmission(1.0, math.inf),
        lambda: DifferentialTransmission((1.0, 0.0)),
        lambda: FourBarLinkageTransmission((1.0, 1.0), (0.0, 1.0)),
    ],
)
def test_ratios_of_nothing_are_refused(make: Callable[[], Transmission]) -> None:
    with pytest.raises(TransmissionError, match="expected numbers"):
        make()


# ---- robot description ----

POSITION = "hardware_interface/PositionJointInterface"


def simple(name: str = "t", joint: str = "j", actuator: str = "m", interface: str = POSITION) -> str:
    return f"""<transmission name="{name}">
  <type>transmission_interface/SimpleTransmission</type>
  <joint name="{joint}">
    <offset>0.5</offset><hardwareInterface>{interface}</hardwareInterface>
  </joint>
  <actuator name="{actuator}"><mechanicalReduction>50</mechanicalReduction></actuator>
</transmission>"""


def pair(kind: str, roles: tuple[str, ...] = ("joint2", "joint1", "actuator2", "actuator1")) -> str:
    second, first, motor_2, motor_1 = roles
    return f"""<transmission name="wrist">
  <type>transmission_interface/{kind}</type>
  <joint name="roll"><role>{second}</role><offset>-0.5</offset>
    <hardwareInterface>{POSITION}</hardwareInterface></joint>
  <joint name="pitch"><role>{first}</role><mechanicalReduction>2</mechanicalReduction>
    <hardwareInterface>PositionJointInterface</hardwareInterface></joint>
  <actuator name="m2"><role>{motor_2}</role><mechanicalReduction>-50</mechanicalReduction></actuator>
  <actuator name="m1"><role>{motor_1}</role><mechanicalReduction>50</mechanicalReduction></actuator>
</transmission>"""


def robot(*transmissions: str) -> str:
    head = '<?xml version="1.0"?>\n<robot name="r" xmlns="http://www.ros.org">\n'
    return head + "\n".join(transmissions) + "</robot>"


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ("DifferentialTransmission", DifferentialTransmission),
        ("FourBarLinkageTransmission", FourBarLinkageTransmission),
    ],
)
def test_roles_say_which_joint_and_actuator_is_which(kind: str, expected: Any) -> None:
    (info,) = read_transmissions(robot(pair(kind)))
    assert info.transmission == expected((50.0, -50.0), (2.0, 1.0), (0.0, -0.5))
    assert (info.joints, info.actuators, info.element.line) == (("pitch", "roll"), ("m1", "m2"), 3)
    assert info.interfaces == (PositionJointInterface,)


def test_a_simple_transmission_has_one_of_each() -> None:
    (info,) = read_transmissions(robot(simple()))
    assert info.transmission == SimpleTransmission(50.0, 0.5)


TWICE = "transmission_interface/SimpleTransmission has 1"


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (simple().replace(' name="t"', ""), r"robot_description:3: <transmission> has no name"),
        (
            simple().replace("SimpleTransmission", "WormDrive"),
            r":3: transmission 't': <type> is 'transmission_interface/WormDrive'; "
            r"allowed: .*FourBarLinkageTransmission",
        ),
        (simple().replace("<type>transmission_interface/SimpleTransmission</type>", ""), "<type> is missing; allowed"),
        (simple().replace("<joint", "<joint name='x'/><joint", 1), f"got 2 <joint>; {TWICE}"),
        (simple().replace('<actuator name="m"', "<actuator"), r":8: transmission 't': <actuator> has no name"),
        (
            simple().replace("50", "fifty"),
            r":8: .*<mechanicalReduction> of actuator 'm' is 'fifty'; expected a number "
            "other than 0",
        ),
        (simple().replace("50", "0"), "is '0'; expected a number other than 0"),
        (
            simple().replace("<mechanicalReduction>50</mechanicalReduction>", ""),
            "<mechanicalReduction> of actuator 'm' is missing",
        ),
        (simple().replace("0.5", "zero"), r":6: .*<offset> of joint 'j' is 'zero'; expected a number$"),
        (simple(interface="lab/Tea"), r":6: .*<hardwareInterface> of joint 'j' is 'lab/Tea'; allowed: .*Velocity"),
        (simple().replace(f"<hardwareInterface>{POSITION}</hardwareInterface>", ""), "is missing; give one of"),
        (simple() + simple("u", "j", "n"), r":9: transmission 'u': joint 'j' is also named by another transmission"),
        (simple() + simple("t", "k", "m"), "transmission 't' is also named.*actuator 'm' is also named"),
        (
            pair("DifferentialTransmission", ("joint1", "joint1", "actuator1", "actuator2")),
            r"the roles of its <joint> are 'joint1', 'joint1'; "
            r"expected <role>joint1</role> in one and <role>joint2</role>",
        ),
        (pair("FourBarLinkageTransmission", ("joint1", "joint2", "", "actuator2")), "<actuator> are '', 'actuator2'"),
        (pair("DifferentialTransmission").replace(">PositionJoint", ">EffortJoint"), "different hardware interfaces"),
        (
            simple().replace("50", "x") + pair("DifferentialTransmission").replace(">2<", ">0<"),
            "actuator 'm' is 'x'.*joint 'pitch' is '0'",
        ),
    ],
)
def test_a_fault_of_a_transmission_is_reported_with_its_line_and_what_is_allowed(text: str, fault: str) -> None:
    with pytest.raises(TransmissionError, match=fault):
        read_transmissions(robot(text))


def test_a_description_with_a_doctype_is_refused_before_its_entities_are_read() -> None:
    bomb = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>\n<robot>&b;</robot>'
    with pytest.raises(ParameterError, match="robot_description:1: got a DOCTYPE"):
        parse_description(bomb)
    with pytest.raises(ParameterError, match="DOCTYPE"):
        limits_from_urdf(bomb)
    with pytest.raises(ParameterError, match="not well-formed XML"):
        parse_description("<robot>")


def test_limits_are_found_in_a_description_with_a_default_namespace() -> None:
    limits = limits_from_urdf(
        '<robot name="r" xmlns="http://www.ros.org"><joint name="a" type="revolute">'
        '<limit lower="-1" upper="2" velocity="3" effort="4"/></joint></robot>'
    )
    assert (limits["a"].min_position, limits["a"].max_velocity) == (-1.0, 3.0)


# ---- hardware ----


class Motors(RobotHW):
    """Motors that are at once where they are commanded."""

    names = ["m1", "m2"]

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        self.transmissions = RobotTransmissions(self, root_nh, self.names)
        for motor, position in zip(self.transmissions.actuators.values(), (10.0, 20.0), strict=True):
            motor.position = position
        return True

    def read(self, time_s: float, period_s: float) -> None:
        self.transmissions.propagate_states()

    def write(self, time_s: float, period_s: float) -> None:
        self.transmissions.propagate_commands()
        for motor in self.transmissions.actuators.values():
            if math.isfinite(motor.command_position):
                motor.position = motor.command_position


def test_a_controller_moves_joints_through_their_transmission(make_loop: Callable[..., Any]) -> None:
    loop = make_loop(
        {
            "robot_description": robot(pair("FourBarLinkageTransmission")),
            "c": {"type": "position_controllers/JointGroupPositionController", "joints": ["roll", "pitch"]},
        },
        Motors(),
    )
    motors = loop.robot_hw.transmissions.actuators
    loop.step(3)
    assert (motors["m1"].position, motors["m2"].position) == pytest.approx((10.0, 20.0)), "nothing moves by itself"
    loop.spawn("c")
    loop.controllers["c"].submit([0.25, -0.1])
    loop.step(2)
    assert (motors["m1"].position, motors["m2"].position) == pytest.approx((50.0 * 2.0 * -0.1, -50.0 * (-0.1 + 0.75)))
    state = loop.robot_hw.get(JointStateInterface).get_handle("roll")
    assert state.position == pytest.approx(0.25)


class LateMotors(Motors):
    """Motors whose device is silent in the first cycles; each command that is sent to them is kept."""

    SILENT_CYCLES = 5

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        self.transmissions = RobotTransmissions(self, root_nh, self.names)
        self.device = dict(zip(self.names, (10.0, 20.0), strict=True))
        self.sent: list[float] = []
        self.cycles = 0
        return True

    def read(self, time_s: float, period_s: float) -> None:
        self.cycles += 1
        if self.cycles > self.SILENT_CYCLES:
            for motor in self.transmissions.actuators.values():
                motor.position = self.device[motor.name]
        super().read(time_s, period_s)

    def write(self, time_s: float, period_s: float) -> None:
        self.transmissions.propagate_commands()
        for motor in self.transmissions.actuators.values():
            if math.isfinite(motor.command_position):
                self.sent.append(motor.command_position)
                self.device[motor.name] = motor.command_position


def test_motors_whose_device_answers_late_stay_where_they_stand(make_loop: Callable[..., Any]) -> None:
    loop = make_loop({"robot_description": robot(pair("FourBarLinkageTransmission"))}, LateMotors())
    joints = loop.robot_hw.get(JointStateInterface).handles
    loop.step(LateMotors.SILENT_CYCLES)
    assert all(math.isnan(joint.position) for joint in joints), "nothing is measured yet"
    assert loop.robot_hw.sent == []
    loop.step(20)
    assert loop.robot_hw.sent, "the joints are held once they are measured"
    assert loop.robot_hw.sent == pytest.approx([10.0, 20.0] * (len(loop.robot_hw.sent) // 2))
    assert loop.robot_hw.device == pytest.approx({"m1": 10.0, "m2": 20.0})


def test_each_interface_of_a_joint_has_its_command_of_the_actuator() -> None:
    hardware, text = (
        Motors(),
        simple(actuator="m1").replace(
            "</joint>",
            "<hardwareInterface>VelocityJointInterface</hardwareInterface>"
            "<hardwareInterface>hardware_interface/EffortJointInterface</hardwareInterface></joint>",
        ),
    )
    hardware.names = ["m1"]
    states = JointStateInterface()
    states.register_handle(JointStateHandle("other"))
    hardware.register_interface(states)
    transmissions = RobotTransmissions(hardware, MappingNodeHandle({"robot_description": robot(text)}), ["m1"])
    motor = transmissions.actuators["m1"]
    motor.position, motor.velocity, motor.effort = 100.0, 25.0, 0.2
    transmissions.propagate_commands()
    assert math.isnan(motor.command_position), "nothing is commanded before it is known where the joints are"
    transmissions.propagate_states()
    hardware.seed_commands()
    joint = states.get_handle("j")
    assert (joint.position, joint.velocity, joint.effort) == pytest.approx((2.5, 0.5, 10.0))
    hardware.get(VelocityJointInterface).get_handle("j").command = 1.0
    hardware.get(EffortJointInterface).get_handle("j").command = 5.0
    transmissions.propagate_commands()
    assert (motor.command_position, motor.command_velocity, motor.command_effort) == pytest.approx((100.0, 50.0, 0.1))
    assert states.names == ["other", "j"]


@pytest.mark.parametrize(
    ("actuators", "description", "fault"),
    [
        (
            ["m1"],
            robot(pair("DifferentialTransmission")),
            r":3: transmission 'wrist': unknown actuator 'm2'; this hardware has: m1",
        ),
        (["m", "spare"], robot(simple()), "actuator 'spare' has no <transmission>; actuators with a transmission: m$"),
        (["m"], None, "robot_description is not set"),
    ],
)
def test_actuators_and_description_must_fit_together(actuators: list[str], description: str | None, fault: str) -> None:
    parameters = {} if description is None else {"robot_description": description}
    with pytest.raises((TransmissionError, ParameterError), match=fault):
        RobotTransmissions(RobotHW(), MappingNodeHandle(parameters), actuators)


def test_transmissions_of_other_hardware_are_left_to_it() -> None:
    hardware = RobotHW()
    RobotTransmissions(
        hardware, MappingNodeHandle({"robot_description": robot(simple(), pair("DifferentialTransmission"))}), ["m"]
    )
    assert hardware.get(PositionJointInterface).names == ["j"]
