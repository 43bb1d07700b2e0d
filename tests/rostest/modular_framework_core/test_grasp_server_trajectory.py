# SPDX-License-Identifier: BSD-3-Clause
"""The grasp action also drives hands whose controller follows trajectories."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence

import actionlib
import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal, FollowJointTrajectoryResult
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory

from modular_framework_core.grasping.grasp_messages import generate_pose_stamped_message, get_standardised_grasp
from modular_framework_core.msg import GraspAction, GraspCommand, GraspGoal
from modular_framework_ros.action_client import SteadyActionClient

JOINT = """&lt;joint name="{name}" type="revolute"&gt;&lt;parent link="palm"/&gt;&lt;child link="{name}_link"/&gt;
&lt;limit lower="0" upper="1.5" effort="2" velocity="3"/&gt;&lt;/joint&gt;&lt;link name="{name}_link"/&gt;"""
LAUNCH = f"""<launch>
  <param name="robot_description" value='&lt;robot name="r"&gt;&lt;link name="palm"/&gt;{JOINT.format(name="a")}
    {JOINT.format(name="b")}&lt;/robot&gt;'/>
  <param name="robot_description_semantic" value='&lt;robot name="r"&gt;&lt;group name="hand"&gt;&lt;joint name="a"/&gt;
    &lt;joint name="b"/&gt;&lt;/group&gt;&lt;/robot&gt;'/>
  <param name="robot_description_planning/joint_limits/b/max_acceleration" value="10.0"/>
  <param name="manipulator_group_name" value="hand"/>
  <node name="grasper" pkg="modular_framework_core" type="moveit_grasp_action_server" output="screen" required="true">
    <param name="motion_duration" value="0.3"/>
    <rosparam param="controller_list">
      [{{name: arm, action_ns: x, type: FollowJointTrajectory, joints: [s]}},
       {{name: hand, action_ns: follow_joint_trajectory, type: FollowJointTrajectory, joints: [a, b]}}]</rosparam>
  </node></launch>"""


class FakeHand:
    """Two joints that jump to their targets at the end of the trajectory, or stop at an obstacle."""

    def __init__(self) -> None:
        self.positions = {"a": 0.0, "b": 0.0}
        self.obstacle = float("inf")
        self.fault = ""
        self.trajectories: list[JointTrajectory] = []
        self._publisher = rospy.Publisher("joint_states", JointState, queue_size=1)
        self._server = actionlib.SimpleActionServer(
            "hand/follow_joint_trajectory", FollowJointTrajectoryAction, self._follow, False
        )
        self._server.start()
        threading.Thread(target=self._publish, daemon=True).start()

    def _publish(self) -> None:
        while not rospy.is_shutdown():
            self._publisher.publish(
                JointState(name=list(self.positions), position=list(self.positions.values()), velocity=[0.0, 0.0])
            )
            time.sleep(0.02)

    def _follow(self, goal: FollowJointTrajectoryGoal) -> None:
        self.trajectories.append(goal.trajectory)
        point = goal.trajectory.points[-1]
        time.sleep(point.time_from_start.to_sec())
        wanted = dict(zip(goal.trajectory.joint_names, point.positions, strict=True))
        self.positions = {name: min(position, self.obstacle) for name, position in wanted.items()}
        time.sleep(0.1)
        if self.fault:
            self._server.set_aborted(FollowJointTrajectoryResult(FollowJointTrajectoryResult.INVALID_GOAL, self.fault))
        elif self.positions == wanted:
            self._server.set_succeeded(FollowJointTrajectoryResult())
        else:
            code = FollowJointTrajectoryResult.GOAL_TOLERANCE_VIOLATED
            self._server.set_aborted(FollowJointTrajectoryResult(code, "short of the goal"))


@pytest.fixture(scope="module")
def hand(ros_launch) -> FakeHand:
    fake = FakeHand()
    ros_launch(LAUNCH)
    fake.client = SteadyActionClient("moveit_grasp_action_server", GraspAction)
    assert fake.client.wait_for_server(rospy.Duration(90))
    return fake


def send(hand: FakeHand, stage: int, opening: Sequence[float] = (0.2, 0.4)) -> tuple[int, tuple[bool, bool, bool], str]:
    pose = generate_pose_stamped_message("world", (0, 0, 0), (0, 0, 0))
    message = get_standardised_grasp(["a", "b"], list(opening), [1.5, 1.5], [1.0, 1.0], [1.0, 1.0], pose, pose, pose)
    hand.client.send_goal(GraspGoal(GraspCommand(grasp_state=stage, grasp=message, max_torque=400.0)))
    assert hand.client.wait_for_result(rospy.Duration(60))
    result = hand.client.get_result()
    flags = (result.pregrasped.data, result.grasped.data, result.postgrasped.data)
    return hand.client.get_state(), flags, hand.client.get_goal_status_text()


def test_a_posture_of_two_joints_is_reached(hand: FakeHand) -> None:
    state, flags, text = send(hand, GraspCommand.PRE_GRASP_STATE)
    assert (state, flags) == (GoalStatus.SUCCEEDED, (True, False, False)), text
    assert hand.positions == {"a": 0.2, "b": 0.4}


def test_a_short_motion_has_the_configured_duration_and_a_long_one_keeps_the_limits(hand: FakeHand) -> None:
    send(hand, GraspCommand.PRE_GRASP_STATE, [0.1, 0.1])
    for opening, duration_s in (
        ([0.11, 0.11], 0.3),
        ([1.3, 0.11], 1.5 * 1.19 / 3.0),
        ([1.3, 1.3], (6.0 * 1.19 / 10.0) ** 0.5),
    ):
        send(hand, GraspCommand.PRE_GRASP_STATE, opening)
        (point,) = hand.trajectories[-1].points
        assert point.velocities == (0.0, 0.0)  # a cubic from rest to rest: 1.5 times the mean velocity, 6 d/T^2
        assert point.time_from_start.to_sec() == pytest.approx(duration_s, abs=0.002)
    send(hand, GraspCommand.PRE_GRASP_STATE)


def test_fingers_resting_short_of_their_targets_hold_something(hand: FakeHand) -> None:
    hand.obstacle = 1.1
    state, flags, text = send(hand, GraspCommand.GRASP_STATE)
    assert (state, flags) == (GoalStatus.SUCCEEDED, (False, True, False)), text


def test_fingers_that_a_fault_stopped_hold_nothing(hand: FakeHand) -> None:
    hand.obstacle, hand.fault = 0.8, "hardware fault: servo 1: overload"
    state, flags, text = send(hand, GraspCommand.GRASP_STATE)
    hand.fault = ""
    assert (state, flags) == (GoalStatus.ABORTED, (False, False, False))
    assert "gave up: hardware fault: servo 1: overload" in text


def test_a_hand_that_shuts_holds_nothing(hand: FakeHand) -> None:
    hand.obstacle = float("inf")
    state, flags, text = send(hand, GraspCommand.GRASP_STATE)
    assert (state, flags) == (GoalStatus.ABORTED, (False, False, False))
    assert "without an object" in text


def test_a_postgrasp_posture_is_reached(hand: FakeHand) -> None:
    assert send(hand, GraspCommand.POST_GRASP_STATE)[:2] == (GoalStatus.SUCCEEDED, (False, False, True))
