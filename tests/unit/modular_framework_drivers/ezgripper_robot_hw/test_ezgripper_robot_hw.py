# SPDX-License-Identifier: BSD-3-Clause
"""Controllers drive the gripper through its hardware interface, with the emulated servos behind it."""

from __future__ import annotations

import logging
import math
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from modular_framework_control.controller_interface.controller import Controller
from modular_framework_control.controller_manager.controller_manager import ControllerManager
from modular_framework_control.controllers.gripper_action_controller import GripperGoalHandle
from modular_framework_control.hardware_interface.combined_robot_hw import CombinedRobotHW
from modular_framework_control.hardware_interface.interfaces import PositionJointInterface
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_control.realtime.goal_handle import GoalStatus
from modular_framework_control.trajectory.joint_trajectory import JointTrajectory, TrajectoryPoint
from modular_framework_control.trajectory.trajectory_goal import TrajectoryGoal, TrajectoryGoalHandle
from modular_framework_drivers.ezgripper.ezgripper_device import EzGripper
from modular_framework_drivers.ezgripper.ezgripper_robot_hw import EzGripperRobotHW
from modular_framework_ros.node_handle import MappingNodeHandle
from modular_framework_testing.emulators.dynamixel_finger import Finger, FingerModel
from modular_framework_testing.emulators.dynamixel_line import DynamixelLine
from modular_framework_testing.emulators.dynamixel_servo import DynamixelServo

JOINT = "ezgripper_knuckle_palm_L1_1"

PERIOD_S = 0.008
CONTROLLER = {
    "type": "position_controllers/GripperActionController",
    "joint": JOINT,
    "goal_tolerance": 0.03,
    "max_effort": 0.5,
    "stall_timeout": 0.3,
    "stall_velocity_threshold": 0.02,
}
TRAJECTORY_CONTROLLER = {
    "type": "position_controllers/JointTrajectoryController",
    "joints": [JOINT],
    "constraints": {"goal_time": 5.0, JOINT: {"trajectory": 0.45, "goal": 0.03}},
}


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DynamixelLine]:
    finger = Finger(DynamixelServo(), FingerModel(top_speed=12000.0, time_constant_s=0.015), opening=200.0)
    made = DynamixelLine([finger], tmp_path_factory.mktemp("line") / "gripper")
    made.connect()
    yield made
    made.close()


class Loop:
    """A control loop in real time."""

    def __init__(self, robot_hw: RobotHW, root: MappingNodeHandle) -> None:
        self.robot_hw = robot_hw
        self.controllers: dict[str, Controller] = {}
        self.manager = ControllerManager(robot_hw, root, None, attach=self._attach)

    def _attach(self, name: str, controller: Controller) -> Callable[[], None]:
        self.controllers[name] = controller
        return lambda: None

    def run(self, until: Callable[[], bool], timeout_s: float = 5.0) -> float:
        """Runs until something is so; returns how long that took [s]."""
        start_s = time.monotonic()
        while not until():
            now_s = time.monotonic()
            assert now_s - start_s < timeout_s, f"in vain for {timeout_s} s"
            self.robot_hw.read(now_s, PERIOD_S)
            self.manager.update(now_s, PERIOD_S)
            self.robot_hw.write(now_s, PERIOD_S)
            time.sleep(PERIOD_S)
        return time.monotonic() - start_s

    def spawn(self, name: str) -> Any:
        self.manager.load_controller(name)
        self.switch([name], [])
        return self.controllers[name]

    def switch(self, start: list[str], stop: list[str]) -> None:
        thread = Thread(target=self.manager.switch_controller, args=(start, stop))
        thread.start()
        self.run(lambda: not thread.is_alive())


def parameters(line: DynamixelLine) -> dict[str, Any]:
    gripper = {
        "type": "modular_framework_drivers/EzGripperRobotHW",
        "start_position": 1.5,
        "hold_torque": 300,
        "link_timeout": 0.8,
    }
    return {
        "port_name": str(line.link),
        "baudrate": 57600,
        "servo_ids": [1],
        "manipulator_name": "EzGripper",
        "hand": gripper,
        "grip": CONTROLLER,
        "swing": TRAJECTORY_CONTROLLER,
    }


