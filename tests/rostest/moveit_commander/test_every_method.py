# SPDX-License-Identifier: BSD-3-Clause
"""Every public method of moveit_commander is driven against move_group with a config package as users have it.

The last test compares what was called with what the classes offer: a method added later fails here until it is driven.
"""

from __future__ import annotations

import functools
import inspect
import math
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import genpy
import moveit_commander
import numpy as np
import pytest
import rospy
import trimesh
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Vector3, Vector3Stamped
from moveit_commander import (
    ConstraintsStorage,
    MoveGroupCommander,
    MoveGroupCommandInterpreter,
    MoveGroupInfoLevel,
    MoveItCommanderException,
    PlanningSceneInterface,
    RobotCommander,
    conversions,
)
from moveit_msgs.msg import (
    Constraints,
    Grasp,
    GripperTranslation,
    MoveItErrorCodes,
    OrientationConstraint,
    PlanningScene,
    PlanningSceneComponents,
    RobotState,
    TrajectoryConstraints,
)
from moveit_msgs.srv import GetPlannerParams, GetPositionFK, SetPlannerParams
from std_msgs.msg import Header
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_testing.ros_session import until

CLASSES = (
    RobotCommander,
    RobotCommander.Joint,
    RobotCommander.Link,
    MoveGroupCommander,
    PlanningSceneInterface,
    MoveGroupCommandInterpreter,
)
READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
FINGERS = ["panda_leftfinger", "panda_rightfinger", "panda_hand"]
DOWN = Quaternion(0.9238795, -0.3826834, 0.0, 0.0)  # the hand looks down, its fingers open along y
driven: set[tuple[str, str]] = set()


def pose_of(link: str, state: RobotState) -> Pose:
    """Where a link is in a state of the robot."""
    answer = rospy.ServiceProxy("compute_fk", GetPositionFK)(Header(), [link], state)
    assert answer.error_code.val == MoveItErrorCodes.SUCCESS
    return answer.pose_stamped[0].pose


def public_methods(kind: type) -> dict[str, Any]:
    return {
        name: inspect.getattr_static(kind, name)
        for name in dir(kind)
        if not name.startswith("_") and callable(getattr(kind, name)) and not inspect.isclass(getattr(kind, name))
    }


def recorded(kind: type, name: str, method: Any) -> Any:
    """The method, noting that it was called and has answered."""
    plain = method.__func__ if isinstance(method, staticmethod) else method

    @functools.wraps(plain)
    def call(*arguments: Any, **named: Any) -> Any:
        answer = plain(*arguments, **named)
        driven.add((kind.__name__, name))
        return answer

    return staticmethod(call) if isinstance(method, staticmethod) else call


@pytest.fixture(scope="module", autouse=True)
def session(user_packages: Path, ros_launch: Callable[..., Any]) -> Iterator[Any]:
    with pytest.MonkeyPatch.context() as patch:
        for kind in CLASSES:
            for name, method in public_methods(kind).items():
                patch.setattr(kind, name, recorded(kind, name, method), raising=True)
        session = ros_launch(user_packages / "panda_moveit_config" / "launch" / "demo.launch", use_rviz="false")
        session.wait_for_service("plan_kinematic_path", 120.0)
        moveit_commander.roscpp_initialize(["test"])
        yield session
        assert session.alive(), session.log()
        moveit_commander.roscpp_shutdown()


@pytest.fixture(scope="module")
def robot(session: Any) -> RobotCommander:
    return RobotCommander()


@pytest.fixture(scope="module")
def arm(robot: RobotCommander) -> MoveGroupCommander:
    arm = MoveGroupCommander("panda_arm", wait_for_servers=30.0)
    arm.set_max_velocity_scaling_factor(1.0)
    arm.set_max_acceleration_scaling_factor(1.0)
    return arm


@pytest.fixture(scope="module")
def scene(session: Any) -> PlanningSceneInterface:
    return PlanningSceneInterface(synchronous=True)


def stamped(x: float, y: float, z: float, orientation: Quaternion | None = None) -> PoseStamped:
    return PoseStamped(Header(frame_id="world"), Pose(Point(x, y, z), orientation or Quaternion(0, 0, 0, 1)))


