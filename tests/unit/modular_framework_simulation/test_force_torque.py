# SPDX-License-Identifier: BSD-3-Clause
"""Force-torque sensors weigh what hangs on a joint, in the frame of its child link."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from modular_framework_simulation.errors import UnknownEntityError
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.engine_choice import ENGINES
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import Drive, Mode, RobotBody
from modular_framework_simulation.robots.robot_description import read_robot
from modular_framework_simulation.sensors.force_torque import (
    ForceTorqueSensor,
    JointLoad,
    Wrench,
)
from modular_framework_simulation.sensors.sensor_reader import read_robot_sensors
from modular_framework_urdf.rotations import rotate_vector

GRAVITY = 9.81
TOOL_KG, END_KG = 2.0, 0.5
INERTIA = '<inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0" ixz="0" iyz="0"/>'
TRANSMISSION = """<transmission name="t_{joint}"><type>transmission_interface/SimpleTransmission</type>
  <joint name="{joint}"><hardwareInterface>hardware_interface/PositionJointInterface</hardwareInterface></joint>
  <actuator name="a_{joint}"/></transmission>"""
LIMIT = '<limit lower="-3" upper="3" effort="500" velocity="5"/>'
PLUGIN = """<gazebo><plugin name="ft" filename="libgazebo_ros_ft_sensor.so"><updateRate>250</updateRate>
  <topicName>wrist/wrench</topicName><jointName>wrist</jointName></plugin></gazebo>"""


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    """Every engine."""
    return str(request.param)


def urdf(kind: str, plugin: str = PLUGIN) -> str:
    """An arm whose wrist, a joint of a kind, carries a tool and an end with crooked frames and centres of mass."""
    wrist = TRANSMISSION.format(joint="wrist") if kind != "fixed" else ""
    return f"""<robot name="arm"><link name="world"/>
      <link name="upper"><inertial><mass value="1"/>{INERTIA}</inertial></link>
      <joint name="shoulder" type="revolute"><parent link="world"/><child link="upper"/>
        <origin xyz="0 0 1" rpy="0.3 0.2 0.1"/><axis xyz="1 0 0"/>{LIMIT}</joint>
      <link name="tool"><inertial><origin xyz="0.1 0.05 0.2" rpy="0.3 0.1 0.2"/><mass value="{TOOL_KG}"/>{INERTIA}
        </inertial></link>
      <joint name="wrist" type="{kind}"><parent link="upper"/><child link="tool"/>
        <origin xyz="0 0.1 0.2" rpy="0.5 -0.4 1.0"/><axis xyz="0 0.6 0.8"/>{LIMIT}</joint>
      <link name="end"><inertial><origin xyz="0 0 0.1"/><mass value="{END_KG}"/>{INERTIA}</inertial></link>
      <joint name="flange" type="fixed"><parent link="tool"/><child link="end"/>
        <origin xyz="0 0.1 0.3" rpy="0.5 0 1.0"/></joint>
      {TRANSMISSION.format(joint="shoulder")}{wrist}{plugin}</robot>"""


def sensors_of(text: str) -> tuple[list[ForceTorqueSensor], list[str]]:
    """The force-torque sensors of a robot called arm, and what is wrong with others."""
    sensors = read_robot_sensors(text, "arm", str)
    return [each for each in sensors.found if isinstance(each, ForceTorqueSensor)], list(sensors.faults.values())


def settle(world: PhysicsWorld, robot: RobotBody) -> None:
    """Lets the arm come to rest."""
    targets = {"shoulder": 0.4, "wrist": 0.3}
    for _ in range(750):
        robot.read()
        robot.drive({name: Drive(Mode.POSITION, targets[name], 0.0, 500.0) for name in robot.joint_names})
        world.step()


def weighed(world: PhysicsWorld, robot: RobotBody, load: JointLoad) -> Wrench:
    """What the sensor says when the arm has come to rest."""
    load.measure()
    settle(world, robot)
    wrench = load.measure()
    assert wrench is not None
    return wrench


def expected_wrench(world: PhysicsWorld) -> tuple[np.ndarray, np.ndarray]:
    """Force and torque of the weights about the origin of the tool, in its frame."""
    tool, end = (world.entity_state(f"arm::{name}").pose for name in ("tool", "end"))
    force, torque = np.zeros(3), np.zeros(3)
    for centre, mass in ((tool @ Pose((0.1, 0.05, 0.2)), TOOL_KG), (end @ Pose((0.0, 0.0, 0.1)), END_KG)):
        weight = np.array([0.0, 0.0, -mass * GRAVITY])
        force += weight
        torque += np.cross(np.array(centre.position) - tool.position, weight)
    back = tool.inverse().quaternion
    rotated = [rotate_vector(back, (float(x), float(y), float(z))) for x, y, z in (force, torque)]
    return np.array(rotated[0]), np.array(rotated[1])


@pytest.mark.parametrize("kind", ["fixed", "revolute"])
def test_the_weight_on_a_joint_is_measured_within_a_percent(
    make_world: Callable[[], PhysicsWorld], convex_parts: ConvexParts, kind: str
) -> None:
    world = make_world()
    robot = RobotBody(world, read_robot(urdf(kind), str, convex_parts, False), "arm", Pose(), {"shoulder": 0.4})
    sensor = sensors_of(urdf(kind))[0][0]
    load = JointLoad(world, sensor)
    wrench = weighed(world, robot, load)
    force, torque = expected_wrench(world)
    assert np.linalg.norm(wrench.force - force) < 0.01 * np.linalg.norm(force)
    assert np.linalg.norm(wrench.torque - torque) < 0.01 * np.linalg.norm(torque)


def test_a_sensor_that_is_asked_first_in_a_world_at_rest_measures(
    make_world: Callable[[], PhysicsWorld], convex_parts: ConvexParts
) -> None:
    world = make_world()
    robot = RobotBody(world, read_robot(urdf("fixed"), str, convex_parts, False), "arm", Pose(), {"shoulder": 0.4})
    settle(world, robot)
    assert world.rest.holds
    wrench = weighed(world, robot, JointLoad(world, sensors_of(urdf("fixed"))[0][0]))
    force, _ = expected_wrench(world)
    assert np.linalg.norm(wrench.force - force) < 0.01 * np.linalg.norm(force)


def test_a_sensor_measures_again_after_a_restart(
    make_world: Callable[[], PhysicsWorld], convex_parts: ConvexParts
) -> None:
    world = make_world()
    robot = RobotBody(world, read_robot(urdf("revolute"), str, convex_parts, False), "arm", Pose(), {"shoulder": 0.4})
    load = JointLoad(world, sensors_of(urdf("revolute"))[0][0])
    before = weighed(world, robot, load)
    world.restart()
    robot.reload()
    assert weighed(world, robot, load).force == pytest.approx(before.force, rel=0.01)


def test_a_joint_that_is_not_there_is_named(make_world: Callable[[], PhysicsWorld], convex_parts: ConvexParts) -> None:
    world = make_world()
    RobotBody(world, read_robot(urdf("revolute"), str, convex_parts, False), "arm", Pose(), {})
    with pytest.raises(UnknownEntityError, match="arm::elbow"):
        JointLoad(world, replace(sensors_of(urdf("revolute"))[0][0], joint="elbow"))


def test_topic_frame_and_rate_are_those_of_the_plugin() -> None:
    sensors, faults = sensors_of(urdf("revolute"))
    expected = ("arm::ft", "arm::tool", "wrist", "upper", "wrist/wrench", "tool", 250.0)
    found = [(s.name, s.parent, s.joint, s.parent_link, s.topic, s.frame_id, s.rate_hz) for s in sensors]
    assert (found, faults) == ([expected], [])


def test_a_sensor_in_a_slide_is_refused() -> None:
    sensors, faults = sensors_of(urdf("prismatic"))
    assert sensors == []
    assert "got 'wrist'; allowed are fixed and revolute joints: shoulder, flange" in faults[0]


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        (
            "<jointName>wrist",
            "<jointName>elbow",
            "<jointName>: got 'elbow'; allowed are fixed and revolute joints: shoulder, wrist, flange",
        ),
        ("250", "often", "<updateRate>: got 'often'; expected a number"),
        (
            "<updateRate>",
            "<gaussianNoise>-1</gaussianNoise><updateRate>",
            "<gaussianNoise>: got -1; allowed: 0 or more",
        ),
    ],
)
def test_a_sensor_that_cannot_be_is_named_with_the_reason(old: str, new: str, found: str) -> None:
    sensors, faults = sensors_of(urdf("revolute", PLUGIN.replace(old, new)))
    assert sensors == []
    assert len(faults) == 1
    assert found in faults[0]
    assert "robot_description:" in faults[0]
