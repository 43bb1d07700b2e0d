# SPDX-License-Identifier: BSD-3-Clause
"""The managers answer on the wire as clients of the original expect, without its defects."""

from __future__ import annotations

import hashlib
import math
import os
import socket
import threading
from pathlib import Path
from xmlrpc.client import Transport

import pytest
import rosgraph
import rospy
import rosservice
from gazebo_msgs.srv import GetModelProperties, GetModelPropertiesResponse
from geometry_msgs.msg import PoseStamped
from moveit_msgs.msg import (
    AllowedCollisionEntry,
    AllowedCollisionMatrix,
    AttachedCollisionObject,
    CollisionObject,
    RobotTrajectory,
)
from moveit_msgs.srv import (
    ApplyPlanningScene,
    ApplyPlanningSceneResponse,
    GetPlanningScene,
    GetPlanningSceneResponse,
)
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_core import srv
from modular_framework_core.files import default_folders
from modular_framework_core.msg import ManagerChange, StandardisedGrasp
from modular_framework_core.srv import GetModifiedACMRequest, UpdateACMEntryRequest
from modular_framework_testing.ros_session import until

JOINT_STATES = """
up: {a: 1.5707963268, b: 0.1}
broken: {a: much}
down: {b: -0.2, a: 0}
"""
TRAJECTORIES = """
swing:
  - {name: up, interpolate_time: 0.4, pause_time: 0.25}
  - {name: down, interpolate_time: 0.4}
lost:
  - {name: nowhere, interpolate_time: 0.4}
"""
POSES = """
table: {reference_frame: /world, position: {x: 1, y: 0, z: 0.75}, orientation: {r: 0, p: 0, y: 0.5}}
skew:
  reference_frame: world
  position: {x: 1, y: 0}
  orientation: {r: 0, p: 0, y: 0}
both:
  reference_frame: base
  left: {position: {x: 0.1, y: 0, z: 0}, orientation: {x: 0, y: 0, z: 0, w: 1}}
  right: {position: {x: 0.2, y: 0, z: 0}, orientation: {r: 0, p: 0, y: 0}}
"""


def folder() -> Path:
    """Return the folder of the managers' files."""
    made = default_folders.framework_home() / "managers"
    made.mkdir(parents=True, exist_ok=True)
    return made


@pytest.fixture(scope="module")
def managers(ros_launch, tmp_path_factory: pytest.TempPathFactory):
    folder: Path = tmp_path_factory.mktemp("config")
    (folder / "states.yaml").write_text(JOINT_STATES)
    (folder / "trajectories.yaml").write_text(TRAJECTORIES)
    (folder / "poses.yaml").write_text(POSES)
    session = ros_launch(f"""<launch>
      <rosparam param="manipulator_links_indices">[1, 2]</rosparam>
      <node name="managers" pkg="modular_framework_core" type="managers" output="screen" required="true"
            args="{folder}/states.yaml {folder}/trajectories.yaml {folder}/poses.yaml"/>
      <node name="acm_of_grip" pkg="modular_framework_core" type="acm_manager_server" ns="grip">
        <param name="grip_interfaces" value="true"/></node></launch>""")
    session.wait_for_service("/get_object_type", 60)
    session.wait_for_service("/set_init_acm", 60)
    return session


def call(name: str, service_type, *args, **fields):
    proxy = rospy.ServiceProxy(name, service_type)
    proxy.wait_for_service(60)
    return proxy(*args, **fields)


def test_joint_states_of_the_file_keep_full_precision_and_survive_a_bad_neighbour(managers):
    answer = call("get_joint_state", srv.GetJointState, "up")
    assert answer.success
    assert answer.joint_state.name == ["a", "b"]
    assert answer.joint_state.position == (1.5707963268, 0.1)
    assert call("get_joint_state", srv.GetJointState, "down").success
    assert not call("get_joint_state", srv.GetJointState, "broken").success
    assert "states.yaml:3" in managers.log()