def place_of(pose: PoseStamped) -> list[float]:
    return conversions.pose_to_list(pose.pose)[:3]


def at_rest(arm: MoveGroupCommander) -> bool:
    """Whether no joint moves within a fifth of a second."""
    before = arm.get_current_joint_values()
    time.sleep(0.2)
    return arm.get_current_joint_values() == pytest.approx(before, abs=1e-4)


# ---------------------------------------------------------------- the robot
def test_the_robot(robot: RobotCommander) -> None:
    assert robot.get_robot_name() == "panda" and robot.get_planning_frame() == "panda_link0"
    assert robot.get_root_link() == "panda_link0"
    assert robot.get_group_names() == ["hand", "panda_arm", "panda_arm_hand"] and robot.has_group("hand")
    assert robot.get_active_joint_names("panda_arm") == [f"panda_joint{number}" for number in range(1, 8)]
    assert "panda_finger_joint2" in robot.get_joint_names() and "panda_hand" in robot.get_link_names("hand")
    assert robot.get_default_owner_group("panda_joint3") == "panda_arm"
    assert robot.get_current_state().joint_state.name
    assert robot.get_current_variable_values()["panda_joint4"] == pytest.approx(-2.356)
    assert robot.get_group("hand").get_name() == "hand"
    assert {marker.ns for marker in robot.get_robot_markers().markers} >= {"panda_link3", "panda_hand"}


def test_a_joint_and_a_link(robot: RobotCommander) -> None:
    joint, link = robot.get_joint("panda_joint1"), robot.get_link("panda_link1")
    assert (joint.name(), joint.variable_count()) == ("panda_joint1", 1)
    assert joint.bounds() == [joint.min_bound(), joint.max_bound()] == pytest.approx([-2.8973, 2.8973])
    assert joint.move(0.2) and joint.value() == pytest.approx(0.2, abs=1e-3)
    assert joint.move(0.0)
    assert link.name() == "panda_link1" and place_of(link.pose()) == pytest.approx([0.0, 0.0, 0.333])


# ---------------------------------------------------------------- a group: its state and its settings
def test_what_a_group_knows(arm: MoveGroupCommander) -> None:
    assert arm.get_name() == "panda_arm" and arm.get_planning_frame() == "panda_link0"
    assert arm.get_variable_count() == 7 and arm.get_variable_names()[0] == "panda_joint1"
    assert arm.get_active_joints() == [f"panda_joint{number}" for number in range(1, 8)]
    assert set(arm.get_active_joints()) <= set(arm.get_joints())
    assert arm.has_end_effector_link() and arm.get_end_effector_link() == "panda_link8"
    arm.set_end_effector_link("panda_hand")
    arm.set_end_effector_link("panda_link8")
    arm.set_pose_reference_frame("panda_link0")
    assert arm.get_pose_reference_frame() == "panda_link0"
    arm.set_pose_reference_frame("world")
    assert arm.get_interface_description().planner_ids
    assert arm.get_current_joint_values() == pytest.approx(READY, abs=1e-3)
    assert place_of(arm.get_current_pose()) == pytest.approx([0.307, 0.0, 0.59], abs=1e-3)
    assert arm.get_current_rpy()[0] == pytest.approx(math.pi, abs=1e-2) or arm.get_current_rpy()[0] < -3.1
    assert arm.get_current_state_bounded().joint_state.name == arm.get_current_state().joint_state.name
    assert arm.enforce_bounds(arm.get_current_state()).joint_state.name
    with pytest.raises(genpy.DeserializationError, match="names no joint"):
        arm.enforce_bounds(RobotState())
    state = arm.get_current_state()
    assert state.joint_state.header.stamp == state.multi_dof_joint_state.header.stamp == rospy.Time(0)
    assert len(arm.get_random_joint_values()) == 7 and arm.get_random_pose().header.frame_id == "panda_link0"
    assert np.array(arm.get_jacobian_matrix(READY)).shape == (6, 7)
    assert arm.get_known_constraints() == []


