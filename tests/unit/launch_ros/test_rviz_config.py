# SPDX-License-Identifier: BSD-3-Clause
"""RViz of ROS 1 is started with a configuration it can read, whichever ROS a configuration was written for."""

from pathlib import Path
from typing import Any

import pytest
import yaml
from launch import LaunchContext
from launch_ros.actions import Node

QOS = {"Depth": 5, "Durability Policy": "Volatile", "History Policy": "Keep Last", "Reliability Policy": "Reliable"}
WRITTEN_BY_HAND = """
Visualization Manager:
  Displays:
    - {Class: rviz_default_plugins/LaserScan, Topic: {Value: /scan}}
    - {Class: rviz_default_plugins/Image, Topic: {Value: /stereo/disparity, Depth: 5}}
    - {Class: rviz_default_plugins/MarkerArray, Topic: {Depth: 5, Durability Policy: Volatile, Value: /swarm/markers}}
    - {Class: rviz_default_plugins/PointCloud2, Topic: {Value: /points, Reliability Policy: Best Effort}}
    - {Class: rviz_default_plugins/Marker, Topic: /marker}
    - {Class: rviz_default_plugins/Camera, Topic: /camera/image_raw}
    - {Class: rviz_default_plugins/Path, Topic: /plan, Line Style: {Line Width: 0.1, Value: Lines}}
    - {Class: rviz_default_plugins/RobotModel, Description Topic: {Value: /robot_description}}
  Tools:
    - {Class: rviz_default_plugins/SetGoal, Topic: {Value: /goal_pose}}
"""
ORBIT = {"Class": "rviz_default_plugins/Orbit", "Name": "Current View", "Distance": 2.7, "Value": "Orbit (rviz)"}
DISPLAYS = [
    {"Class": "rviz_default_plugins/Grid", "Name": "Grid", "Plane Cell Count": 10},
    {"Class": "rviz_default_plugins/RobotModel", "Description Topic": {**QOS, "Value": "/left/robot_description"}},
    {"Class": "rviz_default_plugins/MarkerArray", "Topic": {**QOS, "Value": "/markers"}},
    {"Class": "rviz_default_plugins/Wrench", "Topic": {**QOS, "Value": "/force", "Reliability Policy": "Best Effort"}},
    {"Class": "rviz_default_plugins/InteractiveMarkers", "Interactive Markers Namespace": "/goal"},
    {"Class": "nav2_rviz_plugins/ParticleCloud", "Name": "Particles"},
    {"Class": "moveit_rviz_plugin/Trajectory", "Name": "Trajectory", "Enabled": False},
    {"Class": "moveit_rviz_plugin/MotionPlanning", "Name": "MotionPlanning", "Enabled": True},
    {
        "Class": "rviz_common/Group",
        "Displays": [{"Class": "rviz_default_plugins/Image", "Topic": {**QOS, "Value": "/i"}}],
    },
]
TOOLS = [
    {"Class": "rviz_default_plugins/Interact", "Hide Inactive Objects": True},
    {"Class": "rviz_default_plugins/SetGoal", "Topic": {**QOS, "Value": "/goal_pose"}},
    {"Class": "nav2_rviz_plugins/GoalTool"},
]
FROM_ROS2: dict[str, Any] = {
    "Panels": [
        {"Class": "rviz_common/Tool Properties", "Name": "Tools"},
        {"Class": "rviz_visual_tools/Gui", "Name": "G"},
    ],
    "Visualization Manager": {
        "Displays": DISPLAYS,
        "Global Options": {"Fixed Frame": "base_link"},
        "Tools": TOOLS,
        "Transformation": {"Current": {"Class": "rviz_default_plugins/TF"}},
        "Views": {
            "Current": ORBIT,
            "Saved": [
                {"Class": "rviz_default_plugins/FPS", "Value": "FPS (rviz_default_plugins)"},
                {"Class": "x/View"},
            ],
        },
    },
    "Window Geometry": {"Height": 1016},
}


def started_with(path: Path, *, package: str = "rviz2", option: str = "-d") -> Path:
    """Returns the configuration that a node of RViz is started with."""
    arguments = ["-d", str(path)] if option == "-d" else [f"{option}={path}"]
    context = LaunchContext()
    Node(package=package, executable=package, arguments=["-f", "map", *arguments]).visit(context)
    command = context.requests[0].command
    assert command[1:3] == ["-f", "map"]
    return Path(command[-1].partition("=")[2] or command[-1])


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ROS_HOME", str(tmp_path / "home"))
    path = tmp_path / "moveit.rviz"
    path.write_text(yaml.safe_dump(FROM_ROS2))
    return path


@pytest.fixture
def translated(source: Path) -> dict[str, Any]:
    result = yaml.safe_load(started_with(source).read_text())
    assert yaml.safe_load(source.read_text()) == FROM_ROS2  # a source file is not written to
    return result


