# SPDX-License-Identifier: BSD-3-Clause
"""The EZGripper's Grasp action as the framework starts and uses it, on emulated servos with faults on command."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path

import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

from modular_framework_core.grasping.grasp_messages import generate_pose_stamped_message, get_standardised_grasp
from modular_framework_core.msg import GraspAction, GraspCommand, GraspGoal, StandardisedGrasp
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.emulators.command_port import send_command
from modular_framework_testing.ros_session import free_port, until

JOINT = "ezgripper_knuckle_palm_L1_1"
LAUNCH = """<launch>
  <arg name="port"/>
  <arg name="command_port"/>
  <include file="$(find modular_framework_testing)/launch/emulators.launch">
    <arg name="arm" value="false"/>
    <arg name="gripper_port" value="$(arg port)"/>
    <arg name="gripper_command_port" value="$(arg command_port)"/>
  </include>
  <rosparam command="load" file="$(find modular_framework_api)/config/external_manipulator_connection.yaml"/>
  <param name="port_name" value="$(arg port)"/>
  <param name="ezgripper_server/link_timeout" value="0.5"/>
  <rosparam>
    manipulator_controller_action_server_name: ezgripper_grasp
    package_manipulator_action_server: modular_framework_drivers
    manipulator_controller_node_name: ezgripper_server
    manipulator_controller_action_server_type: ezgripper_grasp_action_server
  </rosparam>
  <node name="spawner" pkg="modular_framework_core" type="external_controllers_spawner" output="screen"
        required="true"/>
