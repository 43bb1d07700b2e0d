# SPDX-License-Identifier: BSD-3-Clause
"""Two arms on fake controllers: planned for together, moved at the same time, and never into each other."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import moveit_commander
import numpy as np
import pytest
import rospy
from geometry_msgs.msg import PoseStamped
from moveit_commander import MoveGroupCommander, RobotCommander
from moveit_msgs.msg import MoveGroupAction, MoveGroupGoal, MoveItErrorCodes, PositionIKRequest, RobotState
from moveit_msgs.srv import GetPositionFK, GetPositionIK
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.planning.planning_wire import report_of
from modular_framework_testing.ros_session import until

SIDES = ("left", "right")
JOINTS = {side: [f"{side}_joint{number}" for number in range(1, 8)] for side in SIDES}
OUTWARD = {"left": 0.8, "right": -0.8}  # turn of the first joint away from the other arm [rad]
LAUNCH = """<launch>
  <node name="joint_state_publisher" pkg="joint_state_publisher" type="joint_state_publisher">
    <rosparam param="source_list">[move_group/fake_controller_joint_states]</rosparam>
    <param name="rate" value="50"/>
  </node>
  <include file="$(find dual_panda_moveit_config)/launch/move_group.launch">
    <arg name="load_robot_description" value="true"/>
  </include>
  <param name="move_group/moveit_controller_manager"
         value="moveit_fake_controller_manager/MoveItFakeControllerManager"/>
  <rosparam ns="move_group">
    fake_interpolating_controller_rate: 50
    initial: [{group: both_arms, pose: ready}]
    controller_list:
CONTROLLERS
  </rosparam>
</launch>""".replace(
    "CONTROLLERS",
    "\n".join(
        f"      - {{name: {side}_arm_controller, type: interpolate, joints: [{', '.join(names)}]}}"
        for side, names in JOINTS.items()
    ),
)


class Recorder:
    """Every joint state, with its stamp."""

    def __init__(self) -> None:
        self.states: list[tuple[float, dict[str, float]]] = []
        rospy.Subscriber("joint_states", JointState, self._keep, queue_size=100)

    def _keep(self, message: JointState) -> None:
        self.states.append((message.header.stamp.to_sec(), dict(zip(message.name, message.position, strict=True))))

    def moving(self, side: str, since_s: float) -> tuple[float, float]:
        """When an arm began to move and when it stood still again, by the stamps."""
        states = [(stamp, [found[name] for name in JOINTS[side]]) for stamp, found in self.states if stamp >= since_s]
        places = np.array([values for _, values in states])
        (steps,) = np.nonzero(np.abs(np.diff(places, axis=0)).max(axis=1) > 1e-6)
        assert len(steps), f"the {side} arm did not move"
        return states[steps[0]][0], states[steps[-1] + 1][0]

    def now(self, joint: str) -> float:
        return self.states[-1][1][joint]


@pytest.fixture(scope="module")
def session(ros_launch: Callable[..., Any]) -> Iterator[Any]:
    session = ros_launch(LAUNCH)
    session.wait_for_service("plan_kinematic_path", 120.0)
    yield session
    assert session.alive(), session.log()
    moveit_commander.roscpp_shutdown()


@pytest.fixture(scope="module")
def groups(session: Any) -> dict[str, MoveGroupCommander]:
    """The commanders of both arms and of each, at the robot's own limits."""
    found = {}
    for name in ("left_arm", "right_arm", "both_arms"):
        found[name] = MoveGroupCommander(name, wait_for_servers=30.0)
        found[name].set_max_velocity_scaling_factor(1.0)
        found[name].set_max_acceleration_scaling_factor(1.0)
    return found


@pytest.fixture(scope="module")
def recorder(session: Any) -> Recorder:
    recorder = Recorder()
    until(lambda: recorder.states, "joint states")
    return recorder


@pytest.fixture(autouse=True)
def ready(groups: dict[str, MoveGroupCommander]) -> None:
    groups["both_arms"].set_named_target("ready")
    assert groups["both_arms"].go()