def test_settings(arm: MoveGroupCommander) -> None:
    other = MoveGroupCommander("panda_arm")
    other.set_goal_tolerance(0.01)
    assert other.get_goal_tolerance() == (0.01, 0.01, 0.01)
    other.set_goal_joint_tolerance(0.001)
    other.set_goal_position_tolerance(0.002)
    other.set_goal_orientation_tolerance(0.003)
    assert other.get_goal_joint_tolerance() == 0.001
    assert other.get_goal_position_tolerance() == 0.002
    assert other.get_goal_orientation_tolerance() == 0.003
    other.allow_looking(False)
    other.allow_replanning(False)
    other.set_planning_time(4.0)
    assert other.get_planning_time() == 4.0
    other.set_num_planning_attempts(2)
    other.set_workspace([-2, -2, -2, 2, 2, 2])
    other.set_support_surface_name("table")
    other.set_start_state(other.get_current_state())
    other.set_start_state_to_current_state()
    other.set_trajectory_constraints(TrajectoryConstraints())
    assert other.get_trajectory_constraints() == TrajectoryConstraints()
    other.clear_trajectory_constraints()
    other.set_joint_value_target(READY)
    request = other.construct_motion_plan_request()
    assert (request.num_planning_attempts, request.allowed_planning_time, request.group_name) == (2, 4.0, "panda_arm")


def test_path_constraints_by_name(arm: MoveGroupCommander, tmp_path: Path) -> None:
    other = MoveGroupCommander("panda_arm")
    with pytest.raises(MoveItCommanderException, match="MongoDB is not supported"):
        other.set_constraints_database("localhost", 33829)
    upright = Constraints(name="upright", orientation_constraints=[OrientationConstraint(link_name="panda_link8")])
    storage = ConstraintsStorage(str(tmp_path / "warehouse.sqlite"))
    storage.add_constraints(upright, "panda", "panda_arm")
    storage.add_constraints(Constraints(name="elsewhere"), "panda", "hand")
    other.set_constraints_database(str(tmp_path / "warehouse.sqlite"), 0)
    assert other.get_known_constraints() == ["upright"]
    other.set_path_constraints("upright")
    assert other.get_path_constraints() == upright
    with pytest.raises(MoveItCommanderException, match="there are: upright"):
        other.set_path_constraints("elsewhere")
    assert other.get_path_constraints() == upright, "a refused name changes nothing"


def test_an_approximate_target_is_as_near_as_the_arm_gets(arm: MoveGroupCommander) -> None:
    far = arm.get_current_pose()
    far.pose.position.x, far.pose.position.y, far.pose.position.z = 2.0, 0.0, 0.333
    with pytest.raises(MoveItCommanderException, match="NO_IK_SOLUTION"):
        arm.set_joint_value_target(far)
    arm.set_joint_value_target(far, True)
    state = arm.get_current_state()
    values = dict(zip(state.joint_state.name, state.joint_state.position, strict=True))
    values.update(zip(arm.get_active_joints(), arm.get_joint_value_target(), strict=True))
    state.joint_state.name, state.joint_state.position = list(values), list(values.values())
    tip = pose_of(arm.get_end_effector_link(), state).position
    assert tip.x > 0.75 and abs(tip.y) < 0.1 and abs(tip.z - 0.333) < 0.2, "the arm is stretched toward the pose"
    within = arm.get_current_pose()
    arm.set_joint_value_target(within, True, arm.get_end_effector_link())
    arm.set_joint_value_target(READY)


def test_targets(arm: MoveGroupCommander) -> None:
    arm.set_joint_value_target({"panda_joint1": 0.3})
    assert arm.get_joint_value_target()[0] == 0.3
    arm.set_random_target()
    assert {"ready", "reaching"} <= set(arm.get_named_targets())
    assert arm.get_named_target_values("ready")["panda_joint2"] == -0.785
    arm.set_named_target("ready")
    arm.remember_joint_values("mine", READY)
    assert arm.get_remembered_joint_values() == {"mine": READY}
    arm.forget_joint_values("mine")
    for setter, value in (
        (arm.set_pose_target, stamped(0.4, 0.0, 0.5, DOWN)),
        (arm.set_rpy_target, [math.pi, 0, 0]),
        (arm.set_pose_targets, [stamped(0.4, 0.0, 0.5, DOWN), stamped(0.4, 0.1, 0.5, DOWN)]),
        (arm.set_orientation_target, [1, 0, 0, 0]),
        (arm.set_position_target, [0.4, 0.0, 0.5]),
    ):
        setter(value)
        assert arm.plan()[0], setter.__name__
    arm.shift_pose_target(0, 0.05)
    arm.clear_pose_target("panda_link8")
    arm.clear_pose_targets()