def test_trajectories_of_the_file_are_timed_and_a_bad_one_is_dropped(managers):
    answer = call("get_trajectory", srv.GetJointTrajectory, "swing")
    assert answer.success
    times = [point.time_from_start.to_sec() for point in answer.joint_trajectory.points]
    assert times == pytest.approx([0.4, 0.65, 1.05])
    assert not call("get_trajectory", srv.GetJointTrajectory, "lost").success


def test_anonymous_messages_come_out_oldest_first_and_only_once(managers):
    for value in (1.0, 2.0, 3.0):
        assert call("add_joint_state", srv.AddJointState, JointState(name=["a"], position=[value]), "").success
    got = [call("get_joint_state", srv.GetJointState, "").joint_state.position[0] for _ in range(3)]
    assert got == [1.0, 2.0, 3.0]
    empty = call("get_joint_state", srv.GetJointState, "")
    assert not empty.success
    assert empty.joint_state == JointState()


def test_named_messages_are_overwritten_and_stay_after_reading(managers):
    for frame in ("first", "second"):
        pose = PoseStamped()
        pose.header.frame_id = frame
        assert call("add_pose_stamped", srv.AddPoseStamped, pose, "place").success
    for service in ("get_pose_stamped", "get_pose", "get_pose"):
        answer = call(service, srv.GetPoseStamped, "place")
        assert answer.success
        assert answer.pose_stamped.header.frame_id == "second"


def test_a_grasp_without_id_takes_its_name(managers):
    call("add_grasp", srv.AddStandardisedGrasp, StandardisedGrasp(), "top")
    assert call("get_grasp", srv.GetStandardisedGrasp, "top").grasp_message.grasp_id == "top"
    call("add_grasp", srv.AddStandardisedGrasp, StandardisedGrasp(grasp_id="own"), "side")
    assert call("get_grasp", srv.GetStandardisedGrasp, "side").grasp_message.grasp_id == "own"


@pytest.mark.parametrize(
    ("suffix", "get_type"),
    [
        ("plan", srv.GetMoveitPlan),
        ("grasp", srv.GetStandardisedGrasp),
        ("trajectory", srv.GetJointTrajectory),
        ("robot_pose", srv.GetRobotPose),
    ],
)
def test_every_manager_says_no_instead_of_raising(managers, suffix, get_type):
    assert not call(f"get_{suffix}", get_type, "nobody").success
    assert not call(f"get_{suffix}", get_type, "").success


def test_object_types_are_unique_until_deleted(managers):
    assert call("add_gazebo_mapping", srv.AddGazeboMapping, "box_1", "box").success
    assert not call("add_gazebo_mapping", srv.AddGazeboMapping, "box_1", "can").success
    assert call("get_object_type", srv.GetGazeboType, "box_1").object_type == "box"
    assert call("delete_gazebo_mapping", srv.DeleteGazeboMapping, "box_1").success
    assert not call("delete_gazebo_mapping", srv.DeleteGazeboMapping, "box_1").success
    assert not call("get_object_type", srv.GetGazeboType, "box_1").success


def matrix(names: list[str], allowed: list[tuple[str, str]]) -> AllowedCollisionMatrix:
    rows = [AllowedCollisionEntry(enabled=[(a, b) in allowed or (b, a) in allowed for b in names]) for a in names]
    return AllowedCollisionMatrix(entry_names=names, entry_values=rows)


def allowed(acm: AllowedCollisionMatrix, first: str, second: str) -> bool:
    return acm.entry_values[acm.entry_names.index(first)].enabled[acm.entry_names.index(second)]