@pytest.fixture(scope="module")
def loop(line: DynamixelLine) -> Iterator[Loop]:
    root = MappingNodeHandle(parameters(line))
    robot_hw = EzGripperRobotHW()
    assert robot_hw.init(root, root.child("hand"))
    made = Loop(robot_hw, root)
    made.run(lambda: robot_hw.initialised, 15.0)
    made.spawn("grip")
    yield made
    robot_hw.close()


def go(loop: Loop, position: float, max_effort: float = 0.0) -> GripperGoalHandle:
    goal_handle: GripperGoalHandle = GripperGoalHandle()
    loop.controllers["grip"].submit(position, max_effort, goal_handle)
    loop.run(lambda: not goal_handle.open)
    return goal_handle


def test_the_gripper_controller_moves_it(line: DynamixelLine, loop: Loop) -> None:
    line.remove_object()
    assert go(loop, 0.9).status is GoalStatus.SUCCEEDED
    assert line.fingers[0].opening == pytest.approx(2500 * (1 - 0.9 / 1.94), abs=60)


def test_an_object_stalls_it_and_is_held_with_the_effort_asked_for(line: DynamixelLine, loop: Loop) -> None:
    line.remove_object()
    go(loop, 0.9)
    line.place_object(1.24)
    goal_handle = go(loop, 1.9, max_effort=0.25)
    assert goal_handle.status is GoalStatus.ABORTED
    assert goal_handle.result is not None
    assert goal_handle.result.stalled
    handle = loop.robot_hw.get(PositionJointInterface).get_handle(JOINT)
    loop.run(lambda: handle.effort == pytest.approx(0.25, abs=0.01))
    assert go(loop, 0.9).status is GoalStatus.SUCCEEDED


def test_what_is_held_stays_held_when_the_goal_is_over_and_when_the_cable_was_out(
    line: DynamixelLine, loop: Loop
) -> None:
    line.remove_object()
    go(loop, 0.9)
    line.place_object(1.24)
    go(loop, 1.9, max_effort=0.25)
    handle = loop.robot_hw.get(PositionJointInterface).get_handle(JOINT)
    line.unplug()
    loop.run(lambda: bool(loop.robot_hw.fault()))
    line.plug()
    loop.run(lambda: not loop.robot_hw.fault())
    end_s = time.monotonic() + 0.5
    loop.run(lambda: time.monotonic() > end_s)
    assert handle.effort > 0.2
    assert handle.position == pytest.approx(1.24, abs=0.05)


def test_a_trajectory_controller_moves_it_along_a_curve(line: DynamixelLine, loop: Loop) -> None:
    line.remove_object()
    assert go(loop, 1.5).status is GoalStatus.SUCCEEDED
    handle = loop.robot_hw.get(PositionJointInterface).get_handle(JOINT)
    # the goal succeeds when the fingers pass the goal; without the object, fast fingers may overshoot
    loop.run(lambda: abs(handle.position - 1.5) < 0.03 and abs(handle.velocity) < 0.02)
    if "swing" not in loop.controllers:
        loop.manager.load_controller("swing")
    loop.switch(["swing"], ["grip"])
    goal_handle: TrajectoryGoalHandle = TrajectoryGoalHandle()
    points = (TrajectoryPoint(0.5, (1.2,)), TrajectoryPoint(1.0, (1.7,)))
    loop.controllers["swing"].submit(TrajectoryGoal(JointTrajectory.of_points((JOINT,), points)), goal_handle)
    loop.run(lambda: not goal_handle.open, 10.0)
    loop.switch(["grip"], ["swing"])
    assert goal_handle.status is GoalStatus.SUCCEEDED, goal_handle.text
    assert line.fingers[0].opening == pytest.approx(2500 * (1 - 1.7 / 1.94), abs=60)


def test_a_lost_link_ends_the_goal_with_the_reason_and_nothing_moves_when_it_is_back(
    line: DynamixelLine, loop: Loop
) -> None:
    line.remove_object()
    go(loop, 0.9)
    goal_handle: GripperGoalHandle = GripperGoalHandle()
    loop.controllers["grip"].submit(1.9, 0.1, goal_handle)
    loop.run(lambda: goal_handle.status is GoalStatus.ACTIVE)
    line.unplug()
    loop.run(lambda: not goal_handle.open, 2.0)
    assert goal_handle.status is GoalStatus.ABORTED
    assert "EzGripper: port" in goal_handle.text
    assert "EzGripper: port" in loop.robot_hw.fault()
    line.plug()
    loop.run(lambda: not loop.robot_hw.fault())
    assert go(loop, 0.9).status is GoalStatus.SUCCEEDED


