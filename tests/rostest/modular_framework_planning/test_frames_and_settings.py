# SPDX-License-Identifier: BSD-3-Clause
"""Requests in frames that only tf knows, settings that change while the node runs, and what is shown of a plan."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
import rospy
import tf2_ros
from dynamic_reconfigure.client import Client
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, TransformStamped, Vector3
from moveit_msgs.msg import (
    CollisionObject,
    MotionPlanRequest,
    MoveGroupAction,
    MoveGroupGoal,
    MoveItErrorCodes,
    PlanningScene,
    PlanningSceneComponents,
    PositionIKRequest,
)
from moveit_msgs.srv import GetPlanningScene, GetPositionIK
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.planning.planning_wire import (
    ARM,
    DOWN,
    GROUP,
    OK,
    START,
    TIP,
    FakeArm,
    add,
    box,
    call,
    joint_goal,
    plan,
    pose_constraints,
    reports,
    request,
    tip_pose,
    vector,
)
from modular_framework_testing.ros_session import until

UNTURNED = Quaternion(0, 0, 0, 1)
pytestmark = [pytest.mark.usefixtures("clean_scene")]


@pytest.fixture(scope="module")
def broadcaster(session: Any) -> Any:
    return tf2_ros.StaticTransformBroadcaster()


def publish_frame(broadcaster: Any, name: str, place: tuple[float, float, float], parent: str = "world") -> None:
    """Puts a frame on tf and waits until the node knows it."""
    message = TransformStamped(Header(stamp=rospy.Time.now(), frame_id=parent), name, None)
    message.transform.translation, message.transform.rotation = Vector3(*place), UNTURNED
    broadcaster.sendTransform(message)

    def is_known() -> bool:
        frames = call(
            "get_planning_scene", GetPlanningScene, PlanningSceneComponents(PlanningSceneComponents.TRANSFORMS)
        ).scene.fixed_frame_transforms
        found = {item.child_frame_id: item.transform.translation for item in frames}.get(name)
        return found is not None and np.allclose([found.x, found.y, found.z], place)

    until(is_known, f"frame '{name}'")


def places_of_objects() -> dict[str, list[float]]:
    scene = call("get_planning_scene", GetPlanningScene, PlanningSceneComponents(1023)).scene
    return {
        item.id: [item.pose.position.x, item.pose.position.y, item.pose.position.z]
        for item in scene.world.collision_objects
    }


def end_of(answer: Any) -> np.ndarray:
    return vector(tip_pose(answer.trajectory.joint_trajectory.points[-1].positions))


# ---------------------------------------------------------------- frames of tf
def test_goals_objects_and_ik_may_be_given_in_a_frame_that_only_tf_knows(broadcaster: Any) -> None:
    assert (
        plan(request(pose_constraints(0, 0, 0, frame="camera"))).error_code.val
        == MoveItErrorCodes.FRAME_TRANSFORM_FAILURE
    )
    publish_frame(broadcaster, "camera", (0.1, 0.4, 0.9))
    answer = plan(request(pose_constraints(0.0, 0.1, 0.05, frame="camera")))
    assert answer.error_code.val == OK and np.allclose(end_of(answer), (0.1, 0.5, 0.95), atol=1e-5)
    crate = box("crate", 0.3, 0.0, 1.0, (0.1, 0.1, 0.1))
    crate.header.frame_id = "camera"
    assert add(crate) and np.allclose(places_of_objects()["crate"], (0.4, 0.4, 1.9))
    asked = PositionIKRequest(
        group_name=GROUP,
        ik_link_name=TIP,
        pose_stamped=PoseStamped(Header(frame_id="camera"), Pose(Point(0.0, 0.1, 0.05), DOWN)),
    )
    assert call("compute_ik", GetPositionIK, asked).error_code.val == OK


def test_a_frame_that_moves_counts_where_it_is_now(broadcaster: Any) -> None:
    publish_frame(broadcaster, "cart", (0.0, 0.4, 0.9))
    publish_frame(broadcaster, "cart", (0.15, 0.4, 0.9))
    answer = plan(request(pose_constraints(0.0, 0.1, 0.05, frame="cart")))
    assert answer.error_code.val == OK and np.allclose(end_of(answer), (0.15, 0.5, 0.95), atol=1e-5)


def test_an_object_comes_before_a_frame_of_tf_with_its_name(broadcaster: Any) -> None:
    publish_frame(broadcaster, "part", (0.0, 0.3, 0.5))
    part = box("part", 0.0, 0.0, 0.0, (0.04, 0.04, 0.04))
    part.header.frame_id = "part"
    assert add(part) and np.allclose(places_of_objects()["part"], (0.0, 0.3, 0.5)), "placed by tf"
    move = CollisionObject(id="part", operation=CollisionObject.MOVE, pose=Pose(Point(0.1, 0.5, 0.8), UNTURNED))
    move.header.frame_id = "world"
    assert add(move)
    answer = plan(request(pose_constraints(0.0, 0.0, 0.15, frame="part")))
    assert answer.error_code.val == OK and np.allclose(end_of(answer), (0.1, 0.5, 0.95), atol=1e-5)


def test_the_monitored_scene_has_frames_of_tf(broadcaster: Any) -> None:
    with heard("monitored_planning_scene", PlanningScene) as messages:
        until(lambda: messages, "the scene")
        publish_frame(broadcaster, "bench", (1.0, 0.0, 0.0))
        until(
            lambda: [
                item
                for message in messages
                for item in message.fixed_frame_transforms
                if item.child_frame_id == "bench"
            ],
            "the frame",
        )
        assert all(message.is_diff for message in messages[1:])


# ---------------------------------------------------------------- settings
@contextmanager
def heard(topic: str, kind: Any) -> Iterator[list[Any]]:
    messages: list[Any] = []
    subscriber = rospy.Subscriber(f"move_group/{topic}", kind, messages.append)
    try:
        yield messages
    finally:
        subscriber.unregister()


@contextmanager
def adjusted(namespace: str, **values: Any) -> Iterator[dict[str, Any]]:
    """Changes settings for a while; yields what they were."""
    settings = Client(f"/move_group/{namespace}", timeout=30.0)
    before = settings.get_configuration(timeout=30.0)
    now = settings.update_configuration(values)
    assert {name: now[name] for name in values} == values
    try:
        yield before
    finally:
        settings.update_configuration({name: before[name] for name in values})


def behind_a_wall(**changes: Any) -> MotionPlanRequest:
    add(box("wall", -0.11, 0.46, 1.3, (0.15, 0.15, 0.5)))
    message = request(joint_goal(ARM[0], START[0] - 1.2), **changes)
    message.start_state.joint_state.name, message.start_state.joint_state.position = [ARM[0]], [START[0] + 1.2]
    message.start_state.is_diff = True
    return message


def way_of(answer: Any) -> float:
    assert answer.error_code.val == OK
    rows = np.array([point.positions for point in answer.trajectory.joint_trajectory.points])
    return float(np.linalg.norm(np.diff(rows, axis=0), axis=1).sum())


def test_paths_are_shortened_unless_that_is_switched_off() -> None:
    short = way_of(plan(behind_a_wall(allowed_planning_time=30.0)))
    with adjusted("ompl", simplify_solutions=False) as before:
        assert before["simplify_solutions"] is True
        assert way_of(plan(behind_a_wall(allowed_planning_time=30.0))) > 1.05 * short
    assert way_of(plan(behind_a_wall(allowed_planning_time=30.0))) == short, "the same seed, the same path"


def motion(**options: Any) -> MoveGroupGoal:
    goal = MoveGroupGoal(request=request(joint_goal(ARM[0], START[0] - 0.3), allowed_planning_time=30.0))
    for name, value in options.items():
        setattr(goal.planning_options, name, value)
    return goal


def result_of(goal: MoveGroupGoal) -> Any:
    client = SteadyActionClient("move_group", MoveGroupAction)
    assert client.wait_for_server(rospy.Duration(30.0))
    client.send_goal(goal)
    assert client.wait_for_result(rospy.Duration(60.0)), "no result"
    return client.get_result()


def test_what_is_recorded_of_a_motion_is_as_often_as_the_setting_says(arm: FakeArm) -> None:
    with adjusted("plan_execution", record_trajectory_state_frequency=0.0) as before:
        assert before["record_trajectory_state_frequency"] == 50.0, "a parameter of the launch file"
        result = result_of(motion())
        assert result.error_code.val == OK and not result.executed_trajectory.joint_trajectory.points
    with adjusted("plan_execution", record_trajectory_state_frequency=4.0):
        arm.positions[ARM[0]] = START[0]
        arm.settle()
        result = result_of(motion())
    stamps = [point.time_from_start.to_sec() for point in result.executed_trajectory.joint_trajectory.points]
    assert result.error_code.val == OK and len(stamps) >= 3
    assert np.diff(stamps[:-1]).min() >= 0.2, "the last one is that of the end"


def test_a_goal_that_does_not_say_how_often_is_planned_anew_as_often_as_the_setting_says(arm: FakeArm) -> None:
    add(box("wall", -0.11, 0.46, 1.3, (0.15, 0.15, 0.5)))
    goal = motion(replan=True, plan_only=True)
    goal.request = behind_a_wall(allowed_planning_time=1e-4)
    with adjusted("plan_execution", max_replan_attempts=2):
        begun = rospy.get_time()  # reports of requests before may still come

        def count() -> int:
            return len([item for item in reports().heard if item["time"] >= begun])

        reports()
        assert result_of(goal).error_code.val == MoveItErrorCodes.TIMED_OUT
        until(lambda: count() >= 2, "two reports")
        time.sleep(0.3)
        assert count() == 2


def test_the_monitored_scene_is_silent_while_it_is_switched_off_and_whole_afterwards() -> None:
    with heard("monitored_planning_scene", PlanningScene) as messages:
        until(lambda: messages, "the scene")
        with adjusted("planning_scene_monitor", publish_planning_scene=False):
            time.sleep(0.5)  # until pending messages have arrived
            assert add(box("crate", 0.5, 0.4, 1.5, (0.1, 0.1, 0.1)))
            time.sleep(0.5)
            assert not [message for message in messages if message.world.collision_objects]
        until(lambda: [message for message in messages if message.world.collision_objects], "the crate")
        scene = next(message for message in messages if message.world.collision_objects)
        assert not scene.is_diff and [item.id for item in scene.world.collision_objects] == ["crate"]


def test_a_parameter_of_the_wrong_type_is_named_and_its_default_used(session: Any) -> None:
    error = next(line for line in session.log().splitlines() if "max_attempted_states_per_pose' is 'many'" in line)
    assert "allowed: a whole number, at least 1 and at most 100" in error and "4 is used" in error
    with adjusted("pick_place", cartesian_motion_step_size=0.02) as before:
        assert before["max_attempted_states_per_pose"] == 4 and before["cartesian_motion_step_size"] == 0.005


# ---------------------------------------------------------------- what is shown
def test_contacts_that_made_a_plan_fail_are_shown_until_the_next_plan() -> None:
    add(box("lid", 0.1, 0.5, 0.95, (0.2, 0.2, 0.1)))
    with heard("display_contacts", MarkerArray) as messages:
        assert plan(request()).error_code.val == MoveItErrorCodes.GOAL_IN_COLLISION
        until(lambda: messages and len(messages[-1].markers) > 1, "contacts")
        first, *balls = messages[-1].markers
        assert first.action == Marker.DELETEALL and {ball.type for ball in balls} == {Marker.SPHERE}
        assert all("lid" in ball.ns and ball.header.frame_id == "world" for ball in balls)
        for ball in balls:
            place = ball.pose.position
            assert np.all(np.abs(np.array([place.x - 0.1, place.y - 0.5, place.z - 0.95])) < (0.11, 0.11, 0.06))
        add(CollisionObject(id="lid", operation=CollisionObject.REMOVE))
        assert plan(request()).error_code.val == OK
        until(lambda: len(messages[-1].markers) == 1, "their end")


def test_the_newest_planned_path_is_shown_also_to_those_who_look_later() -> None:
    def tip(answer: Any) -> tuple[float, float, float]:
        path = answer.trajectory.joint_trajectory
        return tuple(vector(tip_pose([path.points[-1].positions[path.joint_names.index(name)] for name in ARM])))

    def is_shown(messages: list[MarkerArray], place: tuple[float, float, float]) -> bool:
        lines = [marker for marker in messages[-1].markers if marker.type == Marker.LINE_STRIP] if messages else []
        ends = [(line.points[-1].x, line.points[-1].y, line.points[-1].z) for line in lines]
        return len(ends) == 1 and ends[0] == pytest.approx(place, abs=1e-6)

    first, second = (plan(request(joint_goal(ARM[0], START[0] + turn))) for turn in (-0.8, 0.4))
    assert tip(first) != pytest.approx(tip(second), abs=0.1)
    with heard("display_planned_path_markers", MarkerArray) as messages:
        until(lambda: is_shown(messages, tip(second)), "the path planned before")
        third = plan(request(joint_goal(ARM[0], START[0] - 0.5)))
        until(lambda: is_shown(messages, tip(third)), "the next path")
        with heard("display_planned_path_markers", MarkerArray) as others:
            until(lambda: is_shown(others, tip(third)), "the newest path")


def test_requests_are_published_where_the_launch_file_asks_for_it() -> None:
    assert plan(request(planner_id="RRTConnect")).error_code.val == OK
    with heard("motion_plan_request", MotionPlanRequest) as messages:  # latched
        until(lambda: messages, "the request")
        assert messages[-1].planner_id == "RRTConnect" and messages[-1].group_name == GROUP