def test_the_collision_matrix_serves_allow_and_restore(managers):
    assert not call("get_modified_acm", srv.GetModifiedACM, GetModifiedACMRequest.NOTHING, [], False).success
    assert call("update_acm_entry", srv.UpdateACMEntry, UpdateACMEntryRequest.ADD_ENTRY, "early").success
    assert call("set_init_acm", srv.SetInitACM, matrix(["arm", "palm", "finger"], [("palm", "finger")])).success
    touch = GetModifiedACMRequest.MANIPULATOR_OBJECT_COLLISION
    answer = call("get_modified_acm", srv.GetModifiedACM, touch, [], True)
    assert answer.success
    assert allowed(answer.acm, "palm", "early__link")
    assert allowed(answer.acm, "finger", "early__link")
    assert not allowed(answer.acm, "arm", "early__link")
    answer = call("get_modified_acm", srv.GetModifiedACM, touch, ["early"], False)
    assert not allowed(answer.acm, "palm", "early__link")
    assert allowed(answer.acm, "palm", "finger")
    assert not call("update_acm_entry", srv.UpdateACMEntry, 9, "x").success
    assert not call("update_acm_entry", srv.UpdateACMEntry, UpdateACMEntryRequest.ADD_ENTRY, "").success
    assert not call("get_modified_acm", srv.GetModifiedACM, 9, [], True).success


def test_an_entry_is_published_for_clients_of_grip_where_its_interfaces_are_asked_for(managers):
    request = "uint8 ADD_ENTRY=0\nuint8 DELETE_ENTRY=1\nuint8 REINIT=2\nuint8 action\nstring entry_name\nbool publish"
    kind = srv.UpdateAndPublishACMEntry
    assert kind._md5sum == hashlib.md5(f"{request}bool success".encode()).hexdigest()
    assert srv.ReinitManager._md5sum == hashlib.md5(b"string argumentbool success").hexdigest()
    given: list[AllowedCollisionMatrix] = []

    def apply(request):
        given.append(request.scene.allowed_collision_matrix)
        return ApplyPlanningSceneResponse(True)

    assert call("grip/set_init_acm", srv.SetInitACM, matrix(["arm", "palm"], [])).success
    assert not call("grip/update_acm_entry", kind, 0, "cup", True).success
    service = rospy.Service("grip/apply_planning_scene", ApplyPlanningScene, apply)
    assert call("grip/update_acm_entry", kind, 0, "mug", False).success and given == []
    assert call("grip/update_acm_entry", kind, 0, "can", True).success
    assert given[0].entry_names == ["arm", "palm", "cup__link", "mug__link", "can__link"]
    service.shutdown()


def test_the_links_of_the_manipulator_are_read_again_with_every_reference_matrix(managers):
    names = ["arm", "thumb"]
    rospy.set_param("manipulator_links_indices", [1])
    assert call("set_init_acm", srv.SetInitACM, matrix(names, [])).success
    answer = call(
        "get_modified_acm", srv.GetModifiedACM, GetModifiedACMRequest.MANIPULATOR_OBJECT_COLLISION, ["early"], True
    )
    assert allowed(answer.acm, "thumb", "early__link")
    assert not allowed(answer.acm, "arm", "early__link")
    rospy.set_param("manipulator_links_indices", [7])
    assert not call("set_init_acm", srv.SetInitACM, matrix(names, [])).success
    assert managers.alive()


def test_loose_objects_of_the_simulation_are_known_without_being_added_and_static_ones_are_not(managers):
    def scene(request):
        answer = GetPlanningSceneResponse()
        answer.scene.world.collision_objects = [
            CollisionObject(id=name) for name in ("wood_block__link", "table__link", "early__link", "drawn_by_hand")
        ]
        answer.scene.robot_state.attached_collision_objects = [
            AttachedCollisionObject(object=CollisionObject(id="can__link"))
        ]
        return answer

    def properties(request):
        loose = request.model_name in ("wood_block", "can", "early")
        return GetModelPropertiesResponse(success=loose or request.model_name == "table", is_static=not loose)

    touch = GetModifiedACMRequest.MANIPULATOR_OBJECT_COLLISION
    rospy.set_param("manipulator_links_indices", [1])
    assert call("set_init_acm", srv.SetInitACM, matrix(["arm", "palm"], [])).success
    rospy.set_param("simulation", True)
    try:
        before = call("get_modified_acm", srv.GetModifiedACM, touch, [], True)
        assert before.success
        assert "models of the simulation are unknown" in managers.log()
        services = [
            rospy.Service("get_planning_scene", GetPlanningScene, scene),
            rospy.Service("gazebo/get_model_properties", GetModelProperties, properties),
        ]
        answer = call("get_modified_acm", srv.GetModifiedACM, touch, [], True)
        assert {"wood_block__link", "can__link", "early__link"} <= set(answer.acm.entry_names)
        assert not {"table__link", "drawn_by_hand"} & set(answer.acm.entry_names)
        for name in ("wood_block__link", "can__link", "early__link"):
            assert allowed(answer.acm, "palm", name)
            assert not allowed(answer.acm, "arm", name)
        restored = call("get_modified_acm", srv.GetModifiedACM, touch, [], False)
        assert not allowed(restored.acm, "palm", "wood_block__link")
        for service in services:
            service.shutdown()
    finally:
        rospy.set_param("simulation", False)


