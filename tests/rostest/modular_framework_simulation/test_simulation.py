# SPDX-License-Identifier: BSD-3-Clause
"""The simulation as its users see it on the wire: clock, controllers, Gazebo's services and topics, planning scene."""

from __future__ import annotations

import signal
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rospy
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from gazebo_msgs.msg import LinkStates, ModelState, ModelStates
from gazebo_msgs.srv import (
    DeleteModel,
    GetJointProperties,
    GetLinkState,
    GetModelProperties,
    GetModelState,
    GetPhysicsProperties,
    GetWorldProperties,
    SetModelConfiguration,
    SetModelState,
    SpawnModel,
)
from geometry_msgs.msg import Point, Pose, Quaternion
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Empty
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.ros_session import executable, until

sys.path.insert(0, str(Path(__file__).parent))
from fake_planning_scene import FakePlanningScene  # noqa: E402
from simulated_ur5 import ARM, BALL, LAUNCH  # noqa: E402

START = [1.57, -1.57, 1.57, -1.57, -1.57, 0.0]

BOMB = (
    "<?xml version='1.0'?>\n<!DOCTYPE sdf [<!ENTITY e0 'boom'>"
    + "".join(f"<!ENTITY e{n} '{f'&e{n - 1};' * 30}'>" for n in range(1, 12))
    + "]><sdf version='1.6'>&e11;</sdf>"
)


def call(name: str, kind: Any, *values: Any, **fields: Any) -> Any:
    rospy.wait_for_service(name, 20.0)
    return rospy.ServiceProxy(name, kind)(*values, **fields)


def spawn(name: str, x: float, y: float, z: float, frame: str = "world", xml: str = BALL) -> Any:
    pose = Pose(Point(x, y, z), Quaternion(0, 0, 0, 1))
    return call("/gazebo/spawn_sdf_model", SpawnModel, name, xml, "", pose, frame)


@pytest.fixture(scope="module")
def simulation(ros_session: Any) -> Iterator[Any]:
    launch = ros_session.launch(LAUNCH)
    ros_session.wait_for_service("/gazebo/get_world_properties", 40.0)
    yield launch


def test_the_clock_runs_at_a_hundred_hertz_of_simulated_time_and_in_real_time(simulation: Any) -> None:
    stamps: list[float] = []
    begin = time.monotonic()
    subscriber = rospy.Subscriber("/clock", Clock, lambda message: stamps.append(message.clock.to_sec()))
    until(lambda: len(stamps) > 200, "two seconds of clock")
    subscriber.unregister()
    assert time.monotonic() - begin < 8.0
    periods = [round((b - a) / 0.01, 6) for a, b in zip(stamps, stamps[1:], strict=False)]
    # A simulation that was held up catches up faster than it may publish the clock, and leaves messages out.
    assert all(period == round(period) >= 1 for period in periods)
    assert statistics.median(periods) == 1


def test_the_world_holds_the_models_of_the_file_and_the_robot(simulation: Any) -> None:
    answer = call("/gazebo/get_world_properties", GetWorldProperties)
    assert answer.success
    assert {"table", "wood_block", "can", "l_bracket", "ur5_with_ezgripper"} <= set(answer.model_names)
    table = call("/gazebo/get_model_properties", GetModelProperties, "table")
    assert (table.success, table.is_static) == (True, True)
    physics = call("/gazebo/get_physics_properties", GetPhysicsProperties)
    assert (physics.pause, physics.gravity.z) == (False, -9.81)


def test_the_robot_starts_at_its_pose_and_follows_a_trajectory(simulation: Any) -> None:
    action = "/arm_trajectory_controller/follow_joint_trajectory"
    client = SteadyActionClient(action, FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(20))
    state = rospy.wait_for_message("/joint_states", JointState, 20.0)
    positions = dict(zip(state.name, state.position, strict=True))
    assert [positions[name] for name in ARM] == pytest.approx(START, abs=0.001)
    assert len(positions) == 10
    goal = FollowJointTrajectoryGoal()
    goal.trajectory.joint_names = ARM
    target = [1.0, -1.6, 1.5, -1.5, -1.5, 0.5]
    goal.trajectory.points = [JointTrajectoryPoint(positions=target, time_from_start=rospy.Duration(1.5))]
    client.send_goal_and_wait(goal, rospy.Duration(20))
    assert client.get_result().error_code == 0
    state = rospy.wait_for_message("/joint_states", JointState, 20.0)
    positions = dict(zip(state.name, state.position, strict=True))
    assert [positions[name] for name in ARM] == pytest.approx(target, abs=0.01)