def test_panels_tools_and_views_are_those_of_ros_1(translated: dict[str, Any]) -> None:
    manager = translated["Visualization Manager"]
    assert translated["Panels"] == [{"Class": "rviz/Tool Properties", "Name": "Tools"}]
    assert manager["Tools"] == [
        {"Class": "rviz/Interact", "Hide Inactive Objects": True},
        {"Class": "rviz/SetGoal", "Topic": "/goal_pose"},
    ]
    assert manager["Views"]["Current"] == {**ORBIT, "Class": "rviz/Orbit"}
    assert manager["Views"]["Saved"] == [{"Class": "rviz/FPS", "Value": "FPS (rviz)"}]
    assert manager["Global Options"] == {"Fixed Frame": "base_link"}
    assert "Transformation" not in manager  # RViz of ROS 1 has tf and no choice


def test_displays_have_the_names_and_properties_of_ros_1(translated: dict[str, Any]) -> None:
    displays = translated["Visualization Manager"]["Displays"]
    moveit = displays.pop()
    assert displays == [
        {"Class": "rviz/Grid", "Name": "Grid", "Plane Cell Count": 10},
        {"Class": "rviz/RobotModel", "Robot Description": "/left/robot_description"},
        {"Class": "rviz/MarkerArray", "Marker Topic": "/markers"},
        {"Class": "rviz/WrenchStamped", "Topic": "/force", "Unreliable": True},
        {"Class": "rviz/InteractiveMarkers", "Update Topic": "/goal/update"},
        {"Class": "rviz/Group", "Displays": [{"Class": "rviz/Image", "Image Topic": "/i"}]},
    ]
    assert (moveit["Class"], moveit["Enabled"]) == ("rviz/Group", True)
    shown = [(each["Class"], each.get("Marker Topic", "")) for each in moveit["Displays"]]
    assert ("rviz/RobotModel", "") in shown
    assert ("rviz/MarkerArray", "/move_group/display_planned_path_markers") in shown


def test_topics_with_any_settings_and_topics_without_are_names_in_ros_1(source: Path) -> None:
    source.write_text(WRITTEN_BY_HAND)
    manager = yaml.safe_load(started_with(source).read_text())["Visualization Manager"]
    assert manager["Displays"] == [
        {"Class": "rviz/LaserScan", "Topic": "/scan"},
        {"Class": "rviz/Image", "Image Topic": "/stereo/disparity"},
        {"Class": "rviz/MarkerArray", "Marker Topic": "/swarm/markers"},
        {"Class": "rviz/PointCloud2", "Topic": "/points", "Unreliable": True},
        {"Class": "rviz/Marker", "Marker Topic": "/marker"},
        {"Class": "rviz/Camera", "Image Topic": "/camera/image_raw"},
        {"Class": "rviz/Path", "Topic": "/plan", "Line Style": {"Line Width": 0.1, "Value": "Lines"}},
        {"Class": "rviz/RobotModel", "Robot Description": "/robot_description"},
    ]
    assert manager["Tools"] == [{"Class": "rviz/SetGoal", "Topic": "/goal_pose"}]


def test_the_log_names_a_description_file_that_ros_1_does_not_read(
    source: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = "Class: rviz_default_plugins/RobotModel, Name: Arm, Description Topic: {Value: ''}"
    source.write_text(
        f"Visualization Manager: {{Displays: [{{{robot}, Description Source: File, Description File: /a.urdf}}]}}"
    )
    started_with(source)
    expected = "display 'Arm' shows the robot of parameter robot_description instead of file '/a.urdf'"
    assert expected in " ".join(capsys.readouterr().out.split())


def test_the_log_names_each_class_that_ros_1_lacks(source: Path, capsys: pytest.CaptureFixture[str]) -> None:
    started_with(source)
    lines = capsys.readouterr().out
    for name in ("rviz_visual_tools/Gui", "nav2_rviz_plugins/ParticleCloud", "nav2_rviz_plugins/GoalTool", "x/View"):
        assert f"({name}) is left out" in lines
    assert "displays Trajectory, MotionPlanning of MoveIt's plugin are replaced" in lines


@pytest.mark.parametrize("option", ["-d", "--display-config"])
def test_a_configuration_of_ros_2_is_translated_for_rviz_of_ros_1_too(option: str, source: Path) -> None:
    result = started_with(source, package="rviz", option=option)
    assert result.is_relative_to(source.parent / "home")
    assert started_with(result) == result  # a translation is a configuration of ROS 1


@pytest.mark.parametrize("content", [None, "", "- a list", "{", "Panels: [{Class: rviz/Displays}]"])
def test_a_file_that_needs_no_translation_is_given_as_it_is(content: str | None, tmp_path: Path) -> None:
    path = tmp_path / "a.rviz"
    if content is not None:
        path.write_text(content)
    assert started_with(path) == path


def test_the_default_configuration_of_rviz_needs_no_translation() -> None:
    path = Path("/usr/share/rviz/default.rviz")
    if not path.is_file():
        pytest.skip("RViz's own files are elsewhere")
    assert started_with(path) == path