def lists(plural: str) -> tuple[list[str], int]:
    answer = call(f"list_{plural}", srv.ListMessages)
    return answer.names, answer.anonymous


def test_messages_are_listed_removed_and_cleared(managers):
    call("clear_poses", Trigger)
    for name in ("", "p", "q"):
        assert call("add_pose", srv.AddPoseStamped, PoseStamped(), name).success
    assert lists("poses") == (["p", "q"], 1)
    assert call("remove_pose", srv.RemoveMessage, "p").success
    refused = call("remove_pose", srv.RemoveMessage, "p")
    assert not refused.success and "No pose named 'p' is stored. Stored names: q" in refused.message
    assert lists("poses") == (["q"], 1)
    assert call("clear_poses", Trigger).success
    assert lists("poses") == ([], 0)


def test_every_change_is_published_in_order(managers):
    change = ManagerChange
    heard: list[tuple[int, str, int, int]] = []
    subscriber = rospy.Subscriber(
        "manager_changes",
        ManagerChange,
        lambda message: (
            heard.append((message.action, message.name, message.named, message.anonymous))
            if message.kind == "plan"
            else None
        ),
    )
    until(lambda: call("clear_plans", Trigger).success and bool(heard), "a publisher that knows its subscriber", 60.0)
    for name in ("a", "a", ""):
        call("add_plan", srv.AddMoveitPlan, RobotTrajectory(), name)
    call("get_plan", srv.GetMoveitPlan, "")
    call("remove_plan", srv.RemoveMessage, "a")
    call("clear_plans", Trigger)
    expected = [
        (change.ADDED, "a", 1, 0),
        (change.REPLACED, "a", 1, 0),
        (change.ADDED, "", 1, 1),
        (change.HANDED_OUT, "", 1, 0),
        (change.REMOVED, "a", 0, 0),
        (change.CLEARED, "", 0, 0),
    ]
    until(
        lambda: heard[-1] == expected[-1] and len(heard) >= 7 and heard[-2][0] == change.REMOVED,
        "the last change",
        60.0,
    )
    subscriber.unregister()
    assert heard[-6:] == expected
    assert {action for action, *_ in heard[:-6]} == {change.CLEARED}


def test_messages_are_saved_and_loaded_to_the_last_bit(managers):
    message = RobotTrajectory()
    message.joint_trajectory.joint_names = ["a"]
    point = JointTrajectoryPoint(positions=[0.1 + 0.2], time_from_start=rospy.Duration(1, 999999999))
    message.joint_trajectory.points = [point]
    grasp = StandardisedGrasp(hand_id="h", grasp_quality=1e-300)
    for name in ("kept", ""):
        call("add_plan", srv.AddMoveitPlan, message, name)
    call("add_grasp", srv.AddStandardisedGrasp, grasp, "g")
    saved = call("save_plans", srv.MessageFile, "saved/plans.yaml")
    assert (saved.success, saved.count) == (True, 2), saved.message
    assert call("save_grasps", srv.MessageFile, str(folder() / "grasps.yaml")).success
    call("clear_plans", Trigger)
    call("clear_grasps", Trigger)
    assert call("load_plans", srv.MessageFile, "saved/plans.yaml").count == 2
    assert call("load_grasps", srv.MessageFile, str(folder() / "grasps.yaml")).success
    assert call("get_plan", srv.GetMoveitPlan, "kept").moveit_plan == message
    assert call("get_plan", srv.GetMoveitPlan, "").moveit_plan == message
    grasp.grasp_id = "g"
    assert call("get_grasp", srv.GetStandardisedGrasp, "g").grasp_message == grasp


