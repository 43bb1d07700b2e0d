# SPDX-License-Identifier: BSD-3-Clause
"""States that move arm and fingers beside Move and Grasp: written trajectories, straight lines, postures."""

from __future__ import annotations

import math
from types import SimpleNamespace

import actionlib
import pytest
import rospy
from geometry_msgs.msg import PoseStamped
from moveit_msgs.msg import ContactInformation, RobotTrajectory
from moveit_msgs.srv import (
    GetCartesianPath,
    GetCartesianPathResponse,
    GetPositionFK,
    GetPositionFKResponse,
    GetStateValidity,
    GetStateValidityResponse,
)
from std_msgs.msg import Bool
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import smach
from modular_framework_core import srv
from modular_framework_core.msg import GraspAction, GraspResult
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_states.states.cartesian_move import CartesianMove, translate_pose
from modular_framework_states.states.execute_trajectory import ExecuteTrajectory
from modular_framework_states.states.gripper import Gripper

LAUNCH = """<launch><node name="managers" pkg="modular_framework_core" type="managers" output="screen" required="true"/>
</launch>"""
URDF = """<robot name="r"><link name="palm"/><link name="finger"/><joint name="f" type="revolute"><parent link="palm"/>
<child link="finger"/><axis xyz="0 0 1"/><limit lower="0" upper="1.9" effort="1" velocity="1"/></joint></robot>"""
SRDF = """<robot name="r"><group name="hand"><joint name="f"/></group>
<group_state name="open" group="hand"><joint name="f" value="0"/></group_state></robot>"""


class Arm:
    """One joint; the tip is at x = its position. A wall stands at x = 2."""

    group_name = "arm"
    group = SimpleNamespace(tip_link="tip", joints=[SimpleNamespace(name="j", velocity=6.0, acceleration=50.0)])

    def __init__(self) -> None:
        self.position, self.executed, self.stuck = 0.0, [], False
        self.services = [
            rospy.Service("check_state_validity", GetStateValidity, self._validity),
            rospy.Service("compute_fk", GetPositionFK, self._fk),
            rospy.Service("compute_cartesian_path", GetCartesianPath, self._line),
        ]

    def positions_of(self, joints) -> dict[str, float]:
        return {name: value for name, value in self.current_joints().items() if name in joints}

    def of_group(self, name: str):
        self.groups = [*getattr(self, "groups", []), name]
        return self

    def current_joints(self) -> dict[str, float]:
        return {"j": self.position}

    def execute_plan(self, plan: RobotTrajectory, stop_requested=None) -> SimpleNamespace:
        self.executed.append(plan.joint_trajectory)
        if not self.stuck:
            self.position = plan.joint_trajectory.points[-1].positions[0]
        return SimpleNamespace(reason="")

    def _validity(self, request):
        free = request.robot_state.joint_state.position[0] < 2.0
        contact = ContactInformation(contact_body_1="tip", contact_body_2="wall")
        return GetStateValidityResponse(valid=free, contacts=[] if free else [contact])

    def _fk(self, request):
        pose = PoseStamped()
        pose.header.frame_id, pose.pose.orientation.w = "world", 1.0
        pose.pose.position.x = request.robot_state.joint_state.position[0]
        return GetPositionFKResponse(pose_stamped=[pose])

    def _line(self, request):
        start, end = request.start_state.joint_state.position[0], request.waypoints[0].position.x
        share = min(1.0, (2.0 - start) / (end - start)) if end > start else 1.0
        answer = GetCartesianPathResponse(fraction=share)
        answer.solution.joint_trajectory = trajectory((0.0, start), (1.0, start + share * (end - start)))
        answer.error_code.val = 1
        return answer


def trajectory(*points: tuple[float, float]) -> JointTrajectory:
    return JointTrajectory(
        joint_names=["j"],
        points=[
            JointTrajectoryPoint(positions=[value], time_from_start=rospy.Duration(time_s)) for time_s, value in points
        ],
    )


@pytest.fixture(scope="module", autouse=True)
def managers(ros_launch):
    rospy.set_param("robot_description", URDF)
    rospy.set_param("robot_description_semantic", SRDF)
    rospy.set_param("manipulator_group_name", "hand")
    session = ros_launch(LAUNCH)
    session.wait_for_service("/get_trajectory", 60)
    add = rospy.ServiceProxy("add_trajectory", srv.AddJointTrajectory)
    add(trajectory((0.5, 0.5), (1.0, 1.5)), "there")
    add(trajectory((0.5, 2.5), (1.0, 1.5)), "through_the_wall")
    add(trajectory((0.5, 0.5), (0.6, 1.5)), "in_a_hurry")
    add(JointTrajectory(joint_names=["k"], points=[JointTrajectoryPoint(positions=[0.0])]), "other_robot")
    return session


