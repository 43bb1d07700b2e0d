# SPDX-License-Identifier: BSD-3-Clause
"""Switching controllers of hardware with slow mode changes, in simulated time: start_asap and timeout."""

from __future__ import annotations

import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rospy
from controller_manager_msgs.srv import ListControllers, SwitchController, SwitchControllerResponse

from modular_framework_control.hardware_interface.robot_hw import SwitchState

sys.path.insert(0, str(Path(__file__).parent))
from stepped_robot import WAIT_S, SteppedRobot  # noqa: E402

PARAMETERS: dict[str, Any] = {
    "robot_hardware": ["quick", "slow"],
    "quick": {"type": "quick", "joints": ["shoulder"]},
    "slow": {"type": "slow", "joints": ["finger"]},
    "arm": {"type": "position_controllers/JointTrajectoryController", "joints": ["shoulder"]},
    "gripper": {"type": "position_controllers/GripperActionController", "joint": "finger"},
}
BOTH = ["arm", "gripper"]


class Switch:
    """A call of switch_controller that is under way."""

    def __init__(self, robot: SteppedRobot, start_asap: bool, timeout_s: float) -> None:
        self._robot = robot
        self._answers: list[SwitchControllerResponse] = []
        self._thread = threading.Thread(target=self._call, args=(start_asap, timeout_s), daemon=True)
        before = robot.hardware["slow"].switches
        self._thread.start()
        robot.wait_until(lambda: robot.hardware["slow"].switches > before)

    def _call(self, *arguments: Any) -> None:
        service = rospy.ServiceProxy("controller_manager/switch_controller", SwitchController)
        self._answers.append(service(BOTH, [], 2, *arguments))

    @property
    def answered(self) -> bool:
        return bool(self._answers)

    def ok(self) -> bool:
        self._robot.wait_for(lambda: self._thread.join(WAIT_S))
        return bool(self._answers[0].ok)


@pytest.fixture(scope="module")
def stepped(ros_session: Any) -> Iterator[SteppedRobot]:
    robot = SteppedRobot(PARAMETERS, BOTH)
    yield robot
    robot.close()


@pytest.fixture
def robot(stepped: SteppedRobot) -> SteppedRobot:
    """Nothing runs, and the gripper will take its time."""
    stepped.hardware["slow"].switching = SwitchState.DONE
    running = [name for name, state in states(stepped).items() if state == "running"]
    switch = rospy.ServiceProxy("controller_manager/switch_controller", SwitchController)
    assert stepped.wait_for(lambda: switch([], running, 2, False, 0.0)).ok
    stepped.hardware["slow"].switching = SwitchState.ONGOING
    return stepped


def states(robot: SteppedRobot) -> dict[str, str]:
    service = rospy.ServiceProxy("controller_manager/list_controllers", ListControllers)
    return {entry.name: entry.state for entry in robot.wait_for(service).controller}


@pytest.mark.parametrize(("start_asap", "meanwhile"), [(True, "running"), (False, "waiting")])
def test_start_asap_starts_what_is_ready_and_without_it_all_start_together(
    robot: SteppedRobot, start_asap: bool, meanwhile: str
) -> None:
    switch = Switch(robot, start_asap, 0.0)
    robot.run(60.0)
    assert states(robot) == {"arm": meanwhile, "gripper": "waiting"}
    assert not switch.answered, "without a timeout it waits as long as the hardware takes"
    robot.hardware["slow"].switching = SwitchState.DONE
    assert switch.ok()
    assert states(robot) == {"arm": "running", "gripper": "running"}


@pytest.mark.parametrize(("start_asap", "arm"), [(True, "running"), (False, "aborted")])
def test_when_the_time_is_up_the_rest_is_not_started_and_the_answer_is_no(
    robot: SteppedRobot, start_asap: bool, arm: str, caplog: pytest.LogCaptureFixture
) -> None:
    switch = Switch(robot, start_asap, 5.0)
    robot.run(4.9)
    assert not switch.answered
    robot.run(0.2)
    assert not switch.ok()
    assert states(robot) == {"arm": arm, "gripper": "aborted"}
    names = "gripper" if start_asap else "arm, gripper"
    assert f"hardware was not ready within 5.0 s to start: {names}" in caplog.text
    robot.hardware["slow"].switching = SwitchState.DONE
    robot.run(1.0)
    assert states(robot) == {"arm": arm, "gripper": "aborted"}, "what was given up must not start later"


def test_hardware_that_cannot_switch_is_reported(robot: SteppedRobot, caplog: pytest.LogCaptureFixture) -> None:
    switch = Switch(robot, True, 5.0)
    robot.hardware["slow"].switching = SwitchState.ERROR
    assert not switch.ok()
    assert states(robot) == {"arm": "running", "gripper": "aborted"}
    assert "hardware refused to switch for 'gripper'" in caplog.text
