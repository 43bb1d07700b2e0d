# SPDX-License-Identifier: BSD-3-Clause
"""RViz opens with a ROS 2 configuration: without an error window, with all displays, and with their topics."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest
import rosgraph
import yaml

from modular_framework_testing.ros_session import RosSession, until

QOS = {"Depth": 5, "Durability Policy": "Volatile", "History Policy": "Keep Last", "Reliability Policy": "Reliable"}
WITH_TOPIC = (
    "AccelStamped",
    "Effort",
    "FluidPressure",
    "GridCells",
    "Illuminance",
    "Image",
    "LaserScan",
    "Map",
    "Marker",
    "MarkerArray",
    "Odometry",
    "Path",
    "PointCloud",
    "PointCloud2",
    "PointStamped",
    "Polygon",
    "Pose",
    "PoseArray",
    "PoseWithCovariance",
    "Range",
    "RelativeHumidity",
    "Temperature",
    "TwistStamped",
    "Wrench",
)
"""Displays of rviz_default_plugins with the property `Topic`."""
PANELS = ("Displays", "Selection", "Tool Properties", "Views", "Time", "Help")
TOOLS = ("Interact", "MoveCamera", "Select", "FocusCamera", "Measure")
TOOLS_WITH_TOPIC = ("SetInitialPose", "SetGoal", "PublishPoint")
URDF = """<robot name='r'><link name='base'><visual><geometry><box size='1 1 1'/></geometry></visual></link></robot>"""
LAUNCH = """
from launch import LaunchDescription
from launch_ros.actions import Node

def generate_launch_description():
    return LaunchDescription([Node(package="rviz2", executable="rviz2", name="rviz2", output="screen",
                                   arguments=["-d", {file!r}], parameters=[{{"robot_description": {urdf!r}}}])])
"""


def topic(name: str) -> dict[str, Any]:
    return {**QOS, "Value": f"/shown/{name}"}


def display(name: str, **properties: Any) -> dict[str, Any]:
    return {"Class": f"rviz_default_plugins/{name}", "Enabled": True, "Name": name, "Value": True, **properties}


def view(controller: str, name: str) -> dict[str, Any]:
    value = f"{controller} (rviz_default_plugins)"
    return {"Class": f"rviz_default_plugins/{controller}", "Name": name, "Value": value}


def config() -> dict[str, Any]:
    """Returns a configuration as RViz of ROS 2 saves it, with a class of each kind that ROS 1 lacks."""
    displays = [
        display("Grid"),
        display("Axes"),
        display("TF"),
        display("RobotModel", **{"Description Source": "Topic", "Description Topic": topic("robot_description")}),
        display("InteractiveMarkers", **{"Interactive Markers Namespace": "/shown/interactive"}),
        *(display(name, Topic=topic(name)) for name in WITH_TOPIC),
        {"Class": "nav2_rviz_plugins/ParticleCloud", "Name": "Particles", "Enabled": True},
        {"Class": "moveit_rviz_plugin/MotionPlanning", "Name": "MotionPlanning", "Enabled": True},
    ]
    return {
        "Panels": [
            *({"Class": f"rviz_common/{name}", "Name": name} for name in PANELS),
            {"Class": "nav2_rviz_plugins/Navigation 2", "Name": "Navigation 2"},
        ],
        "Visualization Manager": {
            "Class": "",
            "Displays": displays,
            "Enabled": True,
            "Global Options": {"Background Color": "48; 48; 48", "Fixed Frame": "base", "Frame Rate": 30},
            "Name": "root",
            "Tools": [
                *({"Class": f"rviz_default_plugins/{name}"} for name in TOOLS),
                *({"Class": f"rviz_default_plugins/{name}", "Topic": topic(name)} for name in TOOLS_WITH_TOPIC),
                {"Class": "nav2_rviz_plugins/GoalTool"},
            ],
            "Transformation": {"Current": {"Class": "rviz_default_plugins/TF"}},
            "Value": True,
            "Views": {
                "Current": view("Orbit", "Current View"),
                "Saved": [view("TopDownOrtho", "top"), view("FPS", "inside"), {"Class": "x/View", "Name": "other"}],
            },
        },
        "Window Geometry": {"Height": 800, "Width": 1000, "X": 0, "Y": 0},
    }


def windows(screen: str) -> list[str]:
    """Returns the titles of the top-level windows of RViz that are visible."""

    def answer(*arguments: str) -> str:
        command = ["xwininfo", *arguments, "-display", screen]
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout

    found = re.findall(r'(0x[0-9a-f]+) "(.*)": \("rviz" "rviz"\)', answer("-root", "-children"))
    return [title for number, title in found if "IsViewable" in answer("-id", number)]


def test_rviz_opens_with_a_configuration_of_ros_2(
    ros_session: RosSession,
    screen: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(ros_session.env, "DISPLAY", screen)
    monkeypatch.setitem(ros_session.env, "LIBGL_ALWAYS_SOFTWARE", "1")
    source, launch_file = tmp_path / "saved.rviz", tmp_path / "show.launch.py"
    source.write_text(yaml.safe_dump(config(), sort_keys=False))
    launch_file.write_text(LAUNCH.format(file=str(source), urdf=URDF))
    launch = ros_session.start(["rosrun", "launch", "launch_py", str(launch_file)])
    master = rosgraph.Master("/test", master_uri=ros_session.env["ROS_MASTER_URI"])

    def topics(of: int) -> set[str]:
        return {name for name, nodes in master.getSystemState()[of] if "/rviz2" in nodes}

    try:
        title = re.compile(r"saved_\w+\.rviz\*? - RViz")
        until(lambda: any(map(title.fullmatch, windows(screen))), "the window of RViz", 60.0)
        shown = {f"/shown/{name}" for name in WITH_TOPIC} | {"/shown/interactive/update"}
        until(lambda: shown <= topics(1), "the displays' subscriptions")
        assert {f"/shown/{name}" for name in TOOLS_WITH_TOPIC} <= topics(0)
        until(lambda: len(windows(screen)) == 1, "the main window alone, without a splash screen or an error window")
        assert "failed to load" not in launch.log()
    finally:
        launch.stop()