# ---------------------------------------------------------------- a group: motions
@pytest.fixture
def planning(arm: MoveGroupCommander) -> Iterator[None]:
    """Leaves the planner as it was."""
    yield
    arm.set_planning_pipeline_id("ompl")
    arm.set_planner_id("")
    arm.set_max_velocity_scaling_factor(1.0)
    arm.set_max_acceleration_scaling_factor(1.0)
    arm.clear_max_cartesian_link_speed()
    arm.clear_path_constraints()
    arm.clear_pose_targets()


@pytest.mark.usefixtures("planning")
def test_pipelines_and_planners_with_their_parameters(arm: MoveGroupCommander) -> None:
    ask = rospy.ServiceProxy("get_planner_params", GetPlannerParams)
    set_planner_params = rospy.ServiceProxy("set_planner_params", SetPlannerParams)
    params = ask(pipeline_id="ompl", planner_config="RRTConnect", group="panda_arm").params
    params.keys, params.values = ["range"], ["0.5"]
    set_planner_params(pipeline_id="ompl", planner_config="RRTConnect", group="panda_arm", params=params, replace=True)
    now = ask(pipeline_id="ompl", planner_config="RRTConnect", group="panda_arm").params
    assert float(dict(zip(now.keys, now.values, strict=True))["range"]) == 0.5
    for pipeline, planner in (
        ("ompl", "RRTConnect"),
        ("ompl", "KPIECE"),
        ("pilz_industrial_motion_planner", "PTP"),
        ("pilz_industrial_motion_planner", "LIN"),
    ):
        arm.set_planning_pipeline_id(pipeline)
        arm.set_planner_id(planner)
        assert (arm.get_planning_pipeline_id(), arm.get_planner_id()) == (pipeline, planner)
        goal = stamped(0.35, 0.05, 0.55, DOWN) if planner == "LIN" else {"panda_joint1": 0.3}
        arm.set_joint_value_target(READY)
        for scale in (arm.set_max_velocity_scaling_factor, arm.set_max_acceleration_scaling_factor):
            scale(0.1 if planner == "LIN" else 1.0)
        assert arm.plan(goal)[0], planner


def test_motions(arm: MoveGroupCommander) -> None:
    arm.set_named_target("reaching")
    worked, trajectory, _, code = arm.plan()
    assert worked and code.val == MoveItErrorCodes.SUCCESS
    slow = arm.retime_trajectory(arm.get_current_state(), trajectory, 0.5, 0.5)
    ends = [item.joint_trajectory.points[-1].time_from_start.to_sec() for item in (trajectory, slow)]
    assert ends[1] > 1.2 * ends[0]
    assert arm.execute(trajectory)
    reached = arm.get_current_joint_values()
    assert arm.go(READY, wait=False)
    until(lambda: arm.get_current_joint_values() != pytest.approx(reached, abs=0.01), "the arm moves")
    arm.stop()
    until(lambda: at_rest(arm), "the arm stands still")
    assert arm.get_current_joint_values() != pytest.approx(READY, abs=0.05)
    assert arm.go(READY) and arm.get_current_joint_values() == pytest.approx(READY, abs=2e-3)


@pytest.mark.usefixtures("planning")
def test_the_speed_of_a_link_is_limited(arm: MoveGroupCommander) -> None:
    def duration_s() -> float:
        worked, trajectory, _, _ = arm.plan({"panda_joint1": 0.8})
        assert worked
        return float(trajectory.joint_trajectory.points[-1].time_from_start.to_sec())

    free = duration_s()
    arm.limit_max_cartesian_link_speed(0.05, "panda_link8")
    assert duration_s() > max(2.0 * free, 0.8 * 0.307 / 0.05)
    arm.clear_max_cartesian_link_speed()
    assert duration_s() == pytest.approx(free, rel=0.5)


def test_a_straight_line(arm: MoveGroupCommander) -> None:
    pose = arm.get_current_pose().pose
    pose.position.z -= 0.1
    path, share = arm.compute_cartesian_path([pose], 0.01)
    assert share == pytest.approx(1.0) and len(path.joint_trajectory.points) > 5
    assert arm.execute(path)
    assert arm.get_current_pose().pose.position.z == pytest.approx(pose.position.z, abs=2e-3)
    assert arm.go(READY)