</launch>"""


class Gripper:
    """The running launch, as a client sees it."""

    def __init__(self, session, command_port: int) -> None:
        self.session, self.command_port = session, command_port
        self.joint_state: JointState | None = None
        rospy.Subscriber("joint_states", JointState, self._on_joint_state, queue_size=1)
        self.client = SteadyActionClient("ezgripper_grasp", GraspAction)
        assert self.client.wait_for_server(rospy.Duration(60)), session.log()
        until(
            lambda: self.joint_state is not None and self.joint_state.position[0] < 0.03,
            "open fingers in the joint states",
            60.0,
        )

    def _on_joint_state(self, message: JointState) -> None:
        self.joint_state = message

    def command(self, command: str, **arguments: object) -> str:
        return send_command(self.command_port, command, **arguments)

    def send(self, stage: int, grasp: StandardisedGrasp, max_torque: float = 400.0) -> list[JointState]:
        feedback: list[JointState] = []
        goal = GraspGoal(GraspCommand(grasp_state=stage, grasp=grasp, max_torque=max_torque))
        self.client.send_goal(goal, feedback_cb=lambda message: feedback.append(message.current_joint_state))
        return feedback

    def run(self, stage: int, grasp: StandardisedGrasp, max_torque: float = 400.0):
        """State, flags, text and feedback of one goal."""
        feedback = self.send(stage, grasp, max_torque)
        assert self.client.wait_for_result(rospy.Duration(30)), self.session.log()
        result = self.client.get_result()
        flags = (result.pregrasped.data, result.grasped.data, result.postgrasped.data)
        return self.client.get_state(), flags, self.client.get_goal_status_text(), feedback


def grasp(pregrasp: float = 0.4, closed: float = 1.94, intensity: float = 0.5) -> StandardisedGrasp:
    pose = generate_pose_stamped_message("world", (0, 0, 0), (0, 0, 0, 1))
    return get_standardised_grasp([JOINT], [pregrasp], [closed], [closed], [intensity], pose, pose, pose, 0.5, "g")


@pytest.fixture(scope="module")
def running(ros_launch, tmp_path_factory: pytest.TempPathFactory) -> Gripper:
    command_port = free_port()
    port = Path(tmp_path_factory.mktemp("line")) / "gripper"
    return Gripper(ros_launch(LAUNCH, port=port, command_port=command_port), command_port)


@pytest.fixture
def gripper(running: Gripper) -> Gripper:
    """The gripper, well, empty and at 0.4 rad."""
    for command in ("plug", "clear", "no_object"):
        running.command(command)
    running.command("heat", celsius=30)
    until(
        lambda: running.run(GraspCommand.PRE_GRASP_STATE, grasp())[0] == GoalStatus.SUCCEEDED,
        "a pregrasp without a fault",
    )
    return running


def test_a_pregrasp_is_reached_and_watched(gripper: Gripper) -> None:
    state, flags, text, feedback = gripper.run(GraspCommand.PRE_GRASP_STATE, grasp(pregrasp=1.5))
    assert (state, flags) == (GoalStatus.SUCCEEDED, (True, False, False)), text
    until(lambda: gripper.joint_state.position[0] == pytest.approx(1.5, abs=0.05), "the fingers at their pregrasp")
    assert feedback
    assert feedback[-1].name == [JOINT]
    assert feedback[0].position[0] < feedback[-1].position[0]


def test_an_object_is_grasped_held_and_let_go(gripper: Gripper) -> None:
    gripper.command("object", position=1.2)
    state, flags, text, _ = gripper.run(GraspCommand.GRASP_STATE, grasp())
    assert (state, flags) == (GoalStatus.SUCCEEDED, (False, True, False)), text
    until(lambda: gripper.joint_state.position[0] == pytest.approx(1.2, abs=0.05), "the fingers at the object")
    until(
        lambda: gripper.joint_state.effort[0] == pytest.approx(0.5 * 400 / 1023, abs=0.02), "half of the allowed torque"
    )
    state, flags, text, _ = gripper.run(GraspCommand.POST_GRASP_STATE, grasp())
    assert (state, flags) == (GoalStatus.SUCCEEDED, (False, False, True)), text
    assert gripper.run(GraspCommand.PRE_GRASP_STATE, grasp())[0] == GoalStatus.SUCCEEDED


def test_max_torque_and_intensity_bound_the_torque(gripper: Gripper) -> None:
    gripper.command("object", position=1.2)
    gripper.run(GraspCommand.GRASP_STATE, grasp(intensity=1.0), max_torque=200.0)
    until(lambda: gripper.joint_state.effort[0] == pytest.approx(200 / 1023, abs=0.01), "the torque that was allowed")


def test_closing_on_nothing_is_no_grasp(gripper: Gripper) -> None:
    state, flags, text, _ = gripper.run(GraspCommand.GRASP_STATE, grasp())
    assert (state, flags) == (GoalStatus.ABORTED, (False, False, False))
    assert "without an object between" in text


def test_a_blocked_pregrasp_is_a_failure(gripper: Gripper) -> None:
    gripper.command("object", position=0.8)
    state, flags, text, _ = gripper.run(GraspCommand.PRE_GRASP_STATE, grasp(pregrasp=1.5))
    assert (state, flags) == (GoalStatus.ABORTED, (False, False, False))
    assert f"joint '{JOINT}' is " in text
    pressed = re.search(r"the fingers press at (\d+\.\d+) rad", text)
    assert pressed is not None, text
    assert float(pressed[1]) == pytest.approx(0.8, abs=0.05)


@pytest.mark.parametrize("intensity", [0.02, 0.05])
def test_fingers_that_their_torque_cannot_move_have_grasped_nothing(gripper: Gripper, intensity: float) -> None:
    state, flags, text, _ = gripper.run(GraspCommand.GRASP_STATE, grasp(intensity=intensity))
    assert (state, flags) == (GoalStatus.ABORTED, (False, False, False)), text
    assert "the fingers have not moved" in text


def test_fingers_that_touch_an_object_from_the_beginning_grasp_it(gripper: Gripper) -> None:
    gripper.command("object", position=0.41)
    state, flags, text, _ = gripper.run(GraspCommand.GRASP_STATE, grasp())
    assert (state, flags) == (GoalStatus.SUCCEEDED, (False, True, False)), text


@pytest.mark.parametrize(
    ("message", "stage", "torque", "hint"),
    [
        (grasp, 1, float("nan"), "max_torque is nan; allowed: numbers above 0"),
        (lambda: grasp(intensity=0.0), 1, 400.0, "has an effort limit of 0"),
        (lambda: grasp(intensity=float("nan")), 1, 400.0, "torque intensity .* is nan"),
        (lambda: grasp(closed=2.0), 1, 400.0, r"the target is 2.0; allowed: 0.0 to 1.94"),
        (lambda: grasp(closed=5.0), 1, 400.0, r"the target is 5.0; allowed: 0.0 to 1.94"),
        (lambda: grasp(closed=-1.0), 1, 400.0, r"the target is -1.0; allowed: 0.0 to 1.94"),
        (lambda: grasp(closed=1e300), 1, 400.0, r"the target is 1e\+300; allowed: 0.0 to 1.94"),
        (lambda: grasp(closed=float("nan")), 1, 400.0, "the target is nan"),
        (grasp, 7, 400.0, "POST_GRASP_STATE"),
        (grasp, 1, 0.0, "max_torque"),
        (lambda: grasp(intensity=1.5), 1, 400.0, "torque intensity .* is 1.5; allowed: -1 to 1"),
        (StandardisedGrasp, 1, 400.0, "at least"),
    ],
)
def test_a_goal_without_sense_is_refused_with_value_and_limits(
    gripper: Gripper, stage: int, torque: float, hint: str, message: Callable[[], StandardisedGrasp]
) -> None:
    state, flags, text, _ = gripper.run(stage, message(), torque)
    assert (state, flags) == (GoalStatus.ABORTED, (False, False, False))
    assert re.search(hint, text), text
    assert gripper.joint_state.position[0] == pytest.approx(0.4, abs=0.05)


def test_a_cancel_stops_the_servo(gripper: Gripper) -> None:
    gripper.send(GraspCommand.GRASP_STATE, grasp(intensity=0.3))
    until(lambda: gripper.joint_state.position[0] > 0.6, "closing fingers")
    gripper.client.cancel_goal()
    assert gripper.client.wait_for_result(rospy.Duration(30))
    assert gripper.client.get_state() == GoalStatus.PREEMPTED
    opening, speed = opening_and_speed(gripper)
    assert abs(speed) < 100
    assert opening > 300
    time.sleep(0.3)
    assert opening_and_speed(gripper)[0] == pytest.approx(opening, abs=20)


def opening_and_speed(gripper: Gripper) -> tuple[int, int]:
    """Of the emulated servo [ticks, ticks/s]; the fingers' whole travel are 2560 ticks."""
    found = re.search(r"opening=(-?\d+) speed=(-?\d+)", gripper.command("state"))
    assert found is not None
    return int(found[1]), int(found[2])


