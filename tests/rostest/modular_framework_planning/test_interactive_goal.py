# SPDX-License-Identifier: BSD-3-Clause
"""The interactive goal in RViz: this test sends RViz's feedback, and checks the markers that RViz would show."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import DisplayTrajectory, MoveItErrorCodes, PlanningScene, PositionIKRequest, RobotState
from moveit_msgs.srv import ApplyPlanningScene, GetPositionIK
from std_msgs.msg import Empty
from visualization_msgs.msg import InteractiveMarkerFeedback, InteractiveMarkerInit, Marker, MarkerArray

from modular_framework_planning.visualization.interactive_goal import FOLLOW_PERIOD_S, InteractiveGoal
from modular_framework_planning.visualization.move_group_client import planners_of_group
from modular_framework_testing.planning.planning_wire import (
    ARM,
    DOWN,
    OK,
    START,
    FakeArm,
    add,
    box,
    call,
    plan,
    report_of,
    request,
    tip_pose,
    vector,
)

NODE = "/interactive_goal"
WORDS_ABOVE_TIP_M = 0.45
NEAR = (0.1, 0.5, 0.95)
GREEN, RED = (0.2, 0.8, 0.3), (0.9, 0.15, 0.1)

LAST_WORDS = [""]


def until(condition: Callable[[], bool], what: str, timeout_s: float = 30.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline, f"{what}: not within {timeout_s} s; the marker says '{LAST_WORDS[-1]}'"
        time.sleep(0.02)


class Rviz:
    """What RViz knows and says of the marker."""

    def __init__(self) -> None:
        self.marker: Any = None
        self.home: Any = None
        self.ghosts: dict[str, list[Marker]] = {"goal": [], "start": []}
        self.motions: list[DisplayTrajectory] = []
        self.paths: list[list[Marker]] = []
        rospy.Subscriber(f"{NODE}/marker/update_full", InteractiveMarkerInit, self._on_marker)
        for name in self.ghosts:
            rospy.Subscriber(f"{NODE}/{name}_ghost", MarkerArray, self._on_ghost, callback_args=name)
        rospy.Subscriber("/move_group/display_planned_path", DisplayTrajectory, self.motions.append)
        rospy.Subscriber("/move_group/display_planned_path_markers", MarkerArray, self._on_path)
        self._feedback = rospy.Publisher(f"{NODE}/marker/feedback", InteractiveMarkerFeedback, queue_size=10)
        self._panel = {
            name: rospy.Publisher(f"/rviz/moveit/{name}", Empty, queue_size=1)
            for name in ("plan", "execute", "stop", "update_start_state", "update_goal_state")
        }
        self.custom_goal = rospy.Publisher("/rviz/moveit/update_custom_goal_state", RobotState, queue_size=1)
        until(lambda: self.marker is not None, "the marker", 120.0)
        publishers = (self._feedback, self.custom_goal, *self._panel.values())
        until(lambda: all(item.get_num_connections() for item in publishers), "ears for the panel")
        time.sleep(1.0)  # a marker server takes feedback of a second client as a conflict during the first second

    def _on_marker(self, message: InteractiveMarkerInit) -> None:
        if message.markers:
            self.marker = message.markers[0]
            self.home = self.home or self.marker.pose.position

    def _on_ghost(self, message: MarkerArray, name: str) -> None:
        self.ghosts[name] = [item for item in message.markers if item.action == Marker.ADD]
        if name == "goal":
            LAST_WORDS.append(self.status)

    def _on_path(self, message: MarkerArray) -> None:
        self.paths.append([item for item in message.markers if item.action == Marker.ADD])

    def drag(self, pose: Pose) -> None:
        self._say(event_type=InteractiveMarkerFeedback.POSE_UPDATE, pose=pose)

    def select(self, title: str) -> None:
        entry = next(item for item in self.marker.menu_entries if item.title.lstrip("[x ]") == title)
        self._say(event_type=InteractiveMarkerFeedback.MENU_SELECT, menu_entry_id=entry.id, pose=self.marker.pose)

    def entries(self) -> list[str]:
        return [item.title.lstrip("[x ]") for item in self.marker.menu_entries]

    def goal_is_at(self, *place: float) -> bool:
        """Whether the words above the goal are above this place [m]."""
        text = next((item.pose.position for item in self.ghosts["goal"] if item.ns == "status"), None)
        return text is not None and np.allclose([text.x, text.y, text.z - WORDS_ABOVE_TIP_M], place, atol=1e-4)

    def press(self, name: str) -> None:
        self._panel[name].publish(Empty())

    def _say(self, **fields: Any) -> None:
        message = InteractiveMarkerFeedback(client_id="rviz", marker_name="goal", **fields)
        message.header.frame_id = "world"
        self._feedback.publish(message)

    @property
    def status(self) -> str:
        return next((item.text.replace("\n", " ") for item in self.ghosts["goal"] if item.ns == "status"), "")

    @property
    def color(self) -> tuple[float, ...]:
        link = next(item for item in self.ghosts["goal"] if item.ns == "goal")
        return tuple(round(value, 3) for value in (link.color.r, link.color.g, link.color.b))


@pytest.fixture(scope="module")
def arm(ros_session: Any) -> Iterator[FakeArm]:
    arm = FakeArm()
    ros_session.wait_for_service("plan_kinematic_path", 120.0)
    assert plan(request()).error_code.val == OK  # what is made on first use is made now
    ask = PositionIKRequest(group_name="arm_and_manipulator", avoid_collisions=True)
    ask.pose_stamped.header.frame_id, ask.pose_stamped.pose = "world", Pose(Point(*NEAR), DOWN)
    assert call("compute_ik", GetPositionIK, ask).error_code.val == OK
    yield arm
    assert ros_session.answers("/move_group"), ros_session.log()


@pytest.fixture(scope="module")
def rviz(arm: FakeArm) -> Rviz:
    return Rviz()


@pytest.fixture(autouse=True)
def clean(arm: FakeArm, rviz: Rviz) -> None:
    arm.positions.update(zip(ARM, START, strict=True))
    arm.settle()
    assert call("apply_planning_scene", ApplyPlanningScene, PlanningScene(is_diff=False)).success
    rviz.select("Start: follow the robot")
    said = len(LAST_WORDS)
    rviz.press("update_goal_state")
    until(
        lambda: (
            len(LAST_WORDS) > said
            and rviz.status == "goal is free"
            and rviz.goal_is_at(rviz.home.x, rviz.home.y, rviz.home.z)
        ),
        "the goal where the robot is",
    )
    rviz.motions.clear()


def test_the_marker_can_be_dragged_in_six_ways_and_has_a_menu(rviz: Rviz) -> None:
    assert rviz.marker.header.frame_id == "world" and len(rviz.marker.controls) == 7
    titles = [item.title for item in rviz.marker.menu_entries]
    for title in ("Plan", "Execute", "Plan and execute", "Stop", "Random valid goal", "Planner", "Group"):
        assert title in titles
    assert any("RRTConnect" in title for title in titles) and any("arm_and_manipulator" in title for title in titles)


def test_a_dragged_goal_is_planned_to_and_executed_by_the_menu(rviz: Rviz, arm: FakeArm) -> None:
    rviz.drag(Pose(Point(*NEAR), DOWN))
    until(lambda: rviz.goal_is_at(*NEAR) and rviz.color == GREEN, "the dragged goal")
    _, report = report_of(lambda: rviz.select("Plan"), "plan")
    assert report["error_code"] == OK
    until(lambda: rviz.status.startswith("planned"), "the plan")
    until(lambda: bool(rviz.motions), "the planned motion on display")
    assert arm.positions["elbow_joint"] == START[2], "planning does not move the robot"
    end = rviz.motions[-1].trajectory[0].joint_trajectory.points[-1].positions
    until(lambda: {item.ns for item in rviz.paths[-1]} == {"tip", "ghost"}, "the plan: line and hand")
    rviz.paths.clear()
    rviz.select("Execute")
    until(lambda: rviz.status == "executed", "the execution", 60.0)
    assert np.allclose([arm.positions[name] for name in ARM], end, atol=1e-6)
    until(lambda: [{item.ns for item in path} for path in rviz.paths] == [{"tip"}, set()], "a line during the motion")
    until(lambda: not [item for item in rviz.ghosts["goal"] if item.ns == "goal"], "no ghost where the robot stands")
    rviz.select("Execute")
    until(lambda: "nothing is planned" in rviz.status, "the refusal to do it twice")


def test_a_goal_in_collision_is_red_and_says_what_touches(rviz: Rviz) -> None:
    assert add(box("crate", *NEAR, (0.2, 0.2, 0.2)))
    rviz.drag(Pose(Point(*NEAR), DOWN))
    until(lambda: rviz.color == RED and "crate" in rviz.status, "the red goal")
    _, report = report_of(lambda: rviz.select("Plan"), "plan")
    assert report["error_code"] == MoveItErrorCodes.GOAL_IN_COLLISION
    until(lambda: "crate" in rviz.status and "mm deep" in rviz.status, "the reason in words")


def test_a_goal_out_of_reach_is_grey(rviz: Rviz) -> None:
    rviz.drag(Pose(Point(3.0, 0.5, 0.95), DOWN))
    until(lambda: "no inverse kinematics" in rviz.status and len(set(rviz.color)) == 1, "the grey goal")


def test_what_is_no_pose_is_ignored(rviz: Rviz) -> None:
    rviz.drag(Pose(Point(float("nan"), 0.5, 0.95), DOWN))
    rviz.drag(Pose(Point(*NEAR), Quaternion(0, 0, 0, 0)))
    until(lambda: "no inverse kinematics" in rviz.status, "a quaternion of zeros is nowhere")
    rviz.drag(Pose(Point(*NEAR), DOWN))
    until(lambda: rviz.goal_is_at(*NEAR) and rviz.status == "goal is free", "the marker lives")


def test_a_random_goal_is_valid_and_the_marker_goes_there(rviz: Rviz) -> None:
    rviz.select("Random valid goal")
    until(lambda: rviz.status == "random goal" and rviz.color == GREEN, "a random goal")


def test_plan_and_execute_can_be_stopped(rviz: Rviz, arm: FakeArm) -> None:
    state = RobotState(is_diff=True)
    state.joint_state.name, state.joint_state.position = ["shoulder_pan_joint"], [START[0] - 3.0]
    rviz.custom_goal.publish(state)
    until(
        lambda: rviz.status == "goal is free" and not rviz.goal_is_at(rviz.home.x, rviz.home.y, rviz.home.z),
        "the goal from the topic",
    )
    arm.cancelled.clear()
    rviz.select("Plan and execute")
    until(lambda: abs(arm.positions["shoulder_pan_joint"] - START[0]) > 0.05, "the robot moves")
    rviz.select("Stop")
    assert arm.cancelled.wait(20.0)
    until(lambda: "stop" in rviz.status or "cancel" in rviz.status, "the stop in words")


def test_the_topics_of_moveits_panel_are_honoured(rviz: Rviz, arm: FakeArm) -> None:
    rviz.press("update_start_state")
    until(lambda: bool(rviz.ghosts["start"]), "the start's ghost")
    rviz.drag(Pose(Point(*NEAR), DOWN))
    until(lambda: rviz.goal_is_at(*NEAR), "the dragged goal")
    rviz.press("plan")
    until(lambda: rviz.status.startswith("planned"), "the plan")
    rviz.press("execute")
    until(lambda: rviz.status == "executed", "the execution", 60.0)
    assert arm.positions["elbow_joint"] != START[2]
    rviz.select("Start: follow the robot")
    until(lambda: not rviz.ghosts["start"], "no ghost of the start")


def test_the_menu_lists_the_planners_of_the_group(rviz: Rviz) -> None:
    entries = rviz.entries()
    assert "ompl: BITstar" in entries, "a planner the group lists"
    assert "ompl: TRRT" not in entries, "one of the pipeline that the group does not list"
    assert len(entries) == len(set(entries)) and not [entry for entry in entries if "[" in entry], entries
    rviz.select("arm")
    until(lambda: rviz.status == "group: arm", "the other group")
    rviz.select("arm_and_manipulator")
    until(lambda: rviz.status == "group: arm_and_manipulator", "the first group")
    until(lambda: sorted(rviz.entries()) == sorted(entries), "the menu of the first group")


def test_planners_of_a_group_without_a_list_are_those_for_any_group() -> None:
    ids = ["RRT", "PRM", "arm[PRM]", "arm[mine]", "arm_2[RRT]"]
    assert planners_of_group(ids, "arm") == ["PRM", "mine"]
    assert planners_of_group(ids, "hand") == ["RRT", "PRM"]


def test_the_chosen_planner_is_asked_for(rviz: Rviz) -> None:
    title = next(item.title for item in rviz.marker.menu_entries if "RRTstar" in item.title and "Inf" not in item.title)
    rviz.select(title.lstrip("[x ]"))
    until(lambda: rviz.status.startswith("planner:") and "RRTstar" in rviz.status, "the choice")
    rviz.drag(Pose(Point(*NEAR), DOWN))
    until(lambda: rviz.goal_is_at(*NEAR), "the dragged goal")
    _, report = report_of(lambda: rviz.select("Plan"), "plan")
    assert "RRTstar" in report["planner_id"]
    until(lambda: rviz.status.startswith("planned"), "the plan")


def test_the_goal_follows_the_robot_until_it_is_set(arm: FakeArm, ros_launch: Callable[..., Any]) -> None:
    node, shown = "/following_goal", [InteractiveMarkerInit()]
    rospy.Subscriber(f"{node}/marker/update_full", InteractiveMarkerInit, shown.append)
    feedback = rospy.Publisher(f"{node}/marker/feedback", InteractiveMarkerFeedback, queue_size=10)
    ros_launch(
        '<launch><node pkg="modular_framework_planning" type="interactive_goal" name="following_goal">'
        '<param name="group" value="arm_and_manipulator"/></node></launch>'
    )

    def is_at(place: np.ndarray) -> bool:
        markers = shown[-1].markers
        return bool(markers) and bool(np.allclose(vector(markers[0].pose), place, rtol=0.0, atol=1e-3))

    def robot() -> np.ndarray:
        return vector(tip_pose([arm.positions[name] for name in ARM]))

    until(lambda: is_at(robot()), "the marker where the robot is", 120.0)
    arm.positions[ARM[0]] += 0.5
    until(lambda: is_at(robot()), "the marker where the robot is now")
    drag = InteractiveMarkerFeedback(client_id="rviz", marker_name="goal", pose=Pose(Point(*NEAR), DOWN))
    drag.header.frame_id, drag.event_type = "world", InteractiveMarkerFeedback.POSE_UPDATE
    text: list[MarkerArray] = []
    rospy.Subscriber(f"{node}/goal_ghost", MarkerArray, text.append)

    def is_set() -> bool:
        feedback.publish(drag)  # a marker refuses a new client in its first second
        return bool(text) and "goal is free" in [item.text for item in text[-1].markers]

    until(is_set, "the dragged goal")
    drag.event_type = InteractiveMarkerFeedback.MOUSE_UP  # the marker shows where it was dragged to
    feedback.publish(drag)
    until(lambda: is_at(np.array(NEAR)), "the marker where it was dragged to")
    arm.positions[ARM[0]] -= 0.5
    arm.settle()
    time.sleep(3 * FOLLOW_PERIOD_S)
    assert is_at(np.array(NEAR)), "a goal that was set stays when the robot moves"


class WatchedLock:
    """A lock that reports when a thread waits for it."""

    def __init__(self) -> None:
        self._lock, self.awaited = threading.Lock(), threading.Event()
        self.release = self._lock.release

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        if blocking and self._lock.locked():
            self.awaited.set()
        return self._lock.acquire(blocking, timeout)


class GoalWithoutRobot(InteractiveGoal):
    """Its jobs only, which the test gives."""

    def __init__(self, plan: Callable[[], object], execute: Callable[[], object]) -> None:
        self._plan, self._execute = plan, execute
        self._job = WatchedLock()
        self.awaited = self._job.awaited
        self.said: list[str] = []
        self._set_status = self.said.append


def test_a_job_begins_when_the_one_before_has_said_its_last_word_and_not_while_it_works() -> None:
    done, finish = threading.Event(), threading.Event()
    goal = GoalWithoutRobot(lambda: goal.awaited.wait(30.0), lambda: done.set() or finish.wait(30.0))
    goal.plan()
    goal.execute()
    assert done.wait(30.0), goal.said
    goal.plan()
    finish.set()
    assert goal.said[-1] == "not planning: busy; stop first"
