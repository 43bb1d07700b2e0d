# SPDX-License-Identifier: BSD-3-Clause
"""The grasp action drives the gripper's own controller, and its answers can be believed."""

from __future__ import annotations

import threading
import time

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import GripperCommandAction, GripperCommandGoal, GripperCommandResult
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

from modular_framework_core.grasping.grasp_messages import generate_pose_stamped_message, get_standardised_grasp
from modular_framework_core.msg import GraspAction, GraspCommand, GraspGoal, StandardisedGrasp
from modular_framework_ros.action_client import SteadyActionClient

ROBOT = """<launch>
  <param name="robot_description" value='&lt;robot name="r"&gt;&lt;link name="palm"/&gt;&lt;link name="finger"/&gt;
    &lt;joint name="f" type="revolute"&gt;&lt;parent link="palm"/&gt;&lt;child link="finger"/&gt;
    &lt;limit lower="0" upper="1.94" effort="2" velocity="3"/&gt;&lt;/joint&gt;&lt;/robot&gt;'/>
  <param name="robot_description_semantic" value='&lt;robot name="r"&gt;&lt;group name="hand"&gt;&lt;joint name="f"/&gt;
    &lt;/group&gt;&lt;/robot&gt;'/>
  <param name="manipulator_group_name" value="hand"/>
  <rosparam param="move_group/controller_list">
    [{name: hand_controller, action_ns: gripper_cmd, type: GripperCommand, joints: [f]}]</rosparam>
  <rosparam>
    package_manipulator_action_server: modular_framework_core
    manipulator_controller_node_name: moveit_grasp_action_server
    manipulator_controller_action_server_type: moveit_grasp_action_server
  </rosparam>
  <node name="spawner" pkg="modular_framework_core" type="external_controllers_spawner" output="screen"
        required="true"/>
</launch>"""


class FakeGripper:
    """A finger that moves at 2 rad/s, and stalls against an obstacle when there is one."""

    def __init__(self) -> None:
        self.position = self.speed = 0.0
        self.obstacle = float("inf")
        self.deaf = False
        self.lag = 0
        self.max_effort = -1.0
        self.published = 0
        self.moving, self.canceled = threading.Event(), threading.Event()
        self._publisher = rospy.Publisher("joint_states", JointState, queue_size=1)
        self._server = actionlib.SimpleActionServer(
            "hand_controller/gripper_cmd", GripperCommandAction, self._move, False
        )
        self._server.start()
        threading.Thread(target=self._publish, daemon=True).start()

    def _publish(self) -> None:
        seen = [(self.position, self.speed)] * 20
        while not rospy.is_shutdown():
            seen = [*seen[1:], (self.position, self.speed)]
            position, speed = seen[-1 - self.lag]
            self._publisher.publish(JointState(name=["f"], position=[position], velocity=[speed]))
            self.published += 1
            time.sleep(0.02)

    def _move(self, goal: GripperCommandGoal) -> None:
        self.max_effort = goal.command.max_effort
        self.moving.set()
        while not rospy.is_shutdown():
            if self._server.is_preempt_requested():
                self.speed = 0.0
                self.canceled.set()
                self._server.set_preempted()
                return
            away = goal.command.position - self.position
            step = max(-0.04, min(0.04, away))
            stalled = self.position + step > self.obstacle
            if not self.deaf and (stalled or abs(away) < 1e-3):
                self.speed = 0.0
                result = GripperCommandResult(self.position, 0.0, stalled, not stalled)
                (self._server.set_aborted if stalled else self._server.set_succeeded)(result)
                return
            if not stalled and not self.deaf:
                self.speed = step / 0.02
                self.position += step
            time.sleep(0.02)


@pytest.fixture(scope="module")
def gripper(ros_launch) -> FakeGripper:
    fake = FakeGripper()
    fake.session = ros_launch(ROBOT)
    return fake


@pytest.fixture(scope="module")
def client(gripper: FakeGripper) -> actionlib.SimpleActionClient:
    made = SteadyActionClient("moveit_grasp_action_server", GraspAction)
    assert made.wait_for_server(rospy.Duration(90)), gripper.session.log()
    return made


def grasp(closed: float = 1.94, torques: tuple[float, ...] = (0.5,)) -> StandardisedGrasp:
    pose = generate_pose_stamped_message("world", (0, 0, 0), (0, 0, 0, 1))
    assert isinstance(pose, PoseStamped)
    return get_standardised_grasp(["f"], [0.4], [closed], [closed], torques, pose, pose, pose, 0.5, "g")


def send(client, stage: int, message: StandardisedGrasp, max_torque: float = 400.0):
    feedback: list[JointState] = []
    goal = GraspGoal(GraspCommand(grasp_state=stage, grasp=message, max_torque=max_torque))
    client.send_goal(goal, feedback_cb=lambda message: feedback.append(message.current_joint_state))
    assert client.wait_for_result(rospy.Duration(60))
    result = client.get_result()
    flags = (result.pregrasped.data, result.grasped.data, result.postgrasped.data)
    return client.get_state(), flags, client.get_goal_status_text(), feedback


def test_a_pregrasp_is_reached_and_watched(gripper: FakeGripper, client) -> None:
    gripper.position, gripper.obstacle = 1.5, float("inf")
    state, flags, _, feedback = send(client, GraspCommand.PRE_GRASP_STATE, grasp())
    assert (state, flags) == (GoalStatus.SUCCEEDED, (True, False, False))
    assert gripper.position == pytest.approx(0.4, abs=0.01)
    assert gripper.max_effort == pytest.approx(0.5 * 400 / 800 * 2.0)
    assert feedback
    assert feedback[0].name == ["f"]