def test_a_new_goal_takes_over(gripper: Gripper) -> None:
    ended: list[int] = []
    goal = GraspGoal(GraspCommand(grasp_state=1, grasp=grasp(intensity=0.3), max_torque=400.0))
    other = SteadyActionClient("ezgripper_grasp", GraspAction)
    assert other.wait_for_server(rospy.Duration(30))
    other.send_goal(goal, done_cb=lambda state, result: ended.append(state))
    until(lambda: gripper.joint_state.position[0] > 0.6, "closing fingers")
    assert gripper.run(GraspCommand.PRE_GRASP_STATE, grasp(pregrasp=0.5))[0] == GoalStatus.SUCCEEDED
    until(lambda: ended == [GoalStatus.PREEMPTED], "the end of the goal before")


@pytest.mark.parametrize(("fault", "text"), [("unplug", "port .* is lost"), ("overload", "overloaded")])
def test_a_fault_under_way_ends_the_goal_with_the_reason_and_the_next_one_works(
    gripper: Gripper, fault: str, text: str
) -> None:
    gripper.send(GraspCommand.GRASP_STATE, grasp(intensity=0.2))
    until(lambda: gripper.joint_state.position[0] > 0.5, "closing fingers")
    gripper.command(fault)
    assert gripper.client.wait_for_result(rospy.Duration(30))
    assert gripper.client.get_state() == GoalStatus.ABORTED
    assert re.search(text, gripper.client.get_goal_status_text()), gripper.client.get_goal_status_text()
    assert not gripper.client.get_result().grasped.data
    gripper.command("plug")
    until(
        lambda: gripper.run(GraspCommand.PRE_GRASP_STATE, grasp())[0] == GoalStatus.SUCCEEDED,
        "a pregrasp after the fault",
    )


def test_a_hot_motor_refuses_goals_until_it_has_cooled(gripper: Gripper) -> None:
    gripper.command("heat", celsius=85)
    until(
        lambda: "too hot (8" in gripper.run(GraspCommand.PRE_GRASP_STATE, grasp(pregrasp=1.0))[2],
        "the refusal of a hot motor",
    )
    gripper.command("heat", celsius=40)
    until(
        lambda: gripper.run(GraspCommand.PRE_GRASP_STATE, grasp(pregrasp=1.0))[0] == GoalStatus.SUCCEEDED,
        "a pregrasp of the cooled motor",
    )


def test_orders_without_arguments_are_services_too(gripper: Gripper) -> None:
    answer = rospy.ServiceProxy("ezgripper_emulator/state", Trigger)()
    assert answer.success
    assert "opening=" in answer.message


def test_a_fault_is_on_the_diagnostics_without_any_goal_until_it_ends(gripper: Gripper) -> None:
    levels: list[int] = []
    faults: list[str] = []

    def on_diagnostics(message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "ezgripper_server: gripper":
                levels.append(ord(status.level) if isinstance(status.level, bytes) else status.level)
                faults.append({value.key: value.value for value in status.values}["fault"])

    subscriber = rospy.Subscriber("/diagnostics", DiagnosticArray, on_diagnostics)
    until(lambda: faults and not faults[-1], "diagnostics without a fault")
    gripper.command("unplug")
    until(lambda: re.search("port .* is lost|cannot be opened", faults[-1]), "the fault on the diagnostics")
    assert levels[-1] == DiagnosticStatus.ERROR
    gripper.command("plug")
    until(lambda: not faults[-1], "the end of the fault on the diagnostics")
    assert levels[-1] == DiagnosticStatus.OK
    subscriber.unregister()


def test_joint_states_stop_while_the_gripper_is_out_of_reach(gripper: Gripper) -> None:
    def stand() -> bool:
        before = gripper.joint_state.header.stamp
        time.sleep(0.5)
        return bool(gripper.joint_state.header.stamp == before)

    gripper.command("unplug")
    until(stand, "the end of joint states")
    last = gripper.joint_state.header.stamp
    gripper.command("plug")
    until(lambda: gripper.joint_state.header.stamp > last, "joint states again")