def test_a_model_is_spawned_in_a_frame_read_put_elsewhere_and_deleted(simulation: Any) -> None:
    call("/gazebo/pause_physics", Empty)  # a ball that falls is elsewhere when it is asked for
    try:
        assert spawn("ball", 0.3, 0.1, 1.5, "table").success
        state = call("/gazebo/get_model_state", GetModelState, "ball", "table")
        assert (state.success, state.header.frame_id) == (True, "table")
        assert (state.pose.position.x, state.pose.position.y) == pytest.approx((0.3, 0.1), abs=0.005)
        wanted = ModelState("ball", Pose(Point(0, 0, 0.5), Quaternion(0, 0, 0, 1)), state.twist, "wood_block::link")
        assert call("/gazebo/set_model_state", SetModelState, wanted).success
        state = call("/gazebo/get_model_state", GetModelState, "ball", "wood_block")
        assert state.pose.position.z == pytest.approx(0.5, abs=0.005)
        link = call("/gazebo/get_link_state", GetLinkState, "ball::link", "world")
        assert (link.success, link.link_state.reference_frame) == (True, "world")
    finally:
        call("/gazebo/unpause_physics", Empty)
    assert call("/gazebo/delete_model", DeleteModel, "ball").success
    assert not call("/gazebo/get_model_state", GetModelState, "ball", "").success


def test_a_model_can_be_put_elsewhere_by_topic(simulation: Any) -> None:
    assert spawn("ball", 1.0, -1.0, 0.1).success
    publisher = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=1)
    until(lambda: publisher.get_num_connections() > 0, "a subscriber of set_model_state")
    publisher.publish(ModelState("nothing", Pose(), None, ""))
    publisher.publish(ModelState(model_name="ball", pose=Pose(Point(2.0, -1.0, 0.1), Quaternion(0, 0, 0, 1))))
    try:
        read = lambda: call("/gazebo/get_model_state", GetModelState, "ball", "").pose.position.x  # noqa: E731
        until(lambda: abs(read() - 2.0) < 0.05, "the ball at its new place")
    finally:
        call("/gazebo/delete_model", DeleteModel, "ball")


@pytest.mark.parametrize(
    ("request_it", "said"),
    [
        (lambda: spawn("table", 0, 0, 1), "'table' is already"),
        (lambda: spawn("x", 0, 0, 1, xml="<sdf version='1.6'><model name='x'/></sdf>"), "no <link>"),
        (lambda: spawn("x", 0, 0, 1, xml="rubbish"), "well-formed"),
        (lambda: spawn("x", 0, 0, 1, xml=BOMB), ":2: got a DOCTYPE"),
        (lambda: call("/gazebo/spawn_urdf_model", SpawnModel, "x", BOMB, "", Pose(), ""), ":2: got a DOCTYPE"),
        (lambda: spawn("x" * 5000, 0, 0, 1), "is 5,000 bytes long"),
        (lambda: spawn("x", 0, 0, 1, xml=BALL.replace('"link"', f'"{"l" * 5000}"')), "is 5,000 bytes long"),
        (
            lambda: call(
                "/gazebo/spawn_urdf_model",
                SpawnModel,
                "x" * 5000,
                "<robot name='r'><link name='a'/></robot>",
                "",
                Pose(),
                "",
            ),
            "is 5,000 bytes long",
        ),
        (
            lambda: call(
                "/gazebo/set_model_configuration", SetModelConfiguration, "ur5_with_ezgripper", "", ["j" * 5000], [1.0]
            ),
            "no movable joint",
        ),
        (lambda: spawn("x", 0, 0, 1, "nowhere"), "no model 'nowhere'"),
        (lambda: spawn("x", 0, 0, float("nan")), "give finite numbers"),
        (lambda: spawn("x", 0, 0, 1e30), "at most 10000 m"),
        (lambda: call("/gazebo/delete_model", DeleteModel, "mug"), "no model 'mug'"),
        (lambda: call("/gazebo/delete_model", DeleteModel, "ur5_with_ezgripper"), "the controlled robot"),
        (lambda: call("/gazebo/get_link_state", GetLinkState, "table::lid", ""), "no link 'table::lid'"),
        (lambda: call("/gazebo/set_model_state", SetModelState, ModelState(model_name="mug")), "no model 'mug'"),
    ],
)
def test_a_wrong_request_is_answered_with_the_reason(simulation: Any, request_it: Callable[[], Any], said: str) -> None:
    answer = request_it()
    assert not answer.success
    assert said in answer.status_message