@pytest.mark.parametrize(("torques", "effort"), [((), 400 / 800 * 2.0), ((0.0,), 0.0)])
def test_a_pregrasp_without_intensities_has_full_effort_and_with_none_the_controllers_own(
    gripper: FakeGripper, client, torques: tuple[float, ...], effort: float
) -> None:
    gripper.position, gripper.obstacle = 1.5, float("inf")
    state, flags, text, _ = send(client, GraspCommand.PRE_GRASP_STATE, grasp(torques=torques))
    assert (state, flags) == (GoalStatus.SUCCEEDED, (True, False, False)), text
    assert gripper.max_effort == pytest.approx(effort)


def test_joint_states_that_are_heard_late_do_not_make_a_posture_missed(gripper: FakeGripper, client) -> None:
    gripper.position, gripper.obstacle, gripper.lag = 1.5, float("inf"), 5
    before = gripper.published
    while gripper.published < before + 10:  # until the late ones tell of this position
        time.sleep(0.02)
    try:
        state, flags, text, _ = send(client, GraspCommand.PRE_GRASP_STATE, grasp())
    finally:
        gripper.lag = 0
    assert (state, flags) == (GoalStatus.SUCCEEDED, (True, False, False)), text


def test_fingers_stopped_by_an_object_have_grasped_it_and_hold_it_afterwards(gripper: FakeGripper, client) -> None:
    gripper.position, gripper.obstacle = 0.4, 1.2
    state, flags, text, _ = send(client, GraspCommand.GRASP_STATE, grasp())
    assert (state, flags) == (GoalStatus.SUCCEEDED, (False, True, False)), text
    state, flags, text, _ = send(client, GraspCommand.POST_GRASP_STATE, grasp())
    assert (state, flags) == (GoalStatus.SUCCEEDED, (False, False, True)), text


def test_fingers_that_stall_where_they_began_have_grasped_nothing(gripper: FakeGripper, client) -> None:
    gripper.position, gripper.obstacle = 0.4, 0.4
    before = gripper.published
    while gripper.published < before + 10:  # until joint states tell of this position
        time.sleep(0.02)
    state, flags, text, _ = send(client, GraspCommand.GRASP_STATE, grasp(torques=(0.01,)))
    assert (state, flags) == (GoalStatus.ABORTED, (False, False, False))
    assert "the fingers have not moved" in text


def test_fingers_that_stall_where_they_began_hold_something_with_a_torque_that_moved_them_before(
    gripper: FakeGripper, client
) -> None:
    gripper.position, gripper.obstacle = 0.0, float("inf")
    assert send(client, GraspCommand.PRE_GRASP_STATE, grasp())[0] == GoalStatus.SUCCEEDED
    gripper.obstacle = gripper.position
    state, flags, text, _ = send(client, GraspCommand.GRASP_STATE, grasp())
    assert (state, flags) == (GoalStatus.SUCCEEDED, (False, True, False)), text


def test_fingers_that_close_on_nothing_have_grasped_nothing(gripper: FakeGripper, client) -> None:
    gripper.position, gripper.obstacle = 0.4, float("inf")
    state, flags, text, _ = send(client, GraspCommand.GRASP_STATE, grasp())
    assert (state, flags) == (GoalStatus.ABORTED, (False, False, False))
    assert "without an object between" in text


def test_a_pregrasp_that_is_blocked_is_a_failure(gripper: FakeGripper, client) -> None:
    gripper.position, gripper.obstacle = 0.0, 0.1
    state, flags, text, _ = send(client, GraspCommand.PRE_GRASP_STATE, grasp())
    assert (state, flags) == (GoalStatus.ABORTED, (False, False, False))
    assert "'f'" in text


@pytest.mark.parametrize(
    ("message", "stage", "torque", "hint"),
    [
        (grasp, 7, 400.0, "POST_GRASP_STATE"),
        (lambda: grasp(3.0), 1, 400.0, "the target is 3.0; allowed"),
        (StandardisedGrasp, 1, 400.0, "at least"),
        (grasp, 1, 0.0, "max_torque"),
        (grasp, 1, float("nan"), "max_torque is nan"),
        (lambda: grasp(torques=(0.0,)), 1, 400.0, "has an effort limit of 0"),
        (lambda: grasp(torques=(1.0, 1.0)), 1, 400.0, "1 joint names and 2 values"),
    ],
)
def test_a_command_without_sense_is_refused_with_the_reason(gripper, client, message, stage, torque, hint) -> None:
    state, flags, text, _ = send(client, stage, message(), torque)
    assert (state, flags) == (GoalStatus.ABORTED, (False, False, False))
    assert hint in text


def test_a_cancel_stops_the_fingers_at_once(gripper: FakeGripper, client) -> None:
    gripper.position, gripper.obstacle, gripper.deaf = 0.0, float("inf"), True
    gripper.moving.clear()
    gripper.canceled.clear()
    client.send_goal(GraspGoal(GraspCommand(grasp_state=1, grasp=grasp(), max_torque=400.0)))
    assert gripper.moving.wait(30.0)
    started = time.monotonic()
    client.cancel_goal()
    assert client.wait_for_result(rospy.Duration(30))
    assert time.monotonic() - started < 5.0
    assert client.get_state() == GoalStatus.PREEMPTED
    assert gripper.canceled.wait(30.0)
    gripper.deaf = False


def test_the_spawner_ends_with_an_error_when_its_node_dies(gripper: FakeGripper, client) -> None:
    import rosnode

    assert rosnode.kill_nodes(["/moveit_grasp_action_server"])[0]
    deadline = time.monotonic() + 60
    while gripper.session.alive() and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not gripper.session.alive()
    assert "Node 'moveit_grasp_action_server'" in gripper.session.log()