def turned(group: MoveGroupCommander, side: str, angle: float, **others: float) -> None:
    """Sets a goal with another turn of the first joint, and others by their numbers."""
    values = dict(zip(group.get_active_joints(), group.get_current_joint_values(), strict=True))
    goal = {f"{side}_joint1": angle} | {f"{side}_{name}": value for name, value in others.items()}
    group.set_joint_value_target({**values, **goal})


def across(group: MoveGroupCommander, side: str) -> None:
    """Sets a goal where an arm lies, stretched out, between the bases: both arms cannot be there."""
    turned(group, side, -np.sign(OUTWARD[side]) * 1.2, joint2=0.3, joint4=-1.7, joint6=2.0)


def test_a_motion_of_both_arms_is_planned_and_executed_by_both_controllers(
    groups: dict[str, MoveGroupCommander], recorder: Recorder
) -> None:
    both, begun_s = groups["both_arms"], rospy.get_time()
    goal = dict(zip(both.get_active_joints(), both.get_current_joint_values(), strict=True))
    goal |= {f"{side}_joint1": angle for side, angle in OUTWARD.items()}
    both.set_joint_value_target(goal)
    worked, motion, _, _ = both.plan()
    assert worked and sorted(motion.joint_trajectory.joint_names) == sorted(JOINTS["left"] + JOINTS["right"])
    assert both.execute(motion)
    assert both.get_current_joint_values() == pytest.approx(list(goal.values()), abs=1e-3)
    left, right = (recorder.moving(side, begun_s) for side in SIDES)
    assert abs(left[0] - right[0]) < 0.2 and abs(left[1] - right[1]) < 0.2


@pytest.mark.parametrize("in_one_go", [True, False])
def test_two_clients_plan_and_move_an_arm_each_at_the_same_time(
    groups: dict[str, MoveGroupCommander], recorder: Recorder, in_one_go: bool
) -> None:
    begun_s, meeting = rospy.get_time(), threading.Barrier(2)

    def move(side: str) -> bool:
        group = groups[f"{side}_arm"]
        turned(group, side, OUTWARD[side])
        meeting.wait()
        if in_one_go:
            return bool(group.go())
        worked, motion, _, _ = group.plan()
        meeting.wait()
        return worked and bool(group.execute(motion))

    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(move, SIDES)) == [True, True]
    for side in SIDES:
        assert recorder.now(f"{side}_joint1") == pytest.approx(OUTWARD[side], abs=1e-3)
    (left_begin, left_end), (right_begin, right_end) = (recorder.moving(side, begun_s) for side in SIDES)
    together_s = min(left_end, right_end) - max(left_begin, right_begin)
    assert together_s > 0.5 * min(left_end - left_begin, right_end - right_begin), "the motions overlap in time"


def begin(group: MoveGroupCommander, recorder: Recorder, joint: str) -> None:
    """Begins to move slowly, and returns when the joint does."""
    group.set_max_velocity_scaling_factor(0.3)
    before = recorder.now(joint)
    assert group.go(wait=False)
    until(lambda: abs(recorder.now(joint) - before) > 0.02, "the begin of the motion")
    group.set_max_velocity_scaling_factor(1.0)


def test_a_goal_of_both_arms_takes_the_place_of_a_motion_of_one(
    groups: dict[str, MoveGroupCommander], recorder: Recorder
) -> None:
    turned(groups["left_arm"], "left", 1.5)
    begin(groups["left_arm"], recorder, "left_joint1")
    groups["both_arms"].set_named_target("ready")
    assert groups["both_arms"].go()
    assert recorder.now("left_joint1") == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize("in_one_go", [True, False])