@pytest.mark.parametrize("fault", ["power_off", "lose", "corrupt"])
@pytest.mark.parametrize("name", ["grip", "swing"])
def test_fingers_of_which_nothing_is_heard_hold_nothing(line: DynamixelLine, loop: Loop, fault: str, name: str) -> None:
    """The controllers would find a stall, or a violated tolerance, before the line counts as lost."""
    line.remove_object()
    go(loop, 0.9)
    goal_handle: Any
    if name == "grip":
        goal_handle = GripperGoalHandle()
        loop.controllers[name].submit(1.9, 0.1, goal_handle)
    else:
        if name not in loop.controllers:
            loop.manager.load_controller(name)
        loop.switch([name], ["grip"])
        goal_handle = TrajectoryGoalHandle()
        points = (TrajectoryPoint(1.2, (1.9,)),)
        loop.controllers[name].submit(TrajectoryGoal(JointTrajectory.of_points((JOINT,), points)), goal_handle)
    handle = loop.robot_hw.get(PositionJointInterface).get_handle(JOINT)
    loop.run(lambda: handle.position > 1.1)
    line.commands[fault]()
    try:
        loop.run(lambda: not goal_handle.open)
    finally:
        line.power_on()
        line.clear()
        loop.run(lambda: not loop.robot_hw.fault())
        if name != "grip":
            loop.switch(["grip"], [name])
    assert goal_handle.status is GoalStatus.ABORTED
    assert goal_handle.text.startswith("hardware fault: EzGripper: servo 1 on"), goal_handle.text
    if name == "grip":
        assert not goal_handle.result.stalled


def test_an_overload_is_no_grasp(line: DynamixelLine, loop: Loop) -> None:
    line.remove_object()
    go(loop, 0.9)
    line.place_object(1.24)
    goal_handle: GripperGoalHandle = GripperGoalHandle()
    loop.controllers["grip"].submit(1.9, 0.5, goal_handle)
    loop.run(lambda: goal_handle.status is GoalStatus.ACTIVE)
    line.overload()
    loop.run(lambda: not goal_handle.open)
    assert goal_handle.status is GoalStatus.ABORTED
    assert "overloaded" in goal_handle.text
    loop.run(lambda: not loop.robot_hw.fault())
    line.remove_object()


def test_beside_other_hardware_only_its_own_controllers_hear_of_its_faults(
    make_line: Callable[..., DynamixelLine],
) -> None:
    line = make_line(opening=200.0)
    root = MappingNodeHandle(
        {
            **parameters(line),
            "robot_hardware": ["arm", "hand"],
            "elbow_controller": {"type": "position_controllers/JointPositionController", "joint": "elbow"},
            "arm": {"type": "modular_framework_control/MockRobotHW", "joints": ["elbow"]},
        }
    )
    robot_hw = CombinedRobotHW()
    assert robot_hw.init(root, root)
    loop = Loop(robot_hw, root)
    loop.run(lambda: robot_hw.initialised, 15.0)
    loop.spawn("grip")
    loop.spawn("elbow_controller")
    assert go(loop, 1.2).status is GoalStatus.SUCCEEDED
    line.unplug()
    took_s = loop.run(lambda: bool(robot_hw.faults()))
    assert took_s < 2.0
    assert [fault.joints for fault in robot_hw.faults()] == [frozenset({JOINT})]
    robot_hw.close()


def test_a_gripper_that_is_not_there_is_a_fault_at_once_and_is_waited_for(
    make_line: Callable[..., DynamixelLine], tmp_path: Path
) -> None:
    root = MappingNodeHandle({"hand": {"port_name": str(tmp_path / "gripper0"), "start_position": 1.5}})
    robot_hw = EzGripperRobotHW()
    assert robot_hw.init(root, root.child("hand"))
    loop = Loop(robot_hw, root)
    loop.run(lambda: "gripper0 cannot be opened: No such file" in robot_hw.fault())
    handle = robot_hw.get(PositionJointInterface).get_handle(JOINT)
    assert not robot_hw.initialised and math.isnan(handle.position)
    make_line(opening=200.0)
    loop.run(lambda: robot_hw.initialised, 15.0)
    assert handle.position == pytest.approx(1.5, abs=0.05)
    robot_hw.close()


