# SPDX-License-Identifier: BSD-3-Clause
"""Plain roslaunch resolves the names of a launch and its configuration files before any node."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest
import roslaunch.rlutil
import rospkg

from modular_framework_benchmark.launch_checks.ros_launch_check import launch_faults

START = ("modular_framework_api", "start_framework.launch", "gui:=false", "rviz:=false")
HARDWARE = """<launch>
  <include file="$(find modular_framework_api)/launch/start_framework.launch">
    <arg name="simulation" value="false"/>
    <arg name="controller_file" value="ur5_controller.yaml"/>
    <arg name="connection_file" value="connection_emulators.yaml"/>
    <arg name="task_constructor_script" value="pick_and_hold.yaml"/>
    <arg name="config_directory" value="FOLDER"/>
  </include>
  <param name="ur_robot_hw/robot_ip_address" value="127.0.0.1"/>
  <param name="ezgripper_robot_hw/port_name" value="/dev/null"/>
  <node pkg="tf2_ros" type="static_transform_publisher" name="my_method" args="0 0 0 0 0 0 world mine"/>
  <machine name="lab_pc" address="lab-pc"/>
  <node pkg="driver_of_the_lab_pc" type="driver" name="driver" machine="lab_pc"/>
</launch>"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy of the configuration folder."""
    copy = tmp_path / "config"
    shutil.copytree(Path(rospkg.RosPack().get_path("modular_framework_api")) / "config", copy)
    return copy


def change(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert text.count(old) == 1
    file.write_text(text.replace(old, new))


def test_tasks_find_the_models_in_the_folders_of_the_environment(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GAZEBO_MODEL_PATH", f"{tmp_path}:")
    started = end_of_roslaunch(*START)
    assert started.returncode == 0, started.stderr
    models = Path(rospkg.RosPack().get_path("modular_framework_description")) / "models"
    assert f"/gazebo_model_path: {models}/:{tmp_path}\n" in started.stdout


def end_of_roslaunch(*words: str) -> subprocess.CompletedProcess[str]:
    """Loads a launch file and its parameters without starting anything."""
    return subprocess.run(["roslaunch", "--dump-params", *words], capture_output=True, text=True, check=False)


def test_every_misspelt_name_is_refused_with_the_nearest_one(folder: Path) -> None:
    change(folder / "generative_methods_config.yaml", "yaw_step:", "yaw_stp: 0.2 # ")
    with (folder / "motion_planner_config.yaml").open("a") as file:
        file.write("planner_nme: RRT\nmove_group/planning_pipelines/ompl/jigle_fraction: 0.1\n")
    wrong = ("planner_name:=BKPIECEE", "states_directory:=/none")
    ended = end_of_roslaunch(*START, f"config_directory:={folder}", *wrong)
    sentences, note, _ = ended.stderr.partition("Nothing was started.")
    assert note and not ended.stdout
    assert len(sentences.splitlines()) == 5
    for words in (
        "does not read the parameter '/top_down_grasp_generator/yaw_stp'; did you mean '/top_down_grasp_generator/yaw_",
        "no node reads the parameter '/planner_nme'; did you mean '/planner_name'?",
        "pipeline 'ompl' has no parameter 'jigle_fraction'; did you mean 'jiggle_fraction'?",
        "parameter '/planner_name': there is no planner 'BKPIECEE'; allowed: RRTConnect, ",
        "argument 'states_directory': there is no folder /none",
    ):
        assert words in sentences


def test_every_misspelt_name_in_the_file_of_a_vendors_driver_is_refused_with_the_nearest_one(folder: Path) -> None:
    (folder / "vendor.yaml").write_text(
        "move_group: {controller_list: [{name: /a, type: GripperComand, joints: [elbw_joint], action_n: b}]}\n"
        "vendor_driver: {joint_state: [/b], silence_timeout: 0}\n"
    )
    arguments = ("simulation:=false", f"config_directory:={folder}", "vendor_driver_file:=vendor.yaml")
    ended = end_of_roslaunch(*START, *arguments, "task_constructor_script:=pick_and_hold.yaml")
    for words in (
        "entry 0 has no key 'action_n'; allowed: name, action_ns",
        "type is 'GripperComand'; allowed: FollowJointTrajectory, GripperCommand; did you mean 'GripperCommand'?",
        "the robot has no joint 'elbw_joint'; allowed: ",
        "did you mean 'elbow_joint'?",
        "does not read the parameter '/vendor_driver/joint_state'; did you mean '/vendor_driver/joint_states'?",
        "parameter '/vendor_driver/silence_timeout' is 0; allowed: a number, above 0",
    ):
        assert words in ended.stderr, ended.stderr


def test_parameters_and_nodes_of_ones_own_are_taken(folder: Path, tmp_path: Path) -> None:
    with (folder / "generative_methods_config.yaml").open("a") as file:
        file.write("my_method: {yaw_stp: 0.2}\nmy_other_method: {gain: 1.0}\n")
    (tmp_path / "mine.launch").write_text(HARDWARE.replace("FOLDER", str(folder)))
    (tmp_path / "later.launch").write_text("<launch><param name='my_method/gain' value='2.0'/></launch>")
    ended = end_of_roslaunch(str(tmp_path / "mine.launch"), str(tmp_path / "later.launch"))
    assert "/my_method/yaw_stp: 0.2" in ended.stdout and "/my_method/gain: 2.0" in ended.stdout, ended.stderr


def test_a_robot_that_xacro_cannot_expand_is_named_with_its_argument(tmp_path: Path) -> None:
    (tmp_path / "bad.xacro").write_text('<robot name="a" xmlns:xacro="http://www.ros.org/wiki/xacro">${no}</robot>')
    file = f"{'../' * 20}{tmp_path}/bad.xacro"
    ended = end_of_roslaunch(*START, f"robot_urdf_file:={file}")
    assert f"argument 'robot_urdf_file' is '{file}', which xacro cannot expand" in ended.stderr


def test_regions_that_are_not_valid_yaml_are_named() -> None:
    ended = end_of_roslaunch(*START, "regions:={a: [")
    assert ended.stderr.startswith("argument 'regions' is '{a: [', which is not valid YAML: ")


JOINT = """<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" effort="10" velocity="1"/></joint>"""


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        (
            'parent link="base"',
            'parent link="bse"',
            "robot_description:[0-9]+: joint 'turn' has the parent link 'bse'.*'base'",
        ),
        (
            'xyz="0 0 1"',
            'xyz="0 0 0"',
            "robot_description:[0-9]+: joint 'turn' has the axis 0 0 0; give it a direction",
        ),
        (JOINT, "", re.escape("2 links have no parent joint (base, arm); allowed: a URDF with one root link")),
    ],
)
def test_a_robot_that_is_no_tree_of_links_is_named_with_its_file(
    old: str, new: str, fault: str, tmp_path: Path
) -> None:
    urdf = f'<robot name="a"><link name="base"/><link name="arm"/>{JOINT}</robot>'
    (tmp_path / "mine.urdf").write_text(urdf.replace(old, new))
    file = f"{'../' * 20}{tmp_path}/mine.urdf"
    path = roslaunch.rlutil.resolve_launch_arguments(list(START[:2]))[0]
    faults = launch_faults(path, [*START[2:], f"robot_urdf_file:={file}", "urdf_args:="])
    assert [text for text in faults if re.search(f"^argument 'robot_urdf_file' is '{file}': {fault}", text)], faults