def test_a_motion_into_one_under_way_is_not_begun_and_both_links_are_named(
    groups: dict[str, MoveGroupCommander], recorder: Recorder, in_one_go: bool
) -> None:
    left, right = groups["left_arm"], groups["right_arm"]
    across(left, "left")
    across(right, "right")
    worked, motion, _, _ = right.plan()
    assert worked, "each arm alone may go there"
    begin(left, recorder, "left_joint1")
    if in_one_go:  # at full speed the left arm moves on while the right arm plans
        until(lambda: recorder.now("left_joint1") < -0.3, "the left arm at its full speed")
    done, report = report_of(lambda: right.go() if in_one_go else right.execute(motion), "execute")
    assert not done and report["error_code"] == MoveItErrorCodes.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE
    said = report["reason"]
    assert "collide with a running motion" in said and "link 'left_" in said and "link 'right_" in said, said
    assert recorder.now("right_joint1") == pytest.approx(0.0, abs=0.01), "it was not begun"
    until(lambda: abs(recorder.now("left_joint1") + 1.2) < 1e-3, "the end of the motion that came first")


ACROSS = {"right_joint1": 1.2, "right_joint2": 0.3, "right_joint4": -1.7, "right_joint6": 2.0}
AWAY = {"right_joint1": 0.0, "right_joint2": -0.785, "right_joint4": -2.356, "right_joint6": 1.571}


def push(recorder: Recorder, places: dict[str, float]) -> None:
    """Puts joints elsewhere, by no motion of move_group."""
    publisher = rospy.Publisher("move_group/fake_controller_joint_states", JointState, queue_size=5)
    until(publisher.get_num_connections, "the joint state publisher")
    time.sleep(0.2)  # it hears a new publisher a little later than that hears of it
    publisher.publish(JointState(Header(stamp=rospy.Time.now()), list(places), list(places.values()), [], []))
    until(lambda: all(recorder.now(name) == place for name, place in places.items()), "the joints elsewhere")
    publisher.unregister()


def test_a_motion_stops_when_the_other_arm_comes_into_its_way_by_itself(
    groups: dict[str, MoveGroupCommander], recorder: Recorder
) -> None:
    left, results = groups["left_arm"], []
    across(left, "left")
    worked, motion, _, _ = left.plan()
    assert worked
    for point in motion.joint_trajectory.points:
        point.time_from_start *= 4.0
        point.velocities, point.accelerations = [], []
    mover = threading.Thread(target=lambda: results.append(left.execute(motion)))
    mover.start()
    until(lambda: recorder.now("left_joint1") < -0.02, "the begin of the motion")
    _, report = report_of(lambda: push(recorder, ACROSS), "execute")
    mover.join(30.0)
    assert results == [False]
    assert recorder.now("left_joint1") > -1.1, "it stopped on its way"
    said = report["reason"]
    assert "another part of the robot moved" in said and "link 'left_" in said and "link 'right_" in said


def test_a_motion_whose_plan_allows_the_arms_to_touch_goes_on(
    groups: dict[str, MoveGroupCommander], recorder: Recorder
) -> None:
    left = groups["left_arm"]
    across(left, "left")
    left.set_max_velocity_scaling_factor(0.3)
    goal = MoveGroupGoal(request=left.construct_motion_plan_request())
    left.set_max_velocity_scaling_factor(1.0)
    links = [link for link in RobotCommander().get_link_names() if link.startswith("left_")]
    diff = goal.planning_options.planning_scene_diff
    diff.is_diff = diff.robot_state.is_diff = True
    diff.allowed_collision_matrix.default_entry_names = links
    diff.allowed_collision_matrix.default_entry_values = [True] * len(links)
    client = SteadyActionClient("move_group", MoveGroupAction)
    assert client.wait_for_server(rospy.Duration(20.0))
    client.send_goal(goal)
    until(lambda: recorder.now("left_joint1") < -0.02, "the begin of the motion")
    push(recorder, ACROSS)
    assert client.wait_for_result(rospy.Duration(30.0))
    assert client.get_result().error_code.val == MoveItErrorCodes.SUCCESS
    assert recorder.now("left_joint1") == pytest.approx(-1.2, abs=1e-3)
    push(recorder, AWAY)


def ik(avoid_collisions: bool = True, **changes: Any) -> PositionIKRequest:
    message = PositionIKRequest(group_name="both_arms", robot_state=RobotState(is_diff=True))
    message.avoid_collisions = avoid_collisions
    for name, value in changes.items():
        setattr(message, name, value)
    return message