def test_wrong_parameters_are_an_error_that_says_so(caplog: pytest.LogCaptureFixture) -> None:
    root = MappingNodeHandle({"hand": {"baudrate": 1}})
    with caplog.at_level(logging.ERROR):
        assert not EzGripperRobotHW().init(root, root.child("hand"))
    assert "parameter '/port_name' is not set" in caplog.text


class SteadyGripper(EzGripper):
    """A fake device without servos, with given states."""

    def start(self) -> None:
        self.say("")

    def say(self, fault: str) -> None:
        """The fingers move, with or without a fault."""
        reading = replace(self._state.reading, position=1.0, velocity=0.5)
        self._ready = True
        self._publish(reading, time.monotonic(), fault)


@pytest.fixture
def steady(monkeypatch: pytest.MonkeyPatch) -> tuple[EzGripperRobotHW, SteadyGripper]:
    made: list[SteadyGripper] = []
    monkeypatch.setattr(
        "modular_framework_drivers.ezgripper.ezgripper_robot_hw.EzGripper",
        lambda settings: made.append(SteadyGripper(settings)) or made[-1],
    )
    robot_hw = EzGripperRobotHW()
    root = MappingNodeHandle({"hand": {"port_name": "/nowhere"}})
    assert robot_hw.init(root, root.child("hand"))
    return robot_hw, made[0]


def test_fingers_of_which_nothing_is_known_have_no_velocity(steady: tuple[EzGripperRobotHW, SteadyGripper]) -> None:
    robot_hw, gripper = steady
    handle = robot_hw.get(PositionJointInterface).get_handle(JOINT)
    robot_hw.read(0.0, PERIOD_S)
    assert handle.velocity == 0.5
    gripper.say("the cable is out")
    robot_hw.read(0.0, PERIOD_S)
    assert handle.velocity == 0.0


def test_a_fault_that_came_and_went_between_two_reads_is_reported_once_and_ends_what_was_commanded(
    steady: tuple[EzGripperRobotHW, SteadyGripper],
) -> None:
    robot_hw, gripper = steady
    handle = robot_hw.get(PositionJointInterface).get_handle(JOINT)
    handle.command = 1.9
    robot_hw.read(0.0, PERIOD_S)
    assert (robot_hw.fault(), handle.command) == ("", 1.9)
    gripper.say("a blink")
    gripper.say("")
    robot_hw.read(0.0, PERIOD_S)
    assert (robot_hw.fault(), handle.command) == ("a blink", 1.0)
    robot_hw.read(0.0, PERIOD_S)
    assert robot_hw.fault() == ""


@pytest.mark.parametrize(
    ("max_effort", "torque"),
    [
        (0.0, 400),
        (-1.0, 400),
        (math.nan, 400),
        (0.5, 400),
        (1.0, 800),
        (3.0, 800),
        (sys.float_info.max, 800),
        (math.inf, 800),
    ],
)
def test_whatever_effort_is_allowed_becomes_a_torque_the_servo_knows(
    line: DynamixelLine, monkeypatch: pytest.MonkeyPatch, max_effort: float, torque: int
) -> None:
    robot_hw = EzGripperRobotHW()
    root = MappingNodeHandle({"hand": {"port_name": str(line.link)}})
    state = EzGripper.state
    monkeypatch.setattr(EzGripper, "state", lambda gripper: replace(state(gripper), ready=True))
    monkeypatch.setattr(EzGripper, "start", lambda _: None)
    asked: list[int] = []
    monkeypatch.setattr(EzGripper, "command", lambda _, position, torque: asked.append(torque))
    assert robot_hw.init(root, root.child("hand"))
    robot_hw.get(PositionJointInterface).handles[0].max_effort = max_effort
    robot_hw.write(0.0, PERIOD_S)
    assert asked == [torque]