@pytest.mark.usefixtures("planning")
def test_path_constraints_hold_on_the_way(arm: MoveGroupCommander) -> None:
    upright = OrientationConstraint(
        Header(frame_id="world"),
        arm.get_current_pose().pose.orientation,
        "panda_link8",
        0.2,
        0.2,
        2 * math.pi,
        OrientationConstraint.XYZ_EULER_ANGLES,
        1.0,
    )
    arm.set_path_constraints(Constraints(orientation_constraints=[upright]))
    assert arm.get_path_constraints().orientation_constraints
    target = arm.get_current_pose()
    target.pose.position.x, target.pose.position.y = 0.35, 0.25
    arm.set_pose_target(target)
    worked, trajectory, _, _ = arm.plan()
    assert worked
    state = arm.get_current_state()
    for point in trajectory.joint_trajectory.points[::5]:
        place = dict(zip(state.joint_state.name, state.joint_state.position, strict=True))
        place.update(zip(trajectory.joint_trajectory.joint_names, point.positions, strict=True))
        state.joint_state.name, state.joint_state.position = list(place), list(place.values())
        turn = conversions.pose_to_list(pose_of("panda_link8", state))[3:]
        down = 2.0 * (turn[0] ** 2 + turn[1] ** 2) - 1.0  # cosine between the link's z and the world's -z
        assert down > math.cos(0.3)
    arm.clear_path_constraints()
    assert arm.get_path_constraints() == Constraints()


# ---------------------------------------------------------------- the scene
def test_objects_of_the_scene(scene: PlanningSceneInterface, tmp_path: Path) -> None:
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "cube.stl")
    far = stamped(1.5, 0.0, 0.5)
    scene.add_box("box", far, (0.1, 0.1, 0.1))
    scene.add_sphere("sphere", far, 0.1)
    scene.add_cylinder("cylinder", far, 0.2, 0.1)
    scene.add_cone("cone", far, 0.2, 0.1)
    scene.add_plane("plane", far, (0, 0, 1), -1.0)
    scene.add_mesh("mesh", far, str(tmp_path / "cube.stl"))
    made = [
        scene.make_box("made_box", far, (0.1, 0.1, 0.1)),
        scene.make_sphere("made_sphere", far, 0.1),
        scene.make_cylinder("made_cylinder", far, 0.2, 0.1),
        scene.make_cone("made_cone", far, 0.2, 0.1),
        scene.make_plane("made_plane", far),
        scene.make_mesh("made_mesh", far, str(tmp_path / "cube.stl")),
    ]
    assert [len(item.primitives) for item in made] == [1, 1, 1, 1, 0, 0]
    scene.add_object(made[0])
    assert {"box", "sphere", "cylinder", "cone", "plane", "mesh", "made_box"} == set(scene.get_known_object_names())
    assert "box" in scene.get_known_object_names_in_roi(1, -1, 0, 2, 1, 1)
    assert scene.get_object_poses(["box"])["box"].position.x == 1.5
    assert set(scene.get_objects(["cone", "mesh"])) == {"cone", "mesh"}
    assert scene.get_planning_scene(PlanningSceneComponents.SCENE_SETTINGS).robot_model_name == "panda"
    assert scene.apply_planning_scene(PlanningScene(is_diff=True))
    scene.remove_world_object("made_box")
    scene.attach_box("panda_hand", "held_box", stamped(1.5, 1.0, 0.5), (0.1, 0.1, 0.1))
    scene.attach_sphere("panda_hand", "held_sphere", stamped(1.5, 1.0, 0.5), 0.1)
    scene.attach_cylinder("panda_hand", "held_cylinder", stamped(1.5, 1.0, 0.5), 0.1, 0.1)
    scene.attach_mesh("panda_hand", "held_mesh", stamped(1.5, 1.0, 0.5), str(tmp_path / "cube.stl"))
    scene.attach_object("box", "panda_hand")
    assert set(scene.get_attached_objects()) == {"held_box", "held_sphere", "held_cylinder", "held_mesh", "box"}
    scene.remove_attached_object("panda_hand", "held_box")
    scene.remove_attached_object("panda_hand")
    scene.clear()
    assert scene.get_known_object_names() == [] and scene.get_attached_objects() == {}


