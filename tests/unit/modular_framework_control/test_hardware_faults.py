# SPDX-License-Identifier: BSD-3-Clause
"""Hardware faults: the controllers of its joints are notified once, and again when the hardware recovers."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from modular_framework_control.controller_interface.controller import Controller
from modular_framework_control.controller_manager.controller_types import ControllerTypes
from modular_framework_control.hardware_interface.combined_robot_hw import CombinedRobotHW
from modular_framework_control.hardware_interface.handles import ForceTorqueSensorHandle, SpeedScalingHandle
from modular_framework_control.hardware_interface.interfaces import (
    ForceTorqueSensorInterface,
    PositionJointInterface,
    SpeedScalingInterface,
)
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.hardware_interface.robot_hw import RobotHW, speed_scaling_handles
from modular_framework_ros.node_handle import NodeHandle, read_names

LAB = "lab/Fragile"
PARAMETERS: dict[str, Any] = {
    "hw": {
        "robot_hardware": ["arm", "gripper"],
        "arm": {"type": LAB, "joints": ["shoulder", "elbow"]},
        "gripper": {"type": LAB, "joints": ["finger"]},
    },
    "arm_controller": {"type": "lab/Listener", "joint": ["shoulder", "elbow"]},
    "gripper_controller": {"type": "lab/Listener", "joint": "finger"},
    "joint_states": {"type": "joint_state_controller/JointStateController"},
}


class Fragile(MockRobotHW):
    """Hardware whose fault is set by the test; `raises` names the method that raises."""

    text = ""
    raises = ""
    closed = 0

    def read(self, time_s: float, period_s: float) -> None:
        if self.raises == "read":
            raise OSError("cable unplugged")
        super().read(time_s, period_s)

    def write(self, time_s: float, period_s: float) -> None:
        if self.raises == "write":
            raise OSError("cable unplugged")
        super().write(time_s, period_s)

    def fault(self) -> str:
        if self.raises == "fault":
            raise OSError("cable unplugged")
        return self.text

    def close(self) -> None:
        self.closed += 1
        if self.raises == "close":
            raise OSError("cable unplugged")


class Listener(Controller):
    """Records its notifications."""

    interface_class = PositionJointInterface

    def __init__(self) -> None:
        self.heard: list[str] = []
        self.updates = 0
        self.raises = False

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        for name in read_names(controller_nh, "joint"):
            hw.get_handle(name)
        return True

    def update(self, time_s: float, period_s: float) -> None:
        self.updates += 1
        self.heard.append("") if not self.heard else None

    def on_hardware_fault(self, time_s: float, reason: str) -> None:
        self.heard.append(reason)
        if self.raises:
            raise RuntimeError("cannot bear it")

    def on_hardware_recovered(self, time_s: float) -> None:
        self.heard.append("recovered")


@pytest.fixture
def loop(make_loop: Callable[..., Any]) -> Any:
    types = ControllerTypes()
    types.register("lab/Listener", Listener)
    made = make_loop(PARAMETERS, CombinedRobotHW(lambda name: {LAB: Fragile}[name]()), types)
    made.arm, made.gripper = (part.hardware for part in made.robot_hw.parts)
    made.spawn("arm_controller", "joint_states")
    made.manager.load_controller("gripper_controller")
    made.switch(["gripper_controller"], [])
    made.step()
    return made


def heard(loop: Any, name: str) -> list[str]:
    return [text for text in loop.controllers[name].heard if text]


def test_a_fault_is_reported_in_the_next_cycle_once_to_the_controllers_of_that_hardware(loop: Any) -> None:
    loop.arm.text = "protective stop"
    updates = loop.controllers["arm_controller"].updates
    loop.step()
    assert heard(loop, "arm_controller") == ["hardware 'arm': protective stop"]
    loop.step(5)
    assert heard(loop, "arm_controller") == ["hardware 'arm': protective stop"]
    assert heard(loop, "gripper_controller") == []
    assert loop.controllers["arm_controller"].updates == updates + 6, "it goes on being updated"
    assert set(loop.states().values()) == {"running"}


def test_another_fault_and_the_recovery_are_reported(loop: Any, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level("INFO")
    for loop.arm.text in ("protective stop", "link lost", ""):
        loop.step(2)
    assert heard(loop, "arm_controller") == [
        "hardware 'arm': protective stop",
        "hardware 'arm': link lost",
        "recovered",
    ]
    assert caplog.text.count("hardware fault: hardware 'arm': protective stop") == 1
    assert caplog.text.count("the hardware has recovered (from: hardware 'arm': link lost)") == 1


def test_a_controller_started_during_a_fault_is_notified_before_its_first_update(loop: Any) -> None:
    loop.switch([], ["gripper_controller"])
    loop.gripper.text = "overload"
    listener = loop.controllers["gripper_controller"]
    listener.heard.clear()
    loop.switch(["gripper_controller"], [])
    loop.step(2)
    assert listener.heard == ["hardware 'gripper': overload"]


def test_a_controller_that_raises_when_notified_is_stopped_and_the_others_go_on(loop: Any) -> None:
    loop.controllers["arm_controller"].raises = True
    loop.arm.text = "protective stop"
    loop.step(2)
    assert loop.states() == {"arm_controller": "stopped", "joint_states": "running", "gripper_controller": "running"}
    report = loop.manager.list_controllers()[0]
    assert report.failure == "on_hardware_fault() raised RuntimeError: cannot bear it"


@pytest.mark.parametrize("method", ["read", "write"])
def test_a_part_that_raises_is_a_fault_of_that_part_until_it_no_longer_does(loop: Any, method: str) -> None:
    loop.arm.raises = method
    loop.step(3)
    assert heard(loop, "arm_controller")[0] == f"hardware 'arm': {method}() raised OSError: cable unplugged"
    assert heard(loop, "gripper_controller") == []
    loop.arm.raises = ""
    loop.step(3)
    assert heard(loop, "arm_controller")[-1] == "recovered"


def test_hardware_whose_faults_cannot_be_read_has_a_fault_of_all_joints(loop: Any) -> None:
    loop.gripper.raises = "fault"
    loop.step()
    for name in ("arm_controller", "gripper_controller"):
        assert heard(loop, name) == ["fault() raised OSError: cable unplugged"]
    assert set(loop.states().values()) == {"running"}


def test_every_part_is_closed_though_one_raises(loop: Any, caplog: pytest.LogCaptureFixture) -> None:
    loop.gripper.raises = "close"
    loop.robot_hw.close()
    assert (loop.arm.closed, loop.gripper.closed) == (1, 1)
    assert "hardware 'gripper': close() raised OSError" in caplog.text


def test_the_fault_of_a_combination_is_that_of_its_parts(loop: Any) -> None:
    assert loop.robot_hw.fault() == ""
    loop.arm.text, loop.gripper.text = "link lost", "too hot"
    assert loop.robot_hw.fault() == "hardware 'arm': link lost; hardware 'gripper': too hot"


def test_single_hardware_reports_all_its_commanded_joints() -> None:
    robot_hw = Fragile()
    assert list(robot_hw.faults()) == []
    robot_hw.text = "off"
    assert [(fault.reason, fault.joints) for fault in robot_hw.faults()] == [("off", frozenset())]


def test_a_controller_finds_further_interfaces_and_its_claims_on_all_of_them_are_listed(
    make_loop: Callable[..., Any],
) -> None:
    class Rich(MockRobotHW):
        def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
            scaling, sensors = SpeedScalingInterface(), ForceTorqueSensorInterface()
            scaling.register_handle(SpeedScalingHandle("speed_scaling_factor", ["shoulder", "elbow"], 0.5))
            sensors.register_handle(ForceTorqueSensorHandle("wrench", "tool0"))
            self.register_interface(scaling)
            self.register_interface(sensors)
            return super().init(root_nh, robot_hw_nh)

    class Curious(Listener):
        interface_class = ForceTorqueSensorInterface  # type: ignore[assignment]

        def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
            self.sensor = hw.get_handle("wrench")
            self.joint = self.robot_hw.get(PositionJointInterface).get_handle("elbow")
            self.factors = [handle.factor for handle in speed_scaling_handles(self.robot_hw, ["elbow"])]
            return True

    types = ControllerTypes()
    types.register("lab/Curious", Curious)
    loop = make_loop({"hw": {"joints": ["shoulder", "elbow"]}, "c": {"type": "lab/Curious"}}, Rich(), types)
    loop.spawn("c")
    assert loop.controllers["c"].factors == [0.5]
    (report,) = loop.manager.list_controllers()
    assert {claim.hardware_interface: set(claim.resources) for claim in report.info.claimed_resources} == {
        "hardware_interface/ForceTorqueSensorInterface": set(),
        "hardware_interface/PositionJointInterface": {"elbow"},
    }
    assert speed_scaling_handles(loop.robot_hw, ["finger"]) == speed_scaling_handles(RobotHW(), ["elbow"]) == ()
