# SPDX-License-Identifier: BSD-3-Clause
"""Two pieces of hardware combined behave as one robot, and each gets only the requests for its own joints."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import pytest

from modular_framework_control.hardware_interface.combined_robot_hw import CombinedRobotHW
from modular_framework_control.hardware_interface.handles import JointHandle, JointStateHandle
from modular_framework_control.hardware_interface.interfaces import (
    ControllerInfo,
    InterfaceResources,
    JointStateInterface,
    PositionJointInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw import RobotHW, SwitchState
from modular_framework_ros.node_handle import MappingNodeHandle, NodeHandle

MOCK = "modular_framework_control/MockRobotHW"
PARAMETERS: dict[str, Any] = {
    "robot_hardware": ["arm", "gripper"],
    "arm": {"type": MOCK, "joints": ["shoulder", "elbow"], "initial_positions": {"shoulder": 0.5}},
    "gripper": {"type": MOCK, "joints": ["finger"]},
    "joint_limits": {
        name: {
            "has_position_limits": True,
            "min_position": -1.0,
            "max_position": 1.0,
            "has_velocity_limits": True,
            "max_velocity": 2.0,
        }
        for name in ("shoulder", "elbow", "finger")
    },
}


def combined(parameters: dict[str, Any] = PARAMETERS, make: Callable[[str], RobotHW] | None = None) -> CombinedRobotHW:
    robot_hw = CombinedRobotHW(make or (lambda name: {MOCK: MockRobotHW}[name]()))
    root = MappingNodeHandle(parameters)
    assert robot_hw.init(root, root)
    return robot_hw


class Recorder(RobotHW):
    """Hardware with given interfaces and joints; records its calls and returns the given answers."""

    def __init__(self, interface_class: type[Any] = PositionJointInterface, joints: Sequence[str] = ("j",)) -> None:
        super().__init__()
        self.asked: list[Any] = []
        self.prepared = True
        self.result = SwitchState.DONE
        states, commands = JointStateInterface(), interface_class()
        for joint in joints:
            commands.register_handle(JointHandle(states.register_handle(JointStateHandle(joint))))
        self.register_interface(states)
        self.register_interface(commands)

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        self.namespaces = (root_nh.namespace, robot_hw_nh.namespace)
        return True

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> bool:
        self.asked.append(("prepare", start, stop))
        return self.prepared

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        self.asked.append(("do", start, stop))

    def switch_result(self, controller: ControllerInfo | None = None) -> SwitchState:
        return self.result


def two(one: Recorder, other: Recorder) -> CombinedRobotHW:
    made = {"lab/One": one, "lab/Other": other}
    return combined(
        {"robot_hardware": ["one", "other"], "one": {"type": "lab/One"}, "other": {"type": "lab/Other"}},
        made.__getitem__,
    )


def info(name: str, **claims: Sequence[str]) -> ControllerInfo:
    return ControllerInfo(
        name,
        "some/Type",
        tuple(
            InterfaceResources(f"hardware_interface/{kind}JointInterface", tuple(names))
            for kind, names in claims.items()
        ),
    )


def test_each_part_gets_the_root_and_its_own_namespace() -> None:
    one, other = Recorder(joints=["a"]), Recorder(joints=["b"])
    two(one, other)
    assert (one.namespaces, other.namespaces) == (("/", "/one"), ("/", "/other"))


def test_one_joint_may_be_in_different_interfaces_of_two_parts() -> None:
    one, other = Recorder(PositionJointInterface), Recorder(VelocityJointInterface)
    robot_hw = two(one, other)
    assert robot_hw.get(PositionJointInterface).get_handle("j") is one.get(PositionJointInterface).get_handle("j")
    assert robot_hw.get(VelocityJointInterface).get_handle("j") is other.get(VelocityJointInterface).get_handle("j")
    assert robot_hw.check_for_conflict([info("p", Position=["j"])]) == ""


def test_a_joint_measured_by_two_parts_is_that_of_the_later_with_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    one, other = Recorder(PositionJointInterface), Recorder(VelocityJointInterface)
    robot_hw = two(one, other)
    assert robot_hw.get(JointStateInterface).get_handle("j") is other.get(JointStateInterface).get_handle("j")
    assert "joint 'j' is in hardware 'one' and in 'other'; the latter is used" in caplog.text


def test_a_switch_notifies_each_part_of_its_own_joints_only() -> None:
    one, other = Recorder(joints=["a", "b"]), Recorder(joints=["c"])
    robot_hw = two(one, other)
    both, mine = info("both", Position=["a", "c"]), info("mine", Position=["b"])
    for ask in (robot_hw.prepare_switch, robot_hw.do_switch):
        ask([both], [mine])
    assert one.asked == [(what, [info("both", Position=["a"])], [mine]) for what in ("prepare", "do")]
    assert other.asked == [(what, [info("both", Position=["c"])], []) for what in ("prepare", "do")]


def test_a_part_that_is_not_concerned_is_not_asked() -> None:
    one, other = Recorder(joints=["a"]), Recorder(joints=["b"])
    robot_hw = two(one, other)
    assert robot_hw.prepare_switch([info("a_only", Position=["a"]), info("states")], [])
    assert len(one.asked) == 1 and other.asked == []


def test_one_part_that_refuses_refuses_the_switch_and_is_named(caplog: pytest.LogCaptureFixture) -> None:
    one, other = Recorder(joints=["a"]), Recorder(joints=["b"])
    robot_hw = two(one, other)
    other.prepared = False
    assert robot_hw.prepare_switch([info("c", Position=["a", "b"])], []) is False
    assert "hardware 'other' refused" in caplog.text


def test_a_switch_is_done_when_every_part_is(caplog: pytest.LogCaptureFixture) -> None:
    one, other = Recorder(joints=["a"]), Recorder(joints=["b"])
    robot_hw = two(one, other)
    for results, expected in (
        ((SwitchState.DONE, SwitchState.DONE), SwitchState.DONE),
        ((SwitchState.DONE, SwitchState.ONGOING), SwitchState.ONGOING),
        ((SwitchState.ERROR, SwitchState.ONGOING), SwitchState.ERROR),
    ):
        one.result, other.result = results
        assert robot_hw.switch_result() is expected
        assert robot_hw.switch_result(info("c", Position=["a", "b"])) is expected
    assert robot_hw.switch_result(info("b_only", Position=["b"])) is SwitchState.ONGOING


def test_a_conflict_names_the_part() -> None:
    robot_hw = combined()
    text = robot_hw.check_for_conflict([info("one", Position=["finger"]), info("other", Position=["finger"])])
    assert text.startswith("gripper: joint 'finger' is claimed by 'one' and by 'other'; stop one of them")


def test_two_controllers_may_not_command_one_joint_through_two_parts() -> None:
    robot_hw = two(Recorder(PositionJointInterface, ["j", "k"]), Recorder(VelocityJointInterface, ["j"]))
    by_position, by_velocity = info("p", Position=["k", "j"]), info("v", Velocity=["j"])
    for controllers in ([by_position, by_velocity], [by_velocity, by_position]):
        text = robot_hw.check_for_conflict(controllers)
        assert "joint 'j' is claimed by" in text and "'p'" in text and "'v'" in text and "'k'" not in text
    assert robot_hw.check_for_conflict([info("p", Position=["k"]), by_velocity]) == ""
    assert (
        "joint 'j' is claimed by 'both' through hardware_interface/PositionJointInterface and through "
        "hardware_interface/VelocityJointInterface"
        in robot_hw.check_for_conflict([info("both", Position=["j"], Velocity=["j"])])
    )


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({}, ["parameter '/robot_hardware' is not set; allowed: a list"]),
        ({"robot_hardware": "arm"}, ["parameter '/robot_hardware' is 'arm'; allowed: a list"]),
        ({"robot_hardware": []}, ["is []; allowed: a list that is not empty"]),
        (
            {"robot_hardware": ["a", "a"]},
            ["each a text and listed once"],
        ),
        ({"robot_hardware": ["a"]}, ["entry 'a' of robot_hardware", "parameter /a/type is None"]),
        (
            {"robot_hardware": ["a"], "a": {"type": "no/Such"}},
            ["entry 'a' of robot_hardware: type 'no/Such'", "known: modular_framework_control/CombinedRobotHW, "],
        ),
        ({"robot_hardware": ["a"], "a": {"type": MOCK}}, ["entry 'a' of robot_hardware", "did not initialise"]),
        (
            {"robot_hardware": ["a"], "a": {"type": MOCK, "joints": ["x"]}, "robot_description": "<robot"},
            ["did not init"],
        ),
        (
            {"robot_hardware": ["a", "b"], "a": {"type": MOCK, "joints": ["x"]}, "b": {"type": MOCK, "joints": ["x"]}},
            ["joint 'x' is in hardware 'a' and in 'b'; only one part may command it"],
        ),
    ],
)
def test_a_faulty_list_is_refused_with_the_entry_the_type_and_what_is_known(
    parameters: dict[str, Any], words: list[str], caplog: pytest.LogCaptureFixture
) -> None:
    root = MappingNodeHandle(parameters)
    assert CombinedRobotHW().init(root, root) is False
    assert all(word in caplog.text for word in words), caplog.text


def test_hardware_that_raises_is_refused_with_what_it_raised(caplog: pytest.LogCaptureFixture) -> None:
    def make(type_name: str) -> RobotHW:
        raise OSError("no such port")

    root = MappingNodeHandle(PARAMETERS)
    assert CombinedRobotHW(make).init(root, root) is False
    assert (
        "entry 'arm' of robot_hardware: type 'modular_framework_control/MockRobotHW' raised OSError: no such port"
        in caplog.text
    )


def test_controllers_of_both_parts_run_on_it(make_loop: Callable[..., Any]) -> None:
    parameters = {
        **PARAMETERS,
        "hw": PARAMETERS | {},
        "all": {"type": "position_controllers/JointTrajectoryController", "joints": ["shoulder", "finger"]},
    }
    loop = make_loop(parameters, CombinedRobotHW())
    loop.spawn("all")
    assert loop.states() == {"all": "running"}
