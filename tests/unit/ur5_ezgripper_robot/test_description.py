# SPDX-License-Identifier: BSD-3-Clause
"""The description of the arm agrees with the manufacturer's table and is complete for every program that loads it."""

import math
import os
import re
from typing import Any

import numpy as np
import pinocchio
import pybullet
import pytest
import rospkg
import yaml
from urdf_parser_py.urdf import URDF
from xacro_rospkg import expand

ARM = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
KNUCKLE = "ezgripper_knuckle_palm_L1_1"
# The manufacturer's Denavit-Hartenberg table of the UR5: a [m], alpha [rad], d [m].
DH = [
    (0, math.pi / 2, 0.089159),
    (-0.425, 0, 0),
    (-0.39225, 0, 0),
    (0, math.pi / 2, 0.10915),
    (0, -math.pi / 2, 0.09465),
    (0, 0, 0.0823),
]


def placement(model: pinocchio.Model, state: np.ndarray, frame: str) -> pinocchio.SE3:
    data = model.createData()
    pinocchio.forwardKinematics(model, data, state)
    pinocchio.updateFramePlacements(model, data)
    return data.oMf[model.getFrameId(frame)].copy()


def flange_by_table(angles: np.ndarray) -> np.ndarray:
    """Pose of the flange in the controller's base frame by the table alone."""
    pose = np.eye(4)
    for angle, (a, alpha, d) in zip(angles, DH, strict=True):
        ca, sa, ct, st = math.cos(alpha), math.sin(alpha), math.cos(angle), math.sin(angle)
        pose = pose @ np.array(
            [[ct, -st * ca, st * sa, a * ct], [st, ct * ca, -ct * sa, a * st], [0, sa, ca, d], [0, 0, 0, 1]]
        )
    return pose


@pytest.mark.parametrize("seed", range(5))
def test_tool0_is_where_the_manufacturers_table_puts_it(model: pinocchio.Model, seed: int) -> None:
    angles = np.random.default_rng(seed).uniform(-math.pi, math.pi, 6)
    # The controller's base is base_link turned by half a turn about z.
    base = pinocchio.SE3(pinocchio.rpy.rpyToMatrix(0, 0, math.pi), np.array([0, 0, 0.86])).homogeneous
    state = np.append(angles, 0.0)
    assert np.allclose(placement(model, state, "base").homogeneous, base, atol=1e-9)
    found = placement(model, state, "tool0").homogeneous
    assert np.allclose(found, base @ flange_by_table(angles), atol=1e-6)


def test_joints_and_links_have_the_documented_names(urdf: str) -> None:
    robot = URDF.from_xml_string(urdf)
    assert robot.name == "ur5_with_ezgripper"
    assert [joint.name for joint in robot.joints if joint.type == "revolute" and joint.mimic is None] == [*ARM, KNUCKLE]
    expected = {
        "world",
        "base_link",
        "base",
        "shoulder_link",
        "upper_arm_link",
        "forearm_link",
        "wrist_1_link",
        "wrist_2_link",
        "wrist_3_link",
        "ee_link",
        "tool0",
        "eg_manipulator",
    }
    links = {link.name for link in robot.links}
    assert expected <= links
    assert all("ezgripper" in name for name in links - expected)


def test_arguments_place_the_base_in_the_world() -> None:
    folder = rospkg.RosPack().get_path("ur5_ezgripper_robot")
    text = expand(
        f"{folder}/urdf/ur5_with_ezgripper.urdf.xacro",
        {"initial_x": "1", "initial_y": "2", "initial_z": "3", "initial_yaw": str(math.pi / 2)},
    )
    base = placement(pinocchio.buildModelFromXML(text, mimic=True), np.zeros(7), "base_link")
    assert np.allclose(base.translation, [1, 2, 3])
    assert np.allclose(base.rotation @ [1, 0, 0], [0, 1, 0])


@pytest.mark.parametrize(("pan", "direction"), [(0.0, [1, 0]), (math.pi / 2, [0, 1])])
def test_pan_turns_the_reach_from_x_to_y(model: pinocchio.Model, pan: float, direction: list[float]) -> None:
    elbow = placement(model, np.array([pan, 0, 0, 0, 0, 0, 0]), "forearm_link").translation[:2]
    assert elbow @ direction > 0.42


def test_every_driven_joint_has_a_position_transmission(urdf: str) -> None:
    robot = URDF.from_xml_string(urdf)
    interface = "hardware_interface/PositionJointInterface"
    found = {}
    for transmission in robot.transmissions:
        assert transmission.type == "transmission_interface/SimpleTransmission"
        assert transmission.joints[0].hardwareInterfaces == [interface]
        assert re.search(rf'actuator name="{transmission.actuators[0].name}">\s*<hardwareInterface>{interface}<', urdf)
        found[transmission.joints[0].name] = transmission.actuators[0].mechanicalReduction
    assert found == dict.fromkeys([*ARM, KNUCKLE], 1)
    assert "libgazebo_ros_control.so" in urdf