@pytest.mark.parametrize(
    ("path", "text", "reason"),
    [
        ("", None, "a file that ends in .yaml"),
        ("x.txt", None, "a file that ends in .yaml"),
        ("missing.yaml", None, "cannot be read"),
        ("bad.yaml", "kind: [", "cannot be read"),
        ("kind.yaml", "kind: grasp\nnamed: {}\n", "contains messages of the kind 'grasp'"),
        (
            "field.yaml",
            "kind: plan\nnamed:\n  p: {no_such_field: 1}\n",
            "'p' is not a valid moveit_msgs/RobotTrajectory",
        ),
        ("a\0.yaml", None, "embedded null byte"),
        ("~no_such_user/a.yaml", None, "is not a valid path"),
        ("../a.yaml", None, "is outside of the managers' folder"),
        ("/etc/a.yaml", None, "is outside of the managers'"),
        ("deep.yaml", "a: " + "[" * 20000, "nested more than 100 levels deep"),
        (
            "nan.yaml",
            "kind: plan\nnamed: {p: {joint_trajectory: {joint_names: [a], points: [{positions: [.nan]}]}}}",
            "positions[0] is nan",
        ),
        (
            "uneven.yaml",
            "kind: plan\nnamed: {p: {joint_trajectory: {joint_names: [a], points: [{positions: [0, 1, 2]}]}}}",
            "joint_trajectory.points[0].positions has 3 values for 1 names",
        ),
        ("empty_name.yaml", 'kind: plan\nnamed: {"": {}}\n', "the name is empty"),
        (
            "surrogate.yaml",
            '{"kind": "plan", "named": {"\\ud800": {}}}',
            "the name '\\ud800' contains half of a character",
        ),
        ("type.yaml", "kind: plan\nanonymous:\n- {joint_trajectory: {joint_names: 5}}\n", "anonymous message 1 is no"),
    ],
)
def test_a_wrong_file_is_refused_and_nothing_is_lost(managers, path, text, reason):
    call("add_plan", srv.AddMoveitPlan, RobotTrajectory(), "stays")
    if text is not None:
        (folder() / path).write_text(text)
    answer = call("load_plans", srv.MessageFile, path)
    assert not answer.success and reason in answer.message
    assert "stays" in lists("plans")[0]


def test_a_pipe_is_refused_at_once_and_positions_that_are_not_finite_are_not_taken(managers):
    os.mkfifo(folder() / "pipe.yaml")
    for service in ("load_plans", "save_plans", "reload_joint_states"):
        answer = call(service, srv.MessageFile, "pipe.yaml")
        assert not answer.success and "not a regular file" in answer.message
    assert lists("joint_states") == (["down", "up"], 0)
    nowhere = JointState(name=["a"], position=[math.nan])
    assert not call("add_joint_state", srv.AddJointState, nowhere, "nowhere").success
    assert "nowhere" not in lists("joint_states")[0]


@pytest.mark.parametrize("wrong", [{"position": [0.0] * 3}, {"position": [0.0], "effort": [1.0, 2.0]}])
def test_a_joint_state_without_one_value_for_each_name_is_not_taken(managers, wrong):
    assert not call("add_joint_state", srv.AddJointState, JointState(name=["a"], **wrong), "uneven").success
    assert "uneven" not in lists("joint_states")[0]
    for right in ({"position": [0.0]}, {"position": [0.0], "effort": [1.0]}):
        assert call("add_joint_state", srv.AddJointState, JointState(name=["a"], **right), "even").success
    call("remove_joint_state", srv.RemoveMessage, "even")