def test_spawn_model_works_from_the_command_line(simulation: Any, ros_session: Any) -> None:
    def spawn_model(*words: str) -> int:
        command = ["rosrun", "gazebo_ros", "spawn_model", *words]
        return subprocess.run(command, env=ros_session.env, timeout=60, check=False, capture_output=True).returncode

    place = ("-x", "1", "-y", "-1", "-z", "0.1", "-Y", "0.5")
    assert spawn_model("-sdf", "-database", "cube", "-model", "dice", *place) == 0
    try:
        state = call("/gazebo/get_model_state", GetModelState, "dice", "")
        assert (state.success, state.pose.position.x) == (True, pytest.approx(1.0, abs=0.01))
        assert spawn_model("-sdf", "-database", "cube", "-model", "dice") == 1
        assert spawn_model("-sdf", "-file", "/nowhere.sdf", "-model", "x") == 1
    finally:
        call("/gazebo/delete_model", DeleteModel, "dice")


DOOR = """<sdf version="1.6"><model name="door"><link name="post"/><link name="leaf"/>
  <joint name="fast" type="fixed"><parent>world</parent><child>post</child></joint>
  <joint name="hinge" type="revolute"><parent>post</parent><child>leaf</child><axis><xyz>0 0 1</xyz>
  <limit><lower>-2</lower><upper>2</upper></limit></axis></joint></model></sdf>"""
BRACKET = """<robot name="b"><link name="l"><inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4"
  ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><mesh filename="package://l_bracket/meshes/l_bracket.stl"/>
  </geometry></collision></link></robot>"""