def test_limits_are_the_public_ones(urdf: str) -> None:
    joints = URDF.from_xml_string(urdf).joint_map
    for name in ARM:
        limit = joints[name].limit
        reach = math.pi if name == "elbow_joint" else 2 * math.pi
        assert (limit.lower, limit.upper) == pytest.approx((-reach, reach))
        assert (limit.effort, limit.velocity) == ((28, 3.2) if "wrist" in name else (150, 3.15))
    assert (joints[KNUCKLE].limit.lower, joints[KNUCKLE].limit.upper) == (0, 1.94)


def test_every_link_with_a_shape_has_a_possible_inertia(urdf: str) -> None:
    for link in URDF.from_xml_string(urdf).links:
        if link.name == "world":
            continue
        moments = np.linalg.eigvalsh(np.array(link.inertial.inertia.to_matrix()))
        assert link.inertial.mass > 0
        assert moments.min() > 0
        assert moments[2] < moments[0] + moments[1] + 1e-12, f"{link.name} breaks the triangle inequality"


def test_the_gripper_weighs_about_four_hundred_grams(urdf: str) -> None:
    masses = [link.inertial.mass for link in URDF.from_xml_string(urdf).links if link.name.startswith("ezgripper")]
    assert sum(masses) == pytest.approx(0.4, abs=0.01)


def test_the_centre_of_mass_of_the_straight_arm_is_inside_it(model: pinocchio.Model) -> None:
    straight_up = np.array([0, -math.pi / 2, 0, -math.pi / 2, 0, 0, 0])
    centre = pinocchio.centerOfMass(model, model.createData(), straight_up)
    assert np.linalg.norm(centre[:2] - [0, 0.1]) < 0.05
    assert 1.1 < centre[2] < 1.5


def test_every_mesh_is_found_along_the_package_path(urdf: str) -> None:
    packages = rospkg.RosPack()
    meshes = re.findall(r'filename="package://([^/]+)/([^"]+)"', urdf)
    assert len(meshes) == 14
    for package, path in meshes:
        assert os.path.isfile(os.path.join(packages.get_path(package), path))


def test_rospack_finds_the_meshes_as_rviz_does() -> None:
    assert "example_robot_descriptions" in os.popen("rospack list-names").read().split()


def test_pinocchio_loads_a_collision_shape_for_every_solid_link(urdf_with_paths: str, model: pinocchio.Model) -> None:
    geometry = pinocchio.buildGeomFromUrdfString(model, urdf_with_paths, pinocchio.GeometryType.COLLISION)
    links = {model.frames[shape.parentFrame].name for shape in geometry.geometryObjects}
    assert len(links) == 12


def test_pybullet_loads_the_stated_masses(urdf_with_paths: str, tmp_path: os.PathLike[str]) -> None:
    path = os.path.join(tmp_path, "robot.urdf")
    with open(path, "w", encoding="utf-8") as file:
        file.write(urdf_with_paths)
    client = pybullet.connect(pybullet.DIRECT)
    body = pybullet.loadURDF(path, useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client)
    total = sum(
        pybullet.getDynamicsInfo(body, joint, physicsClientId=client)[0]
        for joint in range(pybullet.getNumJoints(body, physicsClientId=client))
    )
    pybullet.disconnect(client)
    links = URDF.from_xml_string(urdf_with_paths).links
    assert total == pytest.approx(sum(link.inertial.mass for link in links if link.inertial), rel=1e-6)


def controllers_of(name: str) -> Any:
    path = os.path.join(rospkg.RosPack().get_path("ur5_ezgripper_robot"), "controllers", name)
    with open(path, encoding="utf-8") as file:
        return yaml.safe_load(file)


def test_the_arm_has_the_same_controllers_when_the_gripper_has_none() -> None:
    both = controllers_of("ur5_ezgripper_controller_simulation.yaml")
    del both["ezgripper_controller"]
    assert controllers_of("ur5_controller.yaml") == both


def test_the_controller_file_drives_the_joints_that_have_transmissions() -> None:
    controllers = controllers_of("ur5_ezgripper_controller_simulation.yaml")
    types = {name: values["type"] for name, values in controllers.items()}
    assert types == {
        "joint_state_controller": "joint_state_controller/JointStateController",
        "arm_trajectory_controller": "position_controllers/JointTrajectoryController",
        "ezgripper_controller": "position_controllers/GripperActionController",
    }
    arm = controllers["arm_trajectory_controller"]
    assert arm["joints"] == ARM
    assert set(arm["constraints"]) == {"goal_time", "stopped_velocity_tolerance", *ARM}
    assert controllers["ezgripper_controller"]["joint"] == KNUCKLE
