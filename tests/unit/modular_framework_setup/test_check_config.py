# SPDX-License-Identifier: BSD-3-Clause
"""Each inconsistency of a config package is named with its file and line, and all of them at once."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import pytest
import rospkg
from lxml import html
from small_package import SmallPackage

from modular_framework_setup.commands.check_command import main

SHAPE = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'
SHIPPED = [name for name in rospkg.RosPack().list() if name.endswith("_moveit_config")]
SRDF, LIMITS, IK = "config/crane.srdf", "config/joint_limits.yaml", "config/kinematics.yaml"
MOVEIT, HARDWARE = "config/simple_moveit_controllers.yaml", "config/ros_controllers.yaml"
OMPL, LAUNCH = "config/ompl_planning.yaml", "launch/move_group.launch"


@dataclass(frozen=True)
class Edit:
    """An edit that breaks the package: what becomes what in a file, and what the complaint says.

    `lower` is how many lines below the begin of the edit the complaint is; `file` has it where it is another file.
    """

    name: str
    old: str
    new: str
    says: tuple[str, ...]
    lower: int = 0
    file: str = ""


EDITS = {
    "joint of a group": Edit(SRDF, '<joint name="grip_1"/>', '<joint name="gripp_1"/>', ("'gripp_1'", "mean 'grip_1'")),
    "link of a chain": Edit(SRDF, 'tip_link="palm"', 'tip_link="plam"', ("tip_link", "'plam'", "did you mean 'palm'")),
    "tip above base": Edit(
        SRDF,
        'base_link="base" tip_link="palm"',
        'base_link="palm" tip_link="base"',
        ("'base' is not a descendant of", "finger_1"),
    ),
    "unknown group of a state": Edit(SRDF, 'name="home" group="arm"', 'name="home" group="arms"', ("'arms'", "'arm'")),
    "state out of its group": Edit(
        SRDF,
        '<joint name="elbow" value="1"/>',
        '<joint name="elbow" value="1"/><joint name="grip_1" value="0"/>',
        ("state 'home'", "'grip_1' is not in the group", "allowed: pan, lift, elbow"),
    ),  # fmt: skip
    "state beyond limits": Edit(SRDF, 'value="0.5"', 'value="1.5"', ("'lift' is at 1.5", "-1 to 1")),
    "state without a joint": Edit(SRDF, '    <joint name="pan" value="0"/>\n', "", ("no value for pan",), lower=-1),
    "end effector's link": Edit(SRDF, 'parent_link="palm" ', "", ("no attribute 'parent_link'",)),
    "end effector's group": Edit(SRDF, 'parent_group="arm"', 'parent_group="am"', ("parent_group 'am'", "'arm'")),
    "pair of unknown links": Edit(SRDF, 'link2="turret"', 'link2="turet"', ("link2 'turet'", "did you mean 'turret'")),
    "virtual joint": Edit(SRDF, 'child_link="base"', 'child_link="boom"', ("'boom' is not the root", "allowed: base")),
    "place of a planar base": Edit(
        SRDF,
        '  <virtual_joint name="fixed_base" type="fixed"',
        '  <group name="base"><joint name="fixed_base"/></group><group_state name="dock" group="base"><joint '
        'name="fixed_base" value="1 2"/></group_state>\n  <virtual_joint name="fixed_base" type="planar"',
        ("state 'dock'", "'fixed_base' has 2 numbers", "planar virtual joint: 3 (x y theta)"),
    ),
    "passive joint": Edit(SRDF, 'passive_joint name="grip_2"', 'passive_joint name="grp_2"', ("'grp_2'", "'grip_2'")),
    "misspelt element": Edit(SRDF, "<passive_joint", "<pasive_joint", ("element 'pasive_joint'", "'passive_joint'")),
    "broken SRDF": Edit(SRDF, "</robot>", "</robt>", ("not an XML document",)),
    "kinematics of no group": Edit(IK, "arm:", "arn:", ("group 'arn'", "did you mean 'arm'")),
    "solver": Edit(IK, "KDLKinematicsPlugin", "KDLKinematicPlugin", ("kinematics_solver", "KDLKinematicsPlugin'?")),
    "limits of no joint": Edit(LIMITS, "pan:", "pn:", ("joint 'pn'", "did you mean 'pan'")),
    "no velocity": Edit(LIMITS, "true\n    max_velocity: 1.5", "true", ("is true, but max_velocity is missing",)),
    "wider than the URDF": Edit(
        LIMITS,
        "pan:\n    has_velocity_limits: true\n    max_velocity: 1.5",
        "pan:\n    has_velocity_limits: true\n    max_velocity: 2.5",
        ("max_velocity 2.5", "at most 2"),
        lower=2,
    ),  # fmt: skip
    "key given twice": Edit(LIMITS, "  lift:", "  pan:", ("the key 'pan' is given twice; first in line 3",)),
    "broken YAML": Edit(LIMITS, "  lift:", "\tlift:", ("not valid YAML", "indent with spaces")),
    "joint of a controller": Edit(MOVEIT, "- grip_1", "- gripp_1", ("joint 'gripp_1'", "did you mean 'grip_1'")),
    "joint claimed twice": Edit(
        MOVEIT, "      - grip_1", "      - grip_1\n      - pan", ("'arm_controller'",), lower=1
    ),
    "joint not moved": Edit(
        MOVEIT, "[pan, lift, elbow]", "[pan, lift]", ("no controller in this file moves elbow", "'arm'"), lower=-4
    ),
    "type": Edit(MOVEIT, "type: GripperCommand", "type: GriperCommand", ("type 'GriperCommand'", "'GripperCommand'")),
    "action": Edit(MOVEIT, "follow_joint_trajectory", "follow_joint_trajectoy", ("action_ns", "'follow_joint_traj")),
    "name of the hardware's": Edit(
        HARDWARE,
        "arm_controller:",
        "arms_controller:",
        ("'arm_controller' is not a hardware", "'arms_controller'"),
        file=MOVEIT,
        lower=-1,
    ),  # fmt: skip
    "joints of the hardware's": Edit(
        HARDWARE, "    - elbow\n", "", ("different joints", "only here: elbow"), file=MOVEIT, lower=-6
    ),
    "action of the hardware's": Edit(MOVEIT, "gripper_cmd", "gripper_action", ("has the action gripper_cmd",)),
    "planner": Edit(OMPL, "    - RRTConnect", "    - RRTConect", ("planner configuration 'RRTConect'", "'RRTConnect'")),
    "planner's type": Edit(OMPL, "geometric::RRTConnect", "geometric::RTConnect", ("'geometric::RRTConnect'",)),
    "planners of no group": Edit(OMPL, "arm:", "arn:", ("group 'arn'", "did you mean 'arm'")),
    "projection": Edit(OMPL, "(pan,lift)", "(pan,lft)", ("projection_evaluator", "'lft'", "did you mean 'lift'")),
    "sensor": Edit("config/sensors_3d.yaml", "PointCloudO", "PointO", ("sensor_plugin is", "PointCloudOctomapUpdater")),
    "launch file": Edit(
        "launch/move_group.launch", "kinematics.yaml", "kinematic.yaml", ("did you mean 'kinematics.",)
    ),
    "mesh": Edit("urdf", "boom.stl", "bom.stl", ("bom.stl", "does not exist")),
    "package of a mesh": Edit("urdf", "crane_robot/meshes", "crane_rbot/meshes", ("'crane_rbot' is not found",)),
    "package of the URDF": Edit(".setup_assistant", "crane_robot", "crane_rbot", ("'crane_rbot'", "crane_robot?")),
    "limits of the URDF": Edit("urdf", 'lower="-3" upper="3"', 'lower="3" upper="-3"', ("3 is above",), lower=-1),
    "mimic joint": Edit("urdf", 'mimic joint="grip_1"', 'mimic joint="grip_3"', ("mimics", "'grip_3'"), lower=-1),
    "number of the URDF": Edit("urdf", 'lower="-3"', 'lower="low"', ("lower is 'low'", "expected a number")),
    "robot's name": Edit(SRDF, 'robot name="crane"', 'robot name="crain"', ("'crain'", "'crane'")),
}


@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS)
def test_a_broken_package_gets_the_right_complaint_at_the_right_line(small: SmallPackage, edit: Edit) -> None:
    line = small.edit(edit.name, edit.old, edit.new) + edit.lower
    faults = small.faults()
    here = [
        fault
        for fault in faults
        if Path(fault.location.file).resolve() == small.path(edit.file or edit.name).resolve()
        and all(words in fault.message for words in edit.says)
    ]
    assert [fault.location.line for fault in here] == [line], "\n".join(map(str, faults))


def test_a_package_without_a_fault_gets_no_complaint(small: SmallPackage) -> None:
    assert small.faults() == ()


def test_all_faults_are_told_at_once(small: SmallPackage) -> None:
    names = ("pair of unknown links", "solver", "limits of no joint", "type", "projection", "mesh")
    chosen = [EDITS[name] for name in names]
    for edit in chosen:
        small.edit(edit.name, edit.old, edit.new)
    text = "\n".join(map(str, small.faults()))
    assert all(words in text for edit in chosen for words in edit.says)


@pytest.mark.parametrize("name", SHIPPED)
def test_the_shipped_packages_have_no_fault(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name]) == 0, capsys.readouterr().out


def test_the_exit_code_is_1_for_faults_and_for_a_package_that_is_not_there(
    small: SmallPackage, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([str(small.folder)]) == 0
    line = small.edit(IK, "arm:", "arn:")
    assert main([str(small.folder)]) == 1
    assert capsys.readouterr().out.startswith(f"{small.folder}/{IK}:{line}:1: group 'arn' is unknown")
    assert main(["ur5_ezgriper_moveit_config"]) == 1
    assert "did you mean 'ur5_ezgripper_moveit_config'" in capsys.readouterr().err


def test_files_of_moveit_2_are_understood(small: SmallPackage) -> None:
    for name in (MOVEIT, HARDWARE):
        small.path(name).unlink()
    (small.folder / "config/moveit_controllers.yaml").write_text(
        "moveit_controller_manager: moveit_simple_controller_manager/MoveItSimpleControllerManager\n"
        "moveit_simple_controller_manager:\n"
        "  controller_names: [arm_controller]\n"
        "  arm_controller:\n"
        "    type: FollowJointTrajectory\n"
        "    joints: [pan, lift, elbow]\n"
    )
    hardware = small.folder / "config/ros2_controllers.yaml"
    hardware.write_text(
        "controller_manager:\n"
        "  ros__parameters:\n"
        "    arm_controller:\n"
        "      type: joint_trajectory_controller/JointTrajectoryController\n"
        "arm_controller:\n"
        "  ros__parameters:\n"
        "    joints: [pan, lift, elbow]\n"
    )
    (small.folder / "config/initial_positions.yaml").write_text("initial_positions:\n  pan: 0\n")
    limits = small.path(LIMITS)
    limits.write_text(limits.read_text().replace("max_velocity: 1.5", "max_velocity: !degrees 80.0"))
    assert small.faults() == ()
    hardware.write_text(hardware.read_text().replace("lift, elbow", "lift"))
    assert [(Path(fault.location.file).name, fault.location.line) for fault in small.faults()] == [
        ("moveit_controllers.yaml", 4)
    ]


def test_a_controller_of_the_root_namespace_has_an_empty_name(small: SmallPackage) -> None:
    small.edit(
        MOVEIT,
        "name: arm_controller\n    action_ns: follow_joint_trajectory",
        'name: ""\n    action_ns: joint_trajectory_action',
    )
    small.edit(MOVEIT, "    action_ns: gripper_cmd\n", "")
    assert small.faults() == ()


def test_a_posture_in_collision_is_a_fault_at_the_state_or_the_robot(small: SmallPackage) -> None:
    """The stick reaches from 0.1 to 0.5 m along x where lift and elbow are 0; a ball stands at 0.4 m above the base."""
    ball = '<collision><origin xyz="0 0 0.4"/><geometry><sphere radius="0.05"/></geometry></collision>'
    stick = '<collision><origin xyz="0.3 0 0"/><geometry><box size="0.4 0.1 0.1"/></geometry></collision>'
    text = small.path("urdf").read_text()
    begin = text.index('<link name="boom">')
    text = text[:begin] + '<link name="boom"/>' + text[text.index("\n", begin) :]
    text = text.replace('<link name="base"/>', f'<link name="base">{ball}</link>')
    text = text.replace('<link name="stick"/>', f'<link name="stick">{stick}</link>')
    small.path("urdf").write_text(text)
    assert small.faults() == ()
    line = small.edit(SRDF, '<joint name="elbow" value="1"/>', '<joint name="elbow" value="-2"/>') - 3
    (fault,) = small.faults()
    assert fault.location.line == line, "lift and elbow together turn the stick up by 1.5 rad, into the ball"
    for words in ("state 'home' of group 'arm' is in collision", "'base'", "'stick'"):
        assert words in fault.message
    small.path("urdf").write_text(text.replace('"0.3 0 0"', '"0.2 0 0"'))
    small.edit(SRDF, 'value="-2"', 'value="1"')
    (fault,) = small.faults()
    assert "state 'home'" in fault.message and "'turret'" in fault.message and "'stick'" in fault.message
    srdf = small.path(SRDF).read_text()
    small.path(SRDF).write_text(re.sub("<group_state .*?</group_state>", "", srdf, flags=re.DOTALL))
    (fault,) = small.faults()
    assert fault.location.line == 2
    for words in ("there is no named state", "the default state is in collision", "'turret'", "'stick'"):
        assert words in fault.message


def test_the_srdf_is_expanded_with_the_arguments_of_the_setup_assistant(small: SmallPackage) -> None:
    opening = '<robot name="crane" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="tip" default="lost"/>'
    small.edit("config/crane.srdf", '<robot name="crane">', opening)
    small.edit("config/crane.srdf", 'tip_link="palm"', 'tip_link="$(arg tip)"')
    assert any("lost" in fault.message for fault in small.faults())
    small.edit(".setup_assistant", "crane.urdf\n", "crane.urdf\n    xacro_args: tip:=palm\n")
    assert small.faults() == ()
    small.edit(".setup_assistant", "tip:=palm", "side:=$(arg side) tip:=$(arg tool)")
    assert any("lost" in fault.message for fault in small.faults()), "nothing says what the tool is"
    small.edit(LAUNCH, "<launch>", '<launch><arg name="tool" default="palm"/>')
    assert small.faults() == ()


def test_a_xacro_file_that_fails_is_named_with_its_line(small: SmallPackage) -> None:
    folder = small.path("urdf").parent
    text = small.path("urdf").read_text().replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ')
    broken = text.replace('velocity="0.2"/></joint>', 'velocity="${speed}"/></joint>')
    (folder / "crane.urdf.xacro").write_text(broken)
    small.edit(".setup_assistant", "crane.urdf", "crane.urdf.xacro")
    (fault,) = small.faults()
    line = broken[: broken.index("${speed}")].count("\n") + 1
    assert (Path(fault.location.file).name, fault.location.line) == ("crane.urdf.xacro", line)
    assert "xacro fails" in fault.message and "speed" in fault.message


def test_values_that_launch_files_fill_in_are_understood(small: SmallPackage) -> None:
    small.edit(IK, "arm:", "$(arg group):")
    small.edit(OMPL, "arm:", "$(arg unknown):")
    small.edit(LAUNCH, "<launch>", '<launch><arg name="group" default="arm"/>')
    assert small.faults() == ()
    small.edit(LAUNCH, 'default="arm"', 'default="am"')
    assert ["group 'am' is unknown" in fault.message for fault in small.faults()] == [True]


def test_the_page_shows_the_robot_and_needs_no_other_file(small: SmallPackage, tmp_path: Path) -> None:
    small.edit(LIMITS, "pan:\n", "pan:\n    has_position_limits: true\n    min_position: -1.5\n    max_position: 1.5\n")
    small.edit("urdf", '<link name="finger_1"/>', f'<link name="finger_1">{SHAPE}</link>')
    page = tmp_path / "robot.html"
    assert main([str(small.folder), "--html", str(page)]) == 0
    text = page.read_text()
    root = html.document_fromstring(text)
    assert not root.xpath("//@src | //@href | //link | //script")
    assert "@import" not in text
    assert "url(" not in text
    matrix = root.xpath("//table[@class='matrix']")[0]
    assert [cell.text_content() for cell in matrix.xpath(".//thead//div")] == ["turret", "boom", "finger_1"]
    kinds = [[cell.get("class") for cell in row.xpath("td")] for row in matrix.xpath(".//tbody/tr")]
    assert kinds[0] == ["self", "Never", "checked"]
    assert kinds[1] == ["Never", "self", "checked"]
    pan = root.xpath("//tr[td[1]='pan']")[0]
    bars = [item.get("style") for item in pan.xpath(".//div[contains(@class, 'range')]")]
    assert bars == ["left:0.0%;width:100.0%", "left:25.0%;width:50.0%"]
    assert pan.xpath(".//div[@class='mark']/@title") == ["arm home: 0 rad"]
    assert "No fault" in text


def test_the_page_of_a_broken_package_lists_its_faults(small: SmallPackage, tmp_path: Path) -> None:
    small.edit(IK, "arm:", "'<b>arn</b>':")
    page = tmp_path / "robot.html"
    assert main([str(small.folder), "--html", str(page)]) == 1
    assert "&#39;&lt;b&gt;arn&lt;/b&gt;&#39; is unknown" in page.read_text()
    small.edit("urdf", "</robot>", "")
    assert main([str(small.folder), "--html", str(page)]) == 1
    assert "not an XML document" in page.read_text()
    assert main([str(small.folder), "--html", str(tmp_path / "none" / "robot.html")]) == 1


def test_a_link_that_is_missing_in_many_pairs_is_told_once(small: SmallPackage) -> None:
    pairs = "".join(f'<disable_collisions link1="camera" link2="{name}"/>\n' for name in ("base", "turret", "boom"))
    line = small.edit(SRDF, '  <disable_collisions link1="base"', pairs + '  <disable_collisions link1="base"')
    (fault,) = small.faults()
    assert fault.location.line == line
    assert "(and in 2 more pairs): link1 'camera' is unknown" in fault.message