def test_all_options_of_spawn_model_have_their_effect(simulation: Any, ros_session: Any, tmp_path: Path) -> None:
    door, bracket = tmp_path / "door.sdf", tmp_path / "bracket.urdf"
    door.write_text(DOOR)
    bracket.write_text(BRACKET)
    command = [executable("gazebo_ros", "spawn_model")]

    def spawn_model(*words: str) -> tuple[int, str]:
        done = subprocess.run(
            [*command, *words], env=ros_session.env, timeout=60, check=False, capture_output=True, text=True
        )
        return done.returncode, done.stdout + done.stderr

    call("/gazebo/pause_physics", Empty)
    frame = ("-gazebo_namespace", "/gazebo/", "-reference_frame", "table", "-wait", "table")
    code, text = spawn_model("-sdf", "-file", str(door), "-model", "door", "-z", "3", "-J", "hinge", "0.5", *frame)
    try:
        assert code == 0, text
        hinge = call("/gazebo/get_joint_properties", GetJointProperties, "door::hinge")
        assert hinge.position[0] == pytest.approx(0.5)
        rospy.set_param("/start_timeout", 2.0)
        code, text = spawn_model("-sdf", "-file", str(door), "-model", "d", "-gazebo_namespace", "/nothing")
        rospy.delete_param("/start_timeout")
        assert (code, "/nothing/spawn_sdf_model" in text) == (1, True)
        words = ("-urdf", "-file", str(bracket), "-model", "bracket", "-x", "3", "-z", "1")
        assert spawn_model(*words)[0] == 1, "there is no package of that name"
        code, text = spawn_model(*words, "-package_to_model", "-robot_namespace", "/some", "-unpause")
        assert code == 0, text
        assert "-robot_namespace /some applies to sensors only" in text
        assert not call("/gazebo/get_physics_properties", GetPhysicsProperties).pause
        bonded = subprocess.Popen(
            [*command, "-sdf", "-database", "cube", "-model", "bonded", "-b"],
            env=ros_session.env,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert bonded.stdout and any("'bonded' is deleted when this program ends" in line for line in bonded.stdout)
        assert call("/gazebo/get_model_state", GetModelState, "bonded", "").success
        bonded.send_signal(signal.SIGINT)
        assert bonded.wait(20) == 0
        assert not call("/gazebo/get_model_state", GetModelState, "bonded", "").success
    finally:
        call("/gazebo/unpause_physics", Empty)
        for name in ("door", "bracket", "bonded"):
            call("/gazebo/delete_model", DeleteModel, name)


def test_states_of_models_and_links_are_published(simulation: Any) -> None:
    models = rospy.wait_for_message("/gazebo/model_states", ModelStates, 10.0)
    links = rospy.wait_for_message("/gazebo/link_states", LinkStates, 10.0)
    height = models.pose[models.name.index("wood_block")].position.z
    assert height == pytest.approx(0.89, abs=0.002)
    assert "ur5_with_ezgripper::eg_manipulator" in links.name
    assert rospy.wait_for_message("/gazebo/grasped_object", String, 10.0).data == ""


def test_time_stands_still_while_paused(simulation: Any) -> None:
    call("/gazebo/pause_physics", Empty)
    try:
        before = call("/gazebo/get_world_properties", GetWorldProperties).sim_time
        assert spawn("ball", 1.0, -1.0, 1.0).success
        time.sleep(0.3)
        assert call("/gazebo/get_world_properties", GetWorldProperties).sim_time == before
        assert call("/gazebo/get_model_state", GetModelState, "ball", "").pose.position.z == 1.0
    finally:
        call("/gazebo/unpause_physics", Empty)
    fallen = lambda: call("/gazebo/get_model_state", GetModelState, "ball", "").pose.position.z < 0.9  # noqa: E731
    until(fallen, "the ball to fall")
    call("/gazebo/delete_model", DeleteModel, "ball")


def test_reset_world_puts_models_and_robot_back_and_controllers_go_on(simulation: Any) -> None:
    away = ModelState(model_name="can", pose=Pose(Point(0.2, 0.7, 1.2), Quaternion(0, 0, 0, 1)))
    assert call("/gazebo/set_model_state", SetModelState, away).success
    call("/gazebo/reset_world", Empty)
    state = call("/gazebo/get_model_state", GetModelState, "can", "")
    assert (state.pose.position.x, state.pose.position.y) == pytest.approx((0.27, 0.45), abs=0.005)
    rospy.sleep(0.5)
    joints = rospy.wait_for_message("/joint_states", JointState, 10.0)
    positions = dict(zip(joints.name, joints.position, strict=True))
    assert [positions[name] for name in ARM] == pytest.approx(START, abs=0.002)


@pytest.mark.parametrize(
    ("service", "reason"), [("reset_world", "the world was reset"), ("reset_simulation", "the simulation was reset")]
)
def test_a_reset_in_the_middle_of_a_motion_ends_it_with_that_reason(simulation: Any, service: str, reason: str) -> None:
    client = SteadyActionClient("/arm_trajectory_controller/follow_joint_trajectory", FollowJointTrajectoryAction)
    assert client.wait_for_server(rospy.Duration(20))
    goal = FollowJointTrajectoryGoal()
    goal.trajectory.joint_names = ARM
    target = [1.0, -1.6, 1.5, -1.5, -1.5, 0.5]
    goal.trajectory.points = [JointTrajectoryPoint(positions=target, time_from_start=rospy.Duration(20))]
    client.send_goal(goal)
    away = ModelState(model_name="can", pose=Pose(Point(0.2, 0.7, 1.2), Quaternion(0, 0, 0, 1)))
    assert call("/gazebo/set_model_state", SetModelState, away).success
    until(lambda: client.get_state() == GoalStatus.ACTIVE, "the motion")
    time.sleep(0.5)
    call(f"/gazebo/{service}", Empty)
    assert client.wait_for_result(rospy.Duration(20)), "the status may be known before the result has come"
    assert client.get_state() == GoalStatus.PREEMPTED
    assert client.get_goal_status_text() == client.get_result().error_string == reason
    rospy.sleep(0.5)
    joints = rospy.wait_for_message("/joint_states", JointState, 10.0)
    positions = dict(zip(joints.name, joints.position, strict=True))
    assert [positions[name] for name in ARM] == pytest.approx(START, abs=0.002)
    place = call("/gazebo/get_model_state", GetModelState, "can", "").pose.position
    assert (place.x, place.y) == pytest.approx((0.27, 0.45), abs=0.005)


def test_joints_are_put_somewhere_and_the_controllers_hold_them_there(simulation: Any) -> None:
    wanted = [0.8, -1.4, 1.3, -1.3, -1.4, 0.2]
    service = "/gazebo/set_model_configuration"
    answer = call(service, SetModelConfiguration, "ur5_with_ezgripper", "robot_description", ARM, wanted)
    assert answer.success, answer.status_message
    rospy.sleep(0.5)
    joints = rospy.wait_for_message("/joint_states", JointState, 10.0)
    positions = dict(zip(joints.name, joints.position, strict=True))
    assert [positions[name] for name in ARM] == pytest.approx(wanted, abs=0.005)
    answer = call(service, SetModelConfiguration, "ur5_with_ezgripper", "", ["knee"], [1.0])
    assert (answer.success, "no movable joint" in answer.status_message) == (False, True)


def test_move_group_is_shown_the_world_and_what_happens_in_it(simulation: Any) -> None:
    scene = FakePlanningScene()
    try:
        expected = {"table__link", "wood_block__link", "can__link", "l_bracket__link", "ground_plane__link"}
        until(lambda: expected <= scene.objects.keys(), "the objects of the world")
        block = scene.objects["wood_block__link"]
        assert block.header.frame_id == "world"
        assert list(block.primitives[0].dimensions) == pytest.approx([0.05, 0.05, 0.1])
        assert len(scene.objects["ground_plane__link"].planes) == 1
        red = scene.colours["can__link"]  # as in the can's model.sdf
        assert (red.r, red.g, red.b, red.a) == pytest.approx((0.75, 0.12, 0.12, 1.0))
        assert spawn("ball", 0.25, 0.65, 0.88).success
        until(lambda: "ball__link" in scene.objects, "the new ball")
        away = ModelState(model_name="ball", pose=Pose(Point(-0.2, 0.7, 0.88), Quaternion(0, 0, 0, 1)))
        assert call("/gazebo/set_model_state", SetModelState, away).success
        until(lambda: abs(scene.poses["ball__link"].x + 0.2) < 0.02, "the moved ball")
        call("/gazebo/pause_physics", Empty)
        assert spawn("cube", 0.25, 0.75, 0.88).success
        until(lambda: "cube__link" in scene.objects, "the cube spawned while time stands still")
        assert call("/gazebo/delete_model", DeleteModel, "cube").success
        until(lambda: "cube__link" not in scene.objects, "the cube to vanish while time stands still")
        call("/gazebo/unpause_physics", Empty)
        scene.refuse = True
        assert call("/gazebo/delete_model", DeleteModel, "ball").success
        time.sleep(0.5)
        scene.refuse = False
        until(lambda: "ball__link" not in scene.objects, "the ball to vanish")
    finally:
        call("/gazebo/unpause_physics", Empty)
        scene.shutdown()


def test_a_cleared_scene_and_one_of_a_new_move_group_get_the_world_again(simulation: Any) -> None:
    scene = FakePlanningScene()
    try:
        expected = {"table__link", "can__link", "l_bracket__link", "ground_plane__link"}
        until(lambda: expected <= scene.objects.keys(), "the objects of the world")
        scene.clear()
        until(lambda: expected <= scene.objects.keys(), "the objects of the world after clear()")
        del scene.objects["l_bracket__link"]
        until(lambda: "another node removed 'l_bracket__link'" in simulation.log(), "the warning in the log")
        moved = ModelState(model_name="can", pose=Pose(Point(0.2, 0.7, 0.95), Quaternion(0, 0, 0, 1)))
        assert call("/gazebo/set_model_state", SetModelState, moved).success
        until(lambda: abs(scene.poses["can__link"].y - 0.7) < 0.02, "the moved can")
        assert "l_bracket__link" not in scene.objects, "removed by its name: it stays out"
        scene.clear()
        until(lambda: expected <= scene.objects.keys(), "everything after another clear()")
    finally:
        scene.shutdown()
    again = FakePlanningScene()
    try:
        until(lambda: expected <= again.objects.keys(), "the objects in a new move_group")
    finally:
        again.shutdown()


def test_the_node_survived_all_this(simulation: Any) -> None:
    assert simulation.alive(), simulation.log()


def test_the_node_ends_cleanly_with_its_launch(simulation: Any) -> None:
    simulation.stop()
    assert "FATAL" not in simulation.log()
    assert "Traceback" not in simulation.log()