def test_a_group_holds_an_object(arm: MoveGroupCommander, scene: PlanningSceneInterface) -> None:
    scene.add_box("tool", stamped(1.5, 0.0, 0.5), (0.05, 0.05, 0.05))
    assert arm.attach_object("tool", "panda_hand", FINGERS)
    until(lambda: "tool" in scene.get_attached_objects(), "the tool attached")
    assert arm.detach_object("tool")
    until(lambda: "tool" not in scene.get_attached_objects(), "the tool detached")
    scene.clear()


# ---------------------------------------------------------------- pick and place
def translation(frame: str, z: float) -> GripperTranslation:
    return GripperTranslation(Vector3Stamped(Header(frame_id=frame), Vector3(0.0, 0.0, z)), 0.1, 0.05)


def fingers(position: float) -> JointTrajectory:
    return JointTrajectory(
        joint_names=["panda_finger_joint1"],
        points=[JointTrajectoryPoint(positions=[position], time_from_start=rospy.Duration(1.0))],
    )


def test_an_object_is_picked_and_placed(arm: MoveGroupCommander, scene: PlanningSceneInterface) -> None:
    scene.add_box("table", stamped(0.5, 0.0, 0.1), (0.3, 0.6, 0.2))
    scene.add_box("part", stamped(0.5, 0.0, 0.25), (0.03, 0.03, 0.1))
    arm.set_support_surface_name("table")
    arm.set_planning_time(20.0)
    grasp = Grasp(
        id="above",
        grasp_pose=stamped(0.5, 0.0, 0.36, DOWN),
        pre_grasp_posture=fingers(0.035),
        grasp_posture=fingers(0.015),
        pre_grasp_approach=translation("world", -1.0),
        post_grasp_retreat=translation("world", 1.0),
        allowed_touch_objects=["part"],
    )
    assert arm.pick("part", grasp) == MoveItErrorCodes.SUCCESS
    assert "part" in scene.get_attached_objects()
    assert arm.place("part", stamped(0.5, 0.15, 0.25))
    assert "part" not in scene.get_attached_objects()
    placed = scene.get_object_poses(["part"])["part"].position
    assert [placed.x, placed.y] == pytest.approx([0.5, 0.15], abs=5e-3)
    arm.set_support_surface_name("")
    scene.clear()
    assert arm.go(READY)


# ---------------------------------------------------------------- the command line
def written(values: list[float]) -> str:
    return f"[{' '.join(str(value) for value in values)}]"


