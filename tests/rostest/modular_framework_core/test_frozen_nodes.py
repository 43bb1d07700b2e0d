# SPDX-License-Identifier: BSD-3-Clause
"""A wait for a frozen node reports the name of the node within ten seconds of real time."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from typing import Any
from xmlrpc.client import ServerProxy

import moveit_commander
import pytest
import rosgraph
import rospy
from moveit_commander import MoveGroupCommander, MoveItCommanderException, PlanningSceneInterface
from sensor_msgs.msg import JointState
from std_srvs.srv import Empty, EmptyRequest

from modular_framework_control.ros.controller_manager_client import (
    ControllerManagerClient,
    ControllerManagerClientError,
)
from modular_framework_core.commander.arm_commander import ArmCommander
from modular_framework_core.srv import ListMessages, ListMessagesRequest
from modular_framework_ros.calls import CallError, request_service
from modular_framework_ros.start_up import wait_for_start
from modular_framework_testing.ros_session import until

NAMED_WITHIN_S = 10.0
START = {
    "shoulder_pan_joint": 1.57,
    "shoulder_lift_joint": -1.57,
    "elbow_joint": 1.57,
    "wrist_1_joint": -1.57,
    "wrist_2_joint": -1.57,
    "wrist_3_joint": 0.0,
}
GOAL = {**START, "shoulder_pan_joint": 0.8}
STARTED_AT_MOST_S = 120.0


@pytest.fixture(scope="module", autouse=True)
def session(ros_session: Any) -> Iterator[Any]:
    for service in ("plan_kinematic_path", "list_grasps", "gazebo/get_world_properties"):
        ros_session.wait_for_service(service, STARTED_AT_MOST_S)
    moveit_commander.roscpp_initialize(["test"])
    yield ros_session
    moveit_commander.roscpp_shutdown()


@pytest.fixture(scope="module")
def commander(session: Any) -> ArmCommander:
    made = ArmCommander("arm")
    made.connect(STARTED_AT_MOST_S)
    made.set_max_velocity_scaling_factor(0.1)
    return made


@pytest.fixture(scope="module")
def arm(commander: ArmCommander) -> MoveGroupCommander:
    made = MoveGroupCommander("arm", wait_for_servers=STARTED_AT_MOST_S)
    made.set_max_velocity_scaling_factor(0.1)
    return made


@pytest.fixture()
def freeze() -> Iterator[Callable[[str], None]]:
    """Stops the process of a node until the test ends."""
    stopped: list[int] = []

    def stop(node: str) -> None:
        stopped.append(int(ServerProxy(rosgraph.Master("/test").lookupNode(node)).getPid("/test")[2]))
        os.kill(stopped[-1], signal.SIGSTOP)

    yield stop
    for pid in stopped:
        os.kill(pid, signal.SIGCONT)


class Wait:
    """A wait for a node in a thread, and the reason for which it failed."""

    def __init__(self, wait: Callable[[], Any]) -> None:
        self._wait, self._said = wait, ""
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self._said = str(self._wait())
        except (CallError, ControllerManagerClientError, MoveItCommanderException) as error:
            self._said = str(error)

    def says(self, node: str) -> None:
        """Checks that the wait ends in time from now on, with the name of the node."""
        self._thread.join(NAMED_WITHIN_S)
        assert not self._thread.is_alive(), f"the wait has not ended after {NAMED_WITHIN_S:g} s"
        assert f"node '{node}' is frozen" in self._said


def pan_joint() -> tuple[float, float]:
    """Position and velocity of the arm's first joint [rad, rad/s]."""
    state = rospy.wait_for_message("joint_states", JointState, 5.0)
    index = state.name.index("shoulder_pan_joint")
    return state.position[index], state.velocity[index]


@pytest.mark.parametrize("client", ["arm commander", "moveit_commander"])
@pytest.mark.parametrize("node", ["/move_group", "/gazebo"])
def test_a_motion_ends_with_the_name_of_the_frozen_node(
    commander: ArmCommander, arm: MoveGroupCommander, freeze: Callable[[str], None], client: str, node: str
) -> None:
    until(lambda: abs(pan_joint()[1]) < 0.005, "the arm at rest: its last motion was cancelled once its node continued")
    far = START if pan_joint()[0] < 1.2 else {**START, "shoulder_pan_joint": 0.8}
    plan = commander.plan_to_joint_value_target(far).trajectory
    motion = Wait(lambda: commander.execute_plan(plan) if client == "arm commander" else arm.execute(plan))
    until(lambda: abs(pan_joint()[1]) > 0.02, "the arm moves")
    freeze(node)
    motion.says(node)


WAITS: dict[str, tuple[str, Callable[[ArmCommander, MoveGroupCommander], Any]]] = {
    "a plan of the arm commander": ("/move_group", lambda commander, arm: commander.plan_to_joint_value_target(START)),
    "a plan of moveit_commander": ("/move_group", lambda commander, arm: arm.plan(list(START.values()))),
    "a service of moveit_commander": ("/move_group", lambda commander, arm: PlanningSceneInterface().get_objects()),
    "an action that connects": ("/move_group", lambda commander, arm: arm.place("nothing")),
    "a service of the managers": (
        "/managers",
        lambda commander, arm: request_service("list_grasps", ListMessages, ListMessagesRequest(), 60.0),
    ),
    "a service of the controllers": ("/gazebo", lambda commander, arm: ControllerManagerClient().list_controllers()),
    "a service of the simulation": (
        "/gazebo",
        lambda commander, arm: request_service("gazebo/pause_physics", Empty, EmptyRequest(), 60.0),
    ),
}


@pytest.mark.parametrize("wait", WAITS)
def test_a_wait_for_an_answer_ends_with_the_name_of_the_frozen_node(
    commander: ArmCommander, arm: MoveGroupCommander, freeze: Callable[[str], None], wait: str
) -> None:
    node, ask = WAITS[wait]
    freeze(node)
    Wait(lambda: ask(commander, arm)).says(node)


def test_a_wait_for_the_start_of_a_frozen_node_reports_the_node(
    freeze: Callable[[str], None], caplog: pytest.LogCaptureFixture
) -> None:
    freeze("/managers")
    found = threading.Event()
    threading.Thread(target=wait_for_start, args=(found.is_set, "a signal of the managers", 60.0), daemon=True).start()
    until(lambda: "node '/managers' is frozen" in caplog.text, "the name in the log", NAMED_WITHIN_S)
    found.set()
