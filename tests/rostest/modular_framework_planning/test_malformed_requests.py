# SPDX-License-Identifier: BSD-3-Clause
"""Whatever is sent to any endpoint of move_group, it answers with a refusal or ignores it, and works on."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import pytest
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    ExecuteTrajectoryAction,
    ExecuteTrajectoryGoal,
    JointConstraint,
    MoveGroupAction,
    MoveGroupGoal,
    MoveGroupSequenceAction,
    MoveItErrorCodes,
    PickupAction,
    PlaceAction,
    PlanningScene,
    PlanningSceneComponents,
    PlanningSceneWorld,
)
from moveit_msgs.srv import (
    ApplyPlanningScene,
    GetCartesianPath,
    GetMotionPlan,
    GetMotionSequence,
    GetPlannerParams,
    GetPlanningScene,
    GetPositionFK,
    GetPositionIK,
    GetStateValidity,
    QueryPlannerInterfaces,
    SetPlannerParams,
)
from nonsense import STYLES, nonsense
from sensor_msgs.msg import JointState
from shape_msgs.msg import Mesh, MeshTriangle
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.planning.planning_wire import (
    ARM,
    DOWN,
    GROUP,
    OK,
    FakeArm,
    call,
    joint_goal,
    plan,
    report_of,
    request,
)
from modular_framework_testing.ros_session import until

MILLION, MANY = 1_000_000, 100_000
SERVICES = {
    "plan_kinematic_path": GetMotionPlan,
    "compute_cartesian_path": GetCartesianPath,
    "compute_ik": GetPositionIK,
    "compute_fk": GetPositionFK,
    "check_state_validity": GetStateValidity,
    "query_planner_interface": QueryPlannerInterfaces,
    "get_planner_params": GetPlannerParams,
    "set_planner_params": SetPlannerParams,
    "get_planning_scene": GetPlanningScene,
    "apply_planning_scene": ApplyPlanningScene,
    "plan_sequence_path": GetMotionSequence,
}
ACTIONS = {
    "move_group": MoveGroupAction,
    "execute_trajectory": ExecuteTrajectoryAction,
    "pickup": PickupAction,
    "place": PlaceAction,
    "sequence_move_group": MoveGroupSequenceAction,
}
TOPICS = {
    "joint_states": JointState,
    "planning_scene": PlanningScene,
    "planning_scene_world": PlanningSceneWorld,
    "collision_object": CollisionObject,
    "attached_collision_object": AttachedCollisionObject,
    "trajectory_execution_event": String,
}
WITHOUT_CODE = {"get_planner_params", "set_planner_params"}  # a refusal can only be the failure of the call
ALWAYS_ANSWERED = {"query_planner_interface", "get_planner_params", "set_planner_params", "get_planning_scene"}
MEANS_SOMETHING = {
    ("apply_planning_scene", "nothing"),
    ("check_state_validity", "nothing"),  # clear; ask for all
    ("execute_trajectory", "nothing"),
    ("sequence_move_group", "nothing"),  # nothing to do is done
    ("plan_sequence_path", "nothing"),
}


@pytest.fixture(scope="module", autouse=True)
def session(ros_session: Any) -> Iterator[Any]:
    ros_session.wait_for_service("plan_kinematic_path", 120.0)
    FakeArm()
    time.sleep(0.2)
    assert plan(request(joint_goal("shoulder_pan_joint", 1.0))).error_code.val == OK
    yield ros_session
    assert ros_session.answers("/move_group"), ros_session.log()


@pytest.fixture(autouse=True)
def still_works(session: Any) -> Iterator[None]:
    yield
    assert session.answers("/move_group"), session.log()
    assert call("apply_planning_scene", ApplyPlanningScene, PlanningScene(is_diff=False)).success
    assert plan(request(joint_goal("shoulder_pan_joint", 1.0))).error_code.val == OK


def code_of(answer: Any) -> int | None:
    """The error code of any answer; none where its type has none."""
    for name in ("motion_plan_response", "response"):
        answer = getattr(answer, name, answer)
    return answer.error_code.val if hasattr(answer, "error_code") else None


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("name", SERVICES)
def test_services_answer_nonsense_with_a_refusal(name: str, style: str) -> None:
    kind = SERVICES[name]
    try:
        answer = call(name, kind, nonsense(kind._request_class, STYLES[style]))
    except rospy.ServiceException:
        assert name in WITHOUT_CODE, "an answer without a code where the type has one"
        return
    if name in ALWAYS_ANSWERED or (name, style) in MEANS_SOMETHING:
        return
    code = code_of(answer)
    assert (
        code not in (0, OK)
        if code is not None
        else not (getattr(answer, "success", answer) is True or getattr(answer, "valid", False))
    )


@pytest.fixture(scope="module")
def clients(session: Any) -> dict[str, Any]:
    made = {name: SteadyActionClient(name, kind) for name, kind in ACTIONS.items()}
    for name, client in made.items():
        assert client.wait_for_server(rospy.Duration(20.0)), name
    return made


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("name", ACTIONS)
def test_actions_answer_nonsense_with_a_refusal(clients: dict[str, Any], name: str, style: str) -> None:
    goal_class = type(ACTIONS[name]().action_goal.goal)
    clients[name].send_goal(nonsense(goal_class, STYLES[style]))
    assert clients[name].wait_for_result(rospy.Duration(20.0)), "no result"
    code = code_of(clients[name].get_result())
    assert code != 0 and (code != OK or (name, style) in MEANS_SOMETHING)


@pytest.mark.parametrize("name", TOPICS)
def test_nonsense_on_topics_is_ignored(session: Any, name: str) -> None:
    publisher = rospy.Publisher(name, TOPICS[name], queue_size=100)
    until(publisher.get_num_connections, f"a listener to {name}")
    for style in set(STYLES) - {"nothing"}:
        publisher.publish(nonsense(TOPICS[name], STYLES[style]))
    if name == "joint_states":
        publisher.publish(JointState(name=ARM, position=[float("nan")] * 6))
        publisher.publish(JointState(name=ARM, position=[0.0]))
    time.sleep(0.5)
    scene = call("get_planning_scene", GetPlanningScene, PlanningSceneComponents(1023)).scene
    assert not scene.world.collision_objects and not scene.robot_state.attached_collision_objects
    if name != "joint_states" or "ignored" in session.log():
        assert "ignored" in session.log() or "not known" in session.log(), "the reason is logged"


def execute(goal: ExecuteTrajectoryGoal, clients: dict[str, Any]) -> tuple[Any, dict[str, Any]]:
    def work() -> Any:
        clients["execute_trajectory"].send_goal(goal)
        assert clients["execute_trajectory"].wait_for_result(rospy.Duration(120.0))
        return clients["execute_trajectory"].get_result()

    return report_of(work)


def test_a_trajectory_of_a_million_points_is_judged_like_a_short_one(clients: dict[str, Any]) -> None:
    goal = ExecuteTrajectoryGoal()
    goal.trajectory.joint_trajectory.joint_names = ["elbow_joint"]
    goal.trajectory.joint_trajectory.points = [JointTrajectoryPoint(positions=[0.0])] * MILLION
    result, report = execute(goal, clients)
    assert result.error_code.val == MoveItErrorCodes.INVALID_MOTION_PLAN and "strictly increase" in report["reason"]


@pytest.mark.parametrize("times", [(-1.0, 1.0), (0.0, -2.0), (1.0, 1.0)])
def test_times_that_go_back_are_refused(clients: dict[str, Any], times: tuple[float, float]) -> None:
    goal = ExecuteTrajectoryGoal()
    goal.trajectory.joint_trajectory.joint_names = ARM
    goal.trajectory.joint_trajectory.points = [
        JointTrajectoryPoint(positions=[0.0] * 6, time_from_start=rospy.Duration.from_sec(stamp)) for stamp in times
    ]
    result, report = execute(goal, clients)
    assert result.error_code.val == MoveItErrorCodes.INVALID_MOTION_PLAN and "point" in report["reason"]


def test_a_hundred_thousand_waypoints_get_an_answer() -> None:
    far = Pose(Point(5.0, 0.0, 1.0), DOWN)
    message = GetCartesianPath._request_class(
        group_name=GROUP, link_name="eg_manipulator", max_step=0.01, waypoints=[far] * MANY
    )
    message.header.frame_id = "world"
    message.start_state.is_diff = True
    answer = call("compute_cartesian_path", GetCartesianPath, message)
    assert answer.fraction < 0.01


def test_a_hundred_thousand_constraints_get_an_answer() -> None:
    constraint = joint_goal("elbow_joint", 100.0)
    constraint.joint_constraints = [JointConstraint(joint_name="elbow_joint", position=100.0)] * MANY
    assert plan(request(constraint)).error_code.val not in (0, OK)


def test_a_mesh_of_a_million_corners_that_are_none_is_refused() -> None:
    mesh = Mesh(vertices=[Point(float("nan"), 0, 0)] * MILLION, triangles=[MeshTriangle([0, 1, 2])])
    scene = PlanningScene(is_diff=True)
    scene.world.collision_objects = [
        CollisionObject(id="mesh", meshes=[mesh], mesh_poses=[Pose(Point(), Quaternion(0, 0, 0, 1))])
    ]
    assert not call("apply_planning_scene", ApplyPlanningScene, scene).success


def test_counts_without_end_can_be_cancelled(clients: dict[str, Any]) -> None:
    goal = MoveGroupGoal(
        request=request(joint_goal("elbow_joint", 1.0), num_planning_attempts=2**31 - 1, allowed_planning_time=1e-3)
    )
    goal.planning_options.plan_only = goal.planning_options.replan = True
    goal.planning_options.replan_attempts = 2**31 - 1
    goal.request.pipeline_id = "nobody"
    clients["move_group"].send_goal(goal)
    time.sleep(0.3)
    clients["move_group"].cancel_goal()
    assert clients["move_group"].wait_for_result(rospy.Duration(20.0))
    assert code_of(clients["move_group"].get_result()) not in (0, OK)