@pytest.fixture
def arm():
    made = Arm()
    yield made
    for service in made.services:
        service.shutdown()


def run(state: smach.State, **values: object) -> str:
    machine = smach.StateMachine(outcomes=["success", "fail"])
    for key, value in values.items():
        machine.userdata[key] = value
    with machine:
        smach.StateMachine.add("ONLY", state, transitions={})
    return machine.execute()


def test_a_named_trajectory_begins_where_the_arm_is_and_ends_at_its_last_point(arm: Arm) -> None:
    assert run(ExecuteTrajectory("there"), arm_commander=arm) == "success"
    assert [tuple(point.positions) for point in arm.executed[0].points] == [(0.0,), (0.5,), (1.5,)]
    assert arm.position == 1.5


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("through_the_wall", "on the way to point 1 the robot would be in collision ('tip' with 'wall')"),
        ("in_a_hurry", "joint 'j' has 0.10 s to get to point 2 and needs 0.17 s at its maximum velocity, 6.00"),
        ("nowhere", "no trajectory named 'nowhere' is stored"),
        ("other_robot", "the joints ['k'] are not joints of the arm"),
    ],
)
def test_a_trajectory_that_cannot_be_run_is_not_begun(arm: Arm, name: str, reason: str) -> None:
    state = ExecuteTrajectory(name)
    assert run(state, arm_commander=arm) == "fail"
    assert reason in state.reason
    assert arm.executed == []


def test_a_trajectory_that_ends_elsewhere_has_failed(arm: Arm) -> None:
    arm.stuck = True
    state = ExecuteTrajectory("there")
    assert run(state, arm_commander=arm) == "fail"
    assert "joint 'j' is 1.5000 away from its last point; the tolerance is 0.03" in state.reason


def test_a_straight_line_is_moved_completely_or_not_at_all(arm: Arm) -> None:
    assert run(CartesianMove(offset=(1.5, 0.0, 0.0)), arm_commander=arm) == "success"
    assert arm.position == 1.5
    state = CartesianMove(offset=(1.0, 0.0, 0.0))
    assert run(state, arm_commander=arm) == "fail"
    assert "only 50.0% of the line can be moved" in state.reason
    assert arm.position == 1.5
    assert run(CartesianMove(offset=(1.0, 0.0, 0.0), min_fraction=0.5), arm_commander=arm) == "success"
    assert arm.position == 2.0


def test_an_offset_may_be_given_in_the_frame_of_the_tip() -> None:
    pose = PoseStamped()
    pose.pose.orientation.z = pose.pose.orientation.w = math.sqrt(0.5)  # turned by a right angle about z
    result = translate_pose(pose, (1.0, 0.0, 0.5), True).pose.position
    assert (result.x, result.y, result.z) == pytest.approx((0.0, 1.0, 0.5))


def test_fingers_go_to_a_posture_of_the_group_and_the_server_has_the_last_word() -> None:
    goals: list[object] = []

    def execute(goal) -> None:
        goals.append(goal.grasp_command)
        posture = goal.grasp_command.grasp.pregrasp.posture
        if posture.position[0] > 1.0:
            server.set_aborted(GraspResult(), "the fingers are jammed")
        else:
            server.set_succeeded(GraspResult(pregrasped=Bool(True), grasped=Bool(True)))

    server = actionlib.SimpleActionServer("hand", GraspAction, execute, auto_start=False)
    server.start()
    keys = {"manipulator_controller_client": SteadyActionClient("hand", GraspAction), "max_torque": 0.5}
    assert run(Gripper("open"), **keys) == "success"
    assert (goals[0].grasp_state, list(goals[0].grasp.pregrasp.posture.position)) == (0, [0.0])
    assert run(Gripper(positions={"f": 0.7}, grip=True, torque=0.3), **keys) == "success"
    assert (goals[1].grasp_state, list(goals[1].grasp.torque_intensity.torque_intensity)) == (1, [0.3])
    for state, reason in (
        (Gripper(positions={"f": 1.5}), "gripper to f 1.5: the fingers are jammed"),
        (Gripper("shut"), "group 'hand' has no state 'shut'; it has open"),
    ):
        assert run(state, **keys) == "fail"
        assert reason in state.reason
    state = Gripper("open")
    assert run(state, manipulator_controller_client=None, max_torque=0.5) == "fail"
    assert "the task has no manipulator" in state.reason
