# SPDX-License-Identifier: BSD-3-Clause
"""A config package as the MoveIt Setup Assistant writes it launches, plans and executes as it is."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy

import moveit_commander
import numpy as np
import pytest
import rosgraph
import rospy
from geometry_msgs.msg import Pose, Quaternion
from moveit_commander import MoveGroupCommander
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    Constraints,
    JointConstraint,
    MotionPlanRequest,
    MoveItErrorCodes,
    PlanningScene,
    PlanningSceneComponents,
    PositionIKRequest,
    RobotState,
)
from moveit_msgs.srv import (
    ApplyPlanningScene,
    GetMotionPlan,
    GetPlanningScene,
    GetPositionFK,
    GetPositionIK,
    GetStateValidity,
)
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import Header

from modular_framework_testing.ros_session import until

READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
REACHING = [0.6, 0.3, 0.0, -1.7, 0.0, 2.0, 0.785]


@pytest.fixture(scope="module")
def demo(user_packages: Path, ros_launch: Callable[..., Any]) -> Iterator[Any]:
    demo_launch = user_packages / "panda_moveit_config" / "launch" / "demo.launch"
    session = ros_launch(demo_launch, use_rviz="false", db="true")
    session.wait_for_service("plan_kinematic_path", 120.0)
    yield session
    assert session.alive(), session.log()


@pytest.fixture(scope="module")
def arm(demo: Any) -> MoveGroupCommander:
    return commander("panda_arm")


def commander(group: str) -> MoveGroupCommander:
    group = MoveGroupCommander(group, wait_for_servers=30.0)
    group.set_max_velocity_scaling_factor(1.0)
    group.set_max_acceleration_scaling_factor(1.0)
    return group


def test_the_package_knows_nothing_of_this_project(user_packages: Path) -> None:
    folder = user_packages / "panda_moveit_config"
    texts = [path.read_text() for path in (*folder.glob("launch/*"), *folder.glob("config/*"))]
    assert len(texts) > 25
    assert not [text for text in texts if "modular_framework" in text]


def test_a_database_that_is_asked_for_is_refused_by_name_and_the_rest_starts(demo: Any) -> None:
    until(lambda: "mongo_wrapper_ros.py, requested by db:=true, is refused" in demo.log(), "the refusal")
    assert "ConstraintsStorage" in demo.log() and demo.alive()


def test_the_robot_starts_where_fake_controllers_put_it(arm: MoveGroupCommander) -> None:
    assert arm.get_current_joint_values() == pytest.approx(READY)
    assert commander("hand").get_current_joint_values() == pytest.approx([0.035, 0.035]), "the mirrored finger follows"


def test_a_motion_is_planned_and_executed(arm: MoveGroupCommander) -> None:
    arm.set_named_target("reaching")
    worked, trajectory, _, _ = arm.plan()
    assert worked
    states: list[JointState] = []
    listener = rospy.Subscriber("move_group/fake_controller_joint_states", JointState, states.append)
    until(lambda: states, "the connection, which brings the latched positions")
    begun = time.monotonic()
    assert arm.execute(trajectory)
    duration_s = trajectory.joint_trajectory.points[-1].time_from_start.to_sec()
    assert time.monotonic() - begun >= duration_s, "a fake robot takes its time"
    names = trajectory.joint_trajectory.joint_names
    until(
        lambda: any(state.name == names and np.allclose(state.position, REACHING, atol=1e-3) for state in list(states)),
        "the last state of the motion",
    )
    listener.unregister()
    assert arm.get_current_joint_values() == pytest.approx(REACHING, abs=1e-3)
    travelled = np.array([state.position for state in states if state.name == names])
    assert len(travelled) > 5 and np.allclose(travelled[-1], REACHING, atol=1e-3)


def test_a_pose_is_reached(arm: MoveGroupCommander) -> None:
    pose = arm.get_current_pose()
    pose.pose.position.z += 0.05
    arm.set_pose_target(pose)
    assert arm.go()
    reached = arm.get_current_pose().pose.position
    assert [reached.x, reached.y, reached.z] == pytest.approx(
        [pose.pose.position.x, pose.pose.position.y, pose.pose.position.z], abs=2e-3
    )


@pytest.mark.parametrize(("held", "tolerance"), [(1, 0.1), (2, 0.01), (4, 0.001)])
def test_ik_of_seven_joints_keeps_joint_constraints(arm: MoveGroupCommander, held: int, tolerance: float) -> None:
    rng = np.random.default_rng(held)
    joints = arm.get_active_joints()
    solve, place = (
        rospy.ServiceProxy(name, kind) for name, kind in (("compute_ik", GetPositionIK), ("compute_fk", GetPositionFK))
    )
    for _ in range(25):
        values = dict(zip(joints, arm.get_random_joint_values(), strict=True))
        state = RobotState(joint_state=JointState(name=joints, position=list(values.values())), is_diff=True)
        pose = place(Header(frame_id="panda_link0"), ["panda_link8"], state).pose_stamped[0]
        kept = {name: values[name] for name in rng.choice(joints, held, replace=False)}
        request = PositionIKRequest(group_name="panda_arm", pose_stamped=pose, timeout=rospy.Duration(1.0))
        request.constraints.joint_constraints = [
            JointConstraint(name, value, tolerance, tolerance, 1.0) for name, value in kept.items()
        ]
        answer = solve(request)
        assert answer.error_code.val == MoveItErrorCodes.SUCCESS, (values, kept)
        found = dict(zip(answer.solution.joint_state.name, answer.solution.joint_state.position, strict=True))
        assert all(abs(found[name] - value) < tolerance + 2e-6 for name, value in kept.items())
        reached = place(Header(frame_id="panda_link0"), ["panda_link8"], answer.solution).pose_stamped[0].pose
        assert [reached.position.x, reached.position.y, reached.position.z] == pytest.approx(
            [pose.pose.position.x, pose.pose.position.y, pose.pose.position.z], abs=3e-6
        )


def test_the_hand_closes_and_arm_and_hand_move_together(demo: Any) -> None:
    hand, both = commander("hand"), commander("panda_arm_hand")
    hand.set_joint_value_target({"panda_finger_joint1": 0.03})
    assert hand.go()
    assert hand.get_current_joint_values() == pytest.approx([0.03, 0.03], abs=1e-3)
    both.set_joint_value_target(
        {**{f"panda_joint{n + 1}": value for n, value in enumerate(READY)}, "panda_finger_joint1": 0.02}
    )
    assert both.go()
    assert both.get_current_joint_values() == pytest.approx([*READY, 0.02, 0.02], abs=1e-3)


def test_both_fingers_may_be_named_in_a_goal(demo: Any) -> None:
    hand = commander("hand")
    ask = rospy.ServiceProxy("plan_kinematic_path", GetMotionPlan)

    def plan(**fingers: float) -> Any:
        request = MotionPlanRequest(group_name="hand", num_planning_attempts=1, allowed_planning_time=20.0)
        request.start_state.is_diff = True
        request.goal_constraints = [
            Constraints(
                joint_constraints=[
                    JointConstraint(name, position, 1e-4, 1e-4, 1.0) for name, position in fingers.items()
                ]
            )
        ]
        return ask(request).motion_plan_response

    for fingers in ({"panda_finger_joint1": 0.01, "panda_finger_joint2": 0.01}, {"panda_finger_joint2": 0.01}):
        answer = plan(**fingers)
        assert answer.error_code.val == MoveItErrorCodes.SUCCESS
        assert answer.trajectory.joint_trajectory.joint_names == ["panda_finger_joint1"]
        assert answer.trajectory.joint_trajectory.points[-1].positions == pytest.approx([0.01], abs=2e-4)
    assert (
        plan(panda_finger_joint1=0.01, panda_finger_joint2=0.02).error_code.val
        == MoveItErrorCodes.INVALID_GOAL_CONSTRAINTS
    )
    hand.set_joint_value_target({"panda_finger_joint2": 0.025})
    assert hand.go()
    assert hand.get_current_joint_values() == pytest.approx([0.025, 0.025], abs=1e-3)


def test_a_motion_succeeds_whose_end_joint_states_shows_late(arm: MoveGroupCommander, demo: Any) -> None:
    here = arm.get_current_joint_values()
    arm.set_joint_value_target([here[0] - 0.1, *here[1:]])
    worked, trajectory, _, _ = arm.plan()
    assert worked and trajectory.joint_trajectory.points[-1].time_from_start.to_sec() < 1.0
    uri = rosgraph.Master("/test").lookupNode("/joint_state_publisher")
    publisher = int(ServerProxy(uri).getPid("/test")[2])
    os.kill(publisher, signal.SIGSTOP)
    threading.Timer(2.5, os.kill, (publisher, signal.SIGCONT)).start()
    assert arm.execute(trajectory), demo.log()
    assert arm.get_current_joint_values()[0] == pytest.approx(here[0] - 0.1, abs=1e-3)


def test_a_stop_leaves_the_robot_on_its_way(arm: MoveGroupCommander) -> None:
    arm.set_joint_value_target(READY)
    assert arm.go()
    arm.set_max_velocity_scaling_factor(0.2)
    arm.set_named_target("reaching")
    assert arm.go(wait=False)
    deadline = time.monotonic() + 30.0
    while np.allclose(arm.get_current_joint_values(), READY, atol=0.02):
        assert time.monotonic() < deadline, "the motion has not begun"
    arm.stop()
    places = [[], arm.get_current_joint_values()]
    while places[-1] != places[-2]:
        assert time.monotonic() < deadline + 30.0, "the robot does not stop"
        time.sleep(0.5)
        places.append(arm.get_current_joint_values())
    assert not np.allclose(places[-1], REACHING, atol=0.05)
    arm.set_max_velocity_scaling_factor(1.0)


def test_a_coarse_link_is_checked_against_the_links_that_are_enabled_only(arm: MoveGroupCommander) -> None:
    read = rospy.ServiceProxy("get_planning_scene", GetPlanningScene)
    matrix = read(
        PlanningSceneComponents(PlanningSceneComponents.ALLOWED_COLLISION_MATRIX)
    ).scene.allowed_collision_matrix
    assert (matrix.default_entry_names, matrix.default_entry_values) == (["panda_hand_sc"], [True])
    coarse = matrix.entry_values[matrix.entry_names.index("panda_hand_sc")].enabled
    assert [name for name, allowed in zip(matrix.entry_names, coarse, strict=True) if not allowed] == ["panda_link1"]
    held = AttachedCollisionObject(link_name="panda_hand", touch_links=["panda_leftfinger", "panda_rightfinger"])
    held.object.id, held.object.header.frame_id = "cube", "panda_hand"
    held.object.pose.position.z, held.object.pose.orientation.w = 0.11, 1.0
    held.object.primitives = [SolidPrimitive(SolidPrimitive.BOX, [0.04, 0.04, 0.04])]
    held.object.primitive_poses = [Pose(orientation=Quaternion(0.0, 0.0, 0.0, 1.0))]
    change = PlanningScene(is_diff=True)
    change.robot_state.is_diff = True
    change.robot_state.attached_collision_objects = [held]
    apply = rospy.ServiceProxy("apply_planning_scene", ApplyPlanningScene)
    assert apply(change).success
    check = rospy.ServiceProxy("check_state_validity", GetStateValidity)
    answer = check(RobotState(is_diff=True), "", Constraints())
    assert answer.valid, answer.contacts
    change.robot_state.attached_collision_objects = []
    change.allowed_collision_matrix.default_entry_names = ["panda_hand_sc"]
    for allowed in (False, True):
        change.allowed_collision_matrix.default_entry_values = [allowed]
        assert apply(change).success
        assert check(RobotState(is_diff=True), "", Constraints()).valid == allowed
    held.object.operation = CollisionObject.REMOVE
    change.robot_state.attached_collision_objects = [held]
    change.world.collision_objects = [CollisionObject(id="cube", operation=CollisionObject.REMOVE)]
    assert apply(change).success


def test_a_start_elsewhere_is_refused(arm: MoveGroupCommander, demo: Any) -> None:
    arm.set_named_target("ready")
    worked, trajectory, _, _ = arm.plan()
    assert worked
    for point in trajectory.joint_trajectory.points:
        point.positions = [value + 0.2 for value in point.positions]
    assert not arm.execute(trajectory)
    assert "allowed_start_tolerance 0.01" in demo.log()
    arm.set_named_target("ready")
    assert arm.go()


def test_every_planner_of_the_package_is_offered_or_refused_with_a_reason(arm: MoveGroupCommander) -> None:
    offered = arm.get_interface_description()
    assert "RRTConnect" in offered.planner_ids
    for pipeline in ("ompl", "chomp"):
        arm.set_planning_pipeline_id(pipeline)
        arm.set_named_target("reaching")
        worked, _, _, code = arm.plan()
        assert worked == (pipeline == "ompl")
        assert (code.val == MoveItErrorCodes.SUCCESS) == worked
    arm.set_planning_pipeline_id("")


def test_nodes_and_names_are_those_clients_look_for(demo: Any) -> None:
    publishers, _, services = rosgraph.Master("/test").getSystemState()
    assert {
        "/move_group/monitored_planning_scene",
        "/move_group/display_planned_path",
        "/move_group/fake_controller_joint_states",
        "/joint_states",
        "/tf",
        "/tf_static",
    } <= {name for name, _ in publishers}
    assert {
        "/plan_kinematic_path",
        "/compute_ik",
        "/compute_fk",
        "/get_planning_scene",
        "/apply_planning_scene",
        "/clear_octomap",
        "/query_planner_interface",
        "/check_state_validity",
    } <= {name for name, _ in services}


@pytest.fixture(scope="module", autouse=True)
def commanders() -> Iterator[None]:
    yield
    moveit_commander.roscpp_shutdown()
