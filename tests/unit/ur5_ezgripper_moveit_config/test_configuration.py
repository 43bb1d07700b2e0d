# SPDX-License-Identifier: BSD-3-Clause
"""The planning configuration names what the robot has, and the launch files put it where planners look."""

import math
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import pytest
import rospkg
import yaml
from urdf_parser_py.urdf import URDF

from modular_framework_planning.move_group import capability_names as names
from modular_framework_planning.planners.ompl.planner import PLANNERS

ARM = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
KNUCKLE = "ezgripper_knuckle_palm_L1_1"


def config(package: Path, name: str):
    with open(package / "config" / name, encoding="utf-8") as file:
        return yaml.safe_load(file)


@pytest.fixture(scope="module")
def parameters() -> dict:
    result = subprocess.run(
        [
            "roslaunch",
            "--dump-params",
            "ur5_ezgripper_moveit_config",
            "move_group.launch",
            "load_robot_description:=true",
        ],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert result.returncode == 0, result.stderr
    return yaml.safe_load(result.stdout)


def test_the_groups_and_the_end_effector_of_the_original_exist(srdf: ElementTree.Element) -> None:
    groups = {element.get("name") for element in srdf.findall("group")}
    assert groups == {"arm", "end_effector", "manipulator", "arm_and_manipulator", "ezgripper_finger_1", "ezgripper"}
    chain = srdf.find("group[@name='arm_and_manipulator']/chain")
    assert chain is not None
    assert (chain.get("base_link"), chain.get("tip_link")) == ("base_link", "eg_manipulator")
    effector = srdf.find("end_effector")
    assert effector is not None
    assert (effector.get("name"), effector.get("group")) == ("ezgripper_finger_1_ee", "ezgripper")
    states = {(e.get("group"), e.get("name")) for e in srdf.iter("group_state")}
    assert {("ezgripper", "open"), ("ezgripper", "closed")} <= states


def test_every_name_of_the_srdf_is_one_of_the_robot(srdf: ElementTree.Element, urdf: str) -> None:
    robot = URDF.from_xml_string(urdf)
    links, joints = set(robot.link_map), set(robot.joint_map)
    for element in srdf.iter("disable_collisions"):
        assert {element.get("link1"), element.get("link2")} <= links
    for element in srdf.iter("chain"):
        assert {element.get("base_link"), element.get("tip_link")} <= links
    for tag in ("joint", "passive_joint"):
        assert {element.get("name") for element in srdf.iter(tag)} <= joints
    assert srdf.get("name") == robot.name


def test_every_arm_joint_has_velocity_and_acceleration_limits_within_the_urdf(package: Path, urdf: str) -> None:
    joints = URDF.from_xml_string(urdf).joint_map
    limits = config(package, "joint_limits.yaml")["joint_limits"]
    assert set(limits) == {*ARM, KNUCKLE}
    for name, limit in limits.items():
        assert limit["has_velocity_limits"] and limit["has_acceleration_limits"]
        assert 0 < limit["max_velocity"] <= joints[name].limit.velocity
        assert limit["max_acceleration"] > 0


def test_controllers_are_those_of_the_robot_package_with_the_same_joints(package: Path) -> None:
    robot = rospkg.RosPack().get_path("ur5_ezgripper_robot")
    with open(f"{robot}/controllers/ur5_ezgripper_controller_simulation.yaml", encoding="utf-8") as file:
        loaded = yaml.safe_load(file)
    listed = {entry["name"]: entry for entry in config(package, "moveit_controllers.yaml")["controller_list"]}
    assert listed["arm_trajectory_controller"]["joints"] == loaded["arm_trajectory_controller"]["joints"] == ARM
    assert listed["ezgripper_controller"]["joints"] == [loaded["ezgripper_controller"]["joint"]] == [KNUCKLE]
    kinds = {name: (entry["type"], entry["action_ns"]) for name, entry in listed.items()}
    assert kinds == {
        "arm_trajectory_controller": ("FollowJointTrajectory", "follow_joint_trajectory"),
        "ezgripper_controller": ("GripperCommand", "gripper_cmd"),
    }


@pytest.mark.parametrize("group", ["arm", "arm_and_manipulator"])
def test_a_group_plans_with_rrtconnect_unless_configured_otherwise(package: Path, group: str) -> None:
    planning = config(package, "ompl_planning.yaml")
    assert planning[group]["default_planner_config"] == "RRTConnect"
    assert set(planning[group]["planner_configs"]) == set(planning["planner_configs"])
    extent = math.sqrt(5 * (4 * math.pi) ** 2 + (2 * math.pi) ** 2)  # the elbow turns once, the other joints twice
    assert 0 < planning[group]["longest_valid_segment_fraction"] * extent <= 0.05


def test_the_planners_are_those_the_planning_node_offers(package: Path) -> None:
    planners = config(package, "ompl_planning.yaml")["planner_configs"]
    assert set(planners) == set(PLANNERS)
    for name, values in planners.items():
        assert values["type"] == f"geometric::{name}"
        assert all(isinstance(value, int | float) for key, value in values.items() if key != "type")


def test_move_group_finds_its_parameters_in_the_noetic_layout(parameters: dict) -> None:
    assert "<robot" in parameters["/robot_description"]
    assert "<robot" in parameters["/robot_description_semantic"]
    assert parameters["/robot_description_planning/joint_limits/elbow_joint/max_velocity"] == 3.15
    for group in ("arm", "arm_and_manipulator"):
        assert f"/robot_description_kinematics/{group}/kinematics_solver" in parameters
        assert parameters[f"/move_group/planning_pipelines/ompl/{group}/default_planner_config"] == "RRTConnect"
    assert parameters["/move_group/default_planning_pipeline"] == "ompl"
    adapters = parameters["/move_group/planning_pipelines/ompl/request_adapters"].split()
    assert adapters[0] == "default_planner_request_adapters/AddTimeOptimalParameterization"
    execution = "/move_group/trajectory_execution/"
    assert parameters[execution + "allowed_start_tolerance"] == 0.01
    assert parameters[execution + "allowed_execution_duration_scaling"] == 1.2
    assert [entry["name"] for entry in parameters["/move_group/controller_list"]] == [
        "arm_trajectory_controller",
        "ezgripper_controller",
    ]
    assert parameters["/move_group/sensors"] == []


def test_the_pipeline_of_industrial_motions_is_loaded_beside_the_default_one(parameters: dict) -> None:
    pilz = "/move_group/planning_pipelines/pilz_industrial_motion_planner/"
    assert parameters[pilz + "planning_plugin"] == "pilz_industrial_motion_planner::CommandPlanner"
    assert parameters[pilz + "default_planner_config"] == "PTP" and parameters[pilz + "request_adapters"] == ""
    assert "pilz_industrial_motion_planner/MoveGroupSequenceAction" in parameters[pilz + "capabilities"].split()
    limits = "/robot_description_planning/cartesian_limits/"
    assert parameters[limits + "max_trans_vel"] == 1.0 and parameters[limits + "max_trans_dec"] < 0.0


def test_every_argument_of_every_launch_file_is_explained(package: Path) -> None:
    files = [path for path in sorted((package / "launch").glob("*.launch*")) if path.suffix != ".py"]
    assert len(files) >= 9
    for path in files:
        for argument in ElementTree.parse(path).getroot().findall("arg"):
            assert argument.get("doc"), f"{path.name}: argument {argument.get('name')} has no doc"


def test_the_controllers_of_both_demos_are_those_that_execute_motions(package: Path) -> None:
    executing = {entry["name"] for entry in config(package, "moveit_controllers.yaml")["controller_list"]}
    python_demo = config(package, "ros2_controllers.yaml")
    listed = python_demo["controller_manager"]["ros__parameters"]
    assert executing == {name for name, value in listed.items() if isinstance(value, dict)} - {
        "joint_state_broadcaster"
    }
    root = ElementTree.parse(package / "launch" / "demo.launch").getroot()
    spawner = root.find("node[@name='spawner']")
    assert spawner is not None and executing <= set(spawner.attrib["args"].split())
    assert python_demo["arm_trajectory_controller"]["ros__parameters"]["joints"] == ARM


def test_the_launch_ends_when_move_group_does(package: Path) -> None:
    node = ElementTree.parse(package / "launch" / "move_group.launch").getroot().find("node")
    assert node is not None
    expected = {"pkg": "moveit_ros_move_group", "type": "move_group", "name": "move_group", "required": "true"}
    assert expected.items() <= node.attrib.items()


def test_rviz_shows_robot_frames_scene_and_motion_with_its_own_displays(package: Path) -> None:
    with open(package / "launch" / "moveit.rviz", encoding="utf-8") as file:
        view = yaml.safe_load(file)["Visualization Manager"]
    plugins = ElementTree.parse(f"{rospkg.RosPack().get_path('rviz')}/plugin_description.xml")
    available = {element.get("name") for element in plugins.iter("class")}
    assert {display["Class"] for display in view["Displays"]} <= available
    assert {display.get("Marker Topic") for display in view["Displays"]} >= {
        "/move_group/planning_scene_markers",
        "/move_group/display_planned_path_markers",
    }
    assert view["Global Options"]["Fixed Frame"] == "world"


def test_the_setup_assistant_would_find_robot_and_semantics(package: Path) -> None:
    with open(package / ".setup_assistant", encoding="utf-8") as file:
        settings = yaml.safe_load(file)["moveit_setup_assistant_config"]
    robot = Path(rospkg.RosPack().get_path(settings["URDF"]["package"]))
    assert (robot / settings["URDF"]["relative_path"]).is_file()
    assert (package / settings["SRDF"]["relative_path"]).is_file()


@pytest.mark.parametrize("where_is", ["ur5_ezgripper_moveit_config/launch", "moveit_ros_visualization/config"])
def test_rviz_shows_every_topic_of_markers_the_planner_publishes(where_is: str) -> None:
    where, folder = where_is.split("/")
    file = Path(rospkg.RosPack().get_path(where), folder, "moveit.rviz")
    displays = yaml.safe_load(file.read_text())["Visualization Manager"]["Displays"]
    shown = {display["Marker Topic"] for display in displays if display["Class"] == "rviz/MarkerArray"}
    topics = (names.SCENE_MARKERS_TOPIC, names.OCTOMAP_MARKERS_TOPIC, names.PATH_MARKERS_TOPIC)
    published = {topic.replace("~", "/move_group/") for topic in topics}
    assert shown == published | {"/interactive_goal/start_ghost", "/interactive_goal/goal_ghost"}
    assert "/interactive_goal/marker/update" in {display.get("Update Topic") for display in displays}