def tips(state: RobotState, *links: str) -> list[PoseStamped]:
    answer = rospy.ServiceProxy("compute_fk", GetPositionFK)(Header(frame_id="world"), list(links), state)
    assert answer.error_code.val == MoveItErrorCodes.SUCCESS
    return answer.pose_stamped


def place(stamped: PoseStamped) -> list[float]:
    p, q = stamped.pose.position, stamped.pose.orientation
    return [p.x, p.y, p.z, *(np.array([q.x, q.y, q.z, q.w]) * np.sign(q.w or 1.0))]


def test_each_tip_of_two_arms_is_brought_to_a_pose_of_its_own(session: Any, recorder: Recorder) -> None:
    solve = rospy.ServiceProxy("compute_ik", GetPositionIK)
    links = ["right_hand_tcp", "left_hand_tcp"]  # in the order of the request, not of the group
    poses = tips(RobotState(is_diff=True), *links)
    for stamped, shift in zip(poses, (0.05, -0.08), strict=True):
        stamped.pose.position.z += shift
    answer = solve(ik(ik_link_names=links, pose_stamped_vector=poses))
    assert answer.error_code.val == MoveItErrorCodes.SUCCESS
    for reached, wanted in zip(tips(answer.solution, *links), poses, strict=True):
        assert place(reached) == pytest.approx(place(wanted), abs=1e-4)
    alone = solve(ik(ik_link_names=links[:1], pose_stamped_vector=poses[:1]))
    assert alone.error_code.val == MoveItErrorCodes.SUCCESS
    values = dict(zip(alone.solution.joint_state.name, alone.solution.joint_state.position, strict=True))
    assert all(values[name] == pytest.approx(recorder.now(name), abs=1e-6) for name in JOINTS["left"])


def test_solutions_of_two_tips_that_would_touch_are_refused_where_collisions_count(session: Any) -> None:
    solve = rospy.ServiceProxy("compute_ik", GetPositionIK)
    links = ["left_hand_tcp", "right_hand_tcp"]
    (left,) = tips(RobotState(is_diff=True), links[0])
    left.pose.position.x, left.pose.position.y = 0.0, left.pose.position.y
    same = [left, left]
    assert solve(ik(False, ik_link_names=links, pose_stamped_vector=same)).error_code.val == MoveItErrorCodes.SUCCESS
    refused = solve(ik(True, ik_link_names=links, pose_stamped_vector=same))
    assert refused.error_code.val == MoveItErrorCodes.NO_IK_SOLUTION


@pytest.mark.parametrize(
    "links, count, code, words",
    [
        (["left_hand_tcp", "right_hand_tcp"], 1, MoveItErrorCodes.INVALID_LINK_NAME, "one link per pose"),
        (["left_hand_tcp", "left_hand_tcp"], 2, MoveItErrorCodes.INVALID_LINK_NAME, "repeats left_hand_tcp"),
        (["left_hand_tcp", "left_hand"], 2, MoveItErrorCodes.NO_IK_SOLUTION, "share joints"),
        (["left_hand_tcp", "right_link3"], 2, MoveItErrorCodes.NO_IK_SOLUTION, "right_arm (right_hand_tcp)"),
        (["left_hand_tcp", "third_arm"], 2, MoveItErrorCodes.INVALID_LINK_NAME, "third_arm"),
        ([], 1, MoveItErrorCodes.INVALID_LINK_NAME, "left_arm (left_hand_tcp)"),
    ],
)
def test_a_request_for_several_tips_that_cannot_be_solved_is_told_what_it_lacks(
    session: Any, links: list[str], count: int, code: int, words: str
) -> None:
    (pose,) = tips(RobotState(is_diff=True), "left_hand_tcp")
    solve, message = rospy.ServiceProxy("compute_ik", GetPositionIK), ik(ik_link_names=links)
    message.pose_stamped_vector = [pose] * count
    answer, report = report_of(lambda: solve(message), "ik")
    assert answer.error_code.val == code and words in report["reason"]
