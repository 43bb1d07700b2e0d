# SPDX-License-Identifier: BSD-3-Clause
"""Every shipped robot is described completely: its packages agree with each other, and a task can start with it."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio
import pytest
import roslaunch.xmlloader
import rospkg
import yaml
from roslaunch.config import load_config_default
from xacro_rospkg import expand

from modular_framework_core.commander.robot_groups import read_group
from modular_framework_core.grasp_generation.gripper_geometry import measure_gripper

ROBOTS = ("panda_hand_robot", "iiwa_wsg50_robot", "dual_panda_robot")
POSES = ("initial_pose", "stability_pose")


def load(path: Path) -> Any:
    return yaml.safe_load(path.read_text())


@dataclass(frozen=True)
class Robot:
    """A robot's packages and what is in them."""

    folder: Path
    moveit: Path
    arguments: dict[str, str]
    urdf: str
    srdf: str
    controllers: dict[str, Any]
    parameters: dict[str, Any]


@pytest.fixture(scope="module", params=ROBOTS)
def robot(request: pytest.FixtureRequest) -> Robot:
    packages = rospkg.RosPack()
    folder = Path(packages.get_path(request.param))
    loader = roslaunch.xmlloader.XmlLoader(resolve_anon=False, args_only=True)
    load_config_default([str(folder / "launch/start_framework.launch")], None, loader=loader, verbose=False)
    arguments = {name: str(value) for name, value in loader.root_context.resolve_dict["arg"].items()}
    moveit = Path(packages.get_path(arguments["moveit_config_package"]))
    urdf_args = dict(pair.split(":=") for pair in arguments["urdf_args"].split())
    parameters: dict[str, Any] = {}
    for name in ("motion_planner_config", "manipulator_controller_parameters", "generative_methods_config"):
        parameters |= load(folder / "config" / f"{name}.yaml")
    (srdf,) = (moveit / "config").glob("*.srdf")
    return Robot(
        folder,
        moveit,
        arguments,
        expand(str(folder / "urdf" / arguments["robot_urdf_file"]), urdf_args),
        srdf.read_text(),
        load(folder / "controllers" / arguments["controller_file"]),
        parameters,
    )


def test_every_mesh_is_found_along_the_package_path(robot: Robot) -> None:
    packages = rospkg.RosPack()
    meshes = re.findall(r'filename="package://([^/]+)/([^"]+)"', robot.urdf)
    assert len(meshes) > 16
    assert not [path for package, path in meshes if not Path(packages.get_path(package), path).is_file()]


def test_every_solid_link_has_a_possible_inertia(robot: Robot) -> None:
    model = pinocchio.buildModelFromXML(robot.urdf)
    for name, inertia in zip(model.names[1:], model.inertias[1:], strict=True):
        moments = np.linalg.eigvalsh(inertia.inertia)
        assert inertia.mass > 0.0 and moments[0] > 0.0, name
        assert moments[2] < moments[0] + moments[1] + 1e-9, f"{name} breaks the triangle inequality"


def test_controllers_of_robot_and_planner_have_the_same_joints_which_have_transmissions(robot: Robot) -> None:
    listed = {
        entry["name"]: entry["joints"] for entry in load(robot.moveit / "config/controllers.yaml")["controller_list"]
    }
    loaded = {
        name: values.get("joints", [values.get("joint")])
        for name, values in robot.controllers.items()
        if name != "joint_state_controller"
    }
    assert listed == loaded
    driven = {joint.get("name") for joint in ElementTree.fromstring(robot.urdf).findall("transmission/joint")}
    assert {name for joints in listed.values() for name in joints} == driven


def test_limits_of_planning_are_within_those_of_the_description(robot: Robot) -> None:
    joints = {joint.get("name"): joint for joint in ElementTree.fromstring(robot.urdf).findall("joint")}
    limits = load(robot.moveit / "config/joint_limits.yaml")["joint_limits"]
    assert set(limits) == {name for values in robot.controllers.values() for name in _joints(values)}
    for name, limit in limits.items():
        assert 0.0 < limit["max_velocity"] <= float(joints[name].find("limit").get("velocity"))
        assert limit["max_acceleration"] > 0.0


def _joints(controller: dict[str, Any]) -> list[str]:
    return list(controller.get("joints", [controller["joint"]] if "joint" in controller else []))


def test_every_name_of_the_srdf_is_one_of_the_robot(robot: Robot) -> None:
    urdf, srdf = ElementTree.fromstring(robot.urdf), ElementTree.fromstring(robot.srdf)
    links, joints = ({item.get("name") for item in urdf.findall(tag)} for tag in ("link", "joint"))
    assert srdf.get("name") == urdf.get("name")
    for element in srdf.iter("disable_collisions"):
        assert {element.get("link1"), element.get("link2")} <= links
    for element in srdf.iter("chain"):
        assert {element.get("base_link"), element.get("tip_link")} <= links
    for tag in ("group/joint", "group_state/joint", "passive_joint"):
        assert {element.get("name") for element in srdf.findall(tag)} <= joints


def test_named_joint_states_are_within_limits_and_point_the_hand_down(robot: Robot) -> None:
    model = pinocchio.buildModelFromXML(robot.urdf, mimic=True)
    data = model.createData()
    states = load(robot.folder / "config/named_joint_states.yaml")
    group = read_group(robot.urdf, robot.srdf, robot.parameters["arm_group_name"])
    for name, state in states.items():
        assert list(state) == [joint.name for joint in group.joints], name
        assert not [joint.name for joint in group.joints if not joint.lower <= state[joint.name] <= joint.upper], name
    for name in POSES:
        configuration = pinocchio.neutral(model)
        for joint, value in states[name].items():
            configuration[model.idx_qs[model.getJointId(joint)]] = value
        pinocchio.framesForwardKinematics(model, data, configuration)
        tip = data.oMf[model.getFrameId(group.tip_link)]
        assert tip.rotation[2, 2] == pytest.approx(-1.0, abs=1e-6) and tip.translation[2] > 1.0


def test_grasps_come_from_the_gripper_of_the_description(robot: Robot) -> None:
    joint = robot.parameters["top_down_grasp_generator"]["gripper_joint"]
    tip = read_group(robot.urdf, robot.srdf, robot.parameters["arm_group_name"]).tip_link
    gripper = measure_gripper(robot.urdf, tip, joint)
    states = read_group(robot.urdf, robot.srdf, robot.parameters["manipulator_group_name"]).states
    assert gripper.closed_position == pytest.approx(states["closed"][joint], abs=1e-6)
    assert gripper.position_for(gripper.max_opening) == pytest.approx(states["open"][joint], abs=1e-6)
    assert gripper.max_opening == pytest.approx(2.0 * states["open"][joint], abs=1e-3)
    assert gripper.axes[:, 2] == pytest.approx([0.0, 0.0, 1.0])
    assert len({part.link for part in gripper.parts if part.is_pad}) == 2


def test_the_links_of_the_manipulator_are_those_that_its_text_names(robot: Robot) -> None:
    links = {item.get("name") or "" for item in ElementTree.fromstring(robot.urdf).findall("link")}
    texts = robot.arguments["manipulator_prefix"].split()
    named = {link for link in links if any(text in link for text in texts)}
    joint = robot.parameters["top_down_grasp_generator"]["gripper_joint"]
    tip = read_group(robot.urdf, robot.srdf, robot.parameters["arm_group_name"]).tip_link
    gripper = measure_gripper(robot.urdf, tip, joint)
    assert {part.link for part in gripper.parts if part.is_pad} <= named
    assert tip in named and not any(re.search(r"link_?[0-7]$", link) for link in named)