@pytest.mark.parametrize("field", ["positions", "velocities", "accelerations"])
def test_a_trajectory_without_one_value_for_each_joint_is_not_taken(managers, field):
    point = JointTrajectoryPoint(**{field: [0.0] * 3})
    trajectory = JointTrajectory(joint_names=["a"], points=[point])
    plan = RobotTrajectory(joint_trajectory=trajectory)
    assert not call("add_trajectory", srv.AddJointTrajectory, trajectory, "uneven").success
    assert not call("add_plan", srv.AddMoveitPlan, plan, "uneven").success
    assert "uneven" not in lists("trajectories")[0] + lists("plans")[0]


def test_many_clients_at_the_same_moment_are_answered_without_a_second_try_to_connect(managers):
    """Beyond the backlog of a socket Linux drops a connection, and its client tries again after a second."""
    uri = rosservice.get_service_uri("list_poses")
    host, port = rosgraph.network.parse_http_host_and_port(uri.replace("rosrpc", "http"))
    waiting = [socket.socket() for _ in range(64)]
    for item in waiting:
        item.settimeout(0.9)
        item.connect((host, port))
    for item in waiting:
        item.close()


def test_reloading_forgets_what_was_added_and_reads_the_file_again(managers):
    call("add_joint_state", srv.AddJointState, JointState(name=["a"], position=[9.0]), "added")
    call("add_joint_state", srv.AddJointState, JointState(name=["a"], position=[9.0]), "up")
    answer = call("reload_joint_states", srv.MessageFile, "")
    assert not answer.success and answer.count == 2 and "states.yaml:3" in answer.message
    assert lists("joint_states") == (["down", "up"], 0)
    assert call("get_joint_state", srv.GetJointState, "up").joint_state.position == (1.5707963268, 0.1)


def test_managers_are_reinitialised_by_the_name_that_grip_gave_it(managers):
    call("add_joint_state", srv.AddJointState, JointState(name=["a"], position=[9.0]), "added")
    call("reinitialise_joint_state_manager", srv.ReinitManager, "")
    assert lists("joint_states") == (["down", "up"], 0)
    (folder() / "other.yaml").write_text("mine: {a: 1.0}\n")
    assert call("reinitialise_joint_state_manager", srv.ReinitManager, "other.yaml").success
    assert lists("joint_states") == (["mine"], 0)
    call("add_plan", srv.AddMoveitPlan, RobotTrajectory(), "p")
    assert call("reinitialise_plan_manager", srv.ReinitManager, "").success and lists("plans") == ([], 0)
    call("reload_joint_states", srv.MessageFile, "")


def test_poses_of_the_file_are_poses_of_things_and_of_robots(managers):
    assert not call("reload_poses", srv.MessageFile, "").success
    pose = call("get_pose", srv.GetPoseStamped, "table").pose_stamped
    assert pose.header.frame_id == "world" and pose.pose.position.z == 0.75
    assert pose.pose.orientation.z == pytest.approx(math.sin(0.25))
    robot = call("get_robot_pose", srv.GetRobotPose, "both").robot_pose
    assert robot.end_effector_link_names == ["left", "right"]
    assert [item.position.x for item in robot.pose_array.poses] == [0.1, 0.2]
    assert robot.pose_array.header.frame_id == "base"
    assert "poses.yaml:5" in managers.log()


def test_a_line_of_the_log_asks_the_master_nothing(managers, monkeypatch):
    rospy.loginfo("the first line may ask for the parameter, which is remembered")
    calls = []
    ask = Transport.request
    this = threading.current_thread()

    def request(*call, **options):
        if threading.current_thread() is this:
            calls.append(call[1:])
        return ask(*call, **options)

    monkeypatch.setattr(Transport, "request", request)
    assert rospy.get_param_names() and calls, "a question to the master is seen"
    calls.clear()
    rospy.loginfo("another line")
    assert calls == []
    assert rospy.get_param("/rosout_disable_topics_generation") is False  # topics are still named in every line