def test_commands_as_text(robot: RobotCommander, tmp_path: Path) -> None:
    interpreter = MoveGroupCommandInterpreter()
    assert interpreter.get_active_group() is None
    assert interpreter.execute("joints")[0] == MoveGroupInfoLevel.WARN
    assert interpreter.execute_generic_command("go home") is None
    assert interpreter.resolve_command_alias("which") == "id"
    assert interpreter.execute_group_command(robot.get_group("hand"), "id") == (MoveGroupInfoLevel.INFO, "hand")
    assert interpreter.execute("use panda_arm") == (MoveGroupInfoLevel.DEBUG, "OK")
    assert interpreter.get_loaded_groups() == ["panda_arm"] and interpreter.get_active_group() is not None
    assert interpreter.execute("id") == (MoveGroupInfoLevel.INFO, "panda_arm")
    assert "panda_joint3" in interpreter.execute("joints")[1]
    assert interpreter.execute(f"home = {READY}")[0] == MoveGroupInfoLevel.SUCCESS
    assert interpreter.execute("side = home")[0] == MoveGroupInfoLevel.SUCCESS
    assert interpreter.execute("side[0] = 0.4")[0] == MoveGroupInfoLevel.SUCCESS
    assert interpreter.execute("side") == (MoveGroupInfoLevel.INFO, written([0.4, *READY[1:]]))
    assert interpreter.execute("show side") == (MoveGroupInfoLevel.INFO, f"side = {written([0.4, *READY[1:]])}")
    assert interpreter.execute("vars") == (MoveGroupInfoLevel.INFO, "[home side]")
    assert interpreter.execute("execute")[0] == MoveGroupInfoLevel.WARN
    assert interpreter.execute("plan side")[0] == MoveGroupInfoLevel.SUCCESS
    assert interpreter.execute("execute")[0] == MoveGroupInfoLevel.SUCCESS
    assert interpreter.execute("go home") == (MoveGroupInfoLevel.SUCCESS, "Moved to home")
    assert interpreter.execute("go up 0.02")[0] == MoveGroupInfoLevel.SUCCESS
    for line in (
        "eef",
        "current",
        "group_state",
        "time 3",
        "tolerance 0.001",
        "tol",
        "record here",
        "vars",
        "show",
        "show here",
        "delete here",
        "planner RRTConnect",
        "allow replanning true",
        "constrain",
        "database",
        "stop",
        "wait 0.01",
        "trace on",
        "trace off",
        "ground",
        "help",
        "rec now",
        "rand some",
        "del some",
        "allow look T",
        "allow replan 0",
        f"database {tmp_path / 'constraints.sqlite'}",
        f"save {tmp_path / 'commands'}",
    ):
        level, text = interpreter.execute(line)
        assert level in (MoveGroupInfoLevel.SUCCESS, MoveGroupInfoLevel.INFO, MoveGroupInfoLevel.DEBUG), (line, text)
    for line in (
        "nonsense",
        "go",
        "go nowhere",
        "time x",
        "allow flying true",
        "side[9] = 1",
        "show nobody",
        "use nobody",
        "load /no/such/file",
        "constrain upright",
        "pick nobody",
        "home = [1]",
    ):
        assert interpreter.execute(line)[0] in (MoveGroupInfoLevel.WARN, MoveGroupInfoLevel.FAIL), line
    again = MoveGroupCommandInterpreter()
    assert again.execute(f"load {tmp_path / 'commands'}") == (MoveGroupInfoLevel.DEBUG, "OK")
    assert again.execute("side")[1] == written([0.4, *READY[1:]])
    assert again.execute("database")[1] == f"Connected to {tmp_path / 'constraints.sqlite'}"
    assert "panda_arm" in again.get_keywords()["use"] and "go" in again.get_help()
    PlanningSceneInterface().clear()


def test_a_file_in_the_folder_cmd_is_a_command(session: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "cmd").mkdir()
    (tmp_path / "cmd" / "prepare").write_text("use hand\nclosed = [0.0]  # comment\n")
    monkeypatch.chdir(tmp_path)
    interpreter = MoveGroupCommandInterpreter()
    assert interpreter.execute("prepare") == (MoveGroupInfoLevel.DEBUG, "OK")
    assert interpreter.execute("closed") == (MoveGroupInfoLevel.INFO, "[0.0]")
    assert interpreter.execute("load prepare") == (MoveGroupInfoLevel.DEBUG, "OK")
    (tmp_path / "prepare").write_text("use panda_arm\n")
    assert interpreter.execute("prepare") == (MoveGroupInfoLevel.DEBUG, "OK")
    assert interpreter.execute("id") == (MoveGroupInfoLevel.INFO, "hand"), "the file in cmd, not the one beside it"
    for line in (f"{tmp_path / 'prepare'}", f"many = {[0.12345] * 60}", f"load {'x' * 300}", "load a\0b", "save a\0b"):
        assert interpreter.execute(line)[0] == MoveGroupInfoLevel.WARN, line
    assert interpreter.execute("id") == (MoveGroupInfoLevel.INFO, "hand")


def test_the_terminal_executes_what_it_reads(session: Any) -> None:
    command = ["rosrun", "moveit_commander", "moveit_commander_cmdline.py", "panda_arm"]
    run = subprocess.run(
        command,
        input="id\ngo ready\nnonsense\nquit\n",
        env=session.env,
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert run.stdout.splitlines()[:2] == ["panda_arm", "Moved to ready"], run.stdout + run.stderr
    assert "Unknown command: 'nonsense'" in run.stdout and run.returncode == 1


def test_every_public_method_was_driven() -> None:
    offered = {(kind.__name__, name) for kind in CLASSES for name in public_methods(kind)}
    assert len(offered) > 130
    assert offered - driven == set()
