# SPDX-License-Identifier: BSD-3-Clause
"""The UR5 with EZGripper lifts objects of the description package and keeps hold of them, by friction alone."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest
import rospkg
from xacro_rospkg import expand

from modular_framework_control.hardware_interface.interfaces import PositionJointInterface
from modular_framework_ros.node_handle import MappingNodeHandle
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.models.sdf_reader import read_model_text
from modular_framework_simulation.models.sdf_resources import Resources
from modular_framework_simulation.physics.physics_settings import PhysicsSettings
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import RobotBody
from modular_framework_simulation.physics.simulated_robot_hw import SimulatedRobotHW
from modular_framework_simulation.robots.robot_description import read_robot
from modular_framework_testing.simulation.simulated_samples import solid

ARM = [f"{name}_joint" for name in ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")]
START = dict(zip(ARM, (1.57, -1.57, 1.57, -1.57, -1.57, 0.0), strict=True))
GRIPPER = "ezgripper_knuckle_palm_L1_1"
GRASP_FRAME = "eg_manipulator"
TABLE_HEIGHT = 0.84
CLOSED = 1.94


class PickTrial:
    """A table, an object on it, and the robot above; joint commands are written straight to the hardware handles."""

    def __init__(self, parts: ConvexParts, model: str, height: float, pose_xy_yaw: tuple[float, float, float]) -> None:
        packages = rospkg.RosPack()
        self.world = PhysicsWorld(PhysicsSettings(), parts, (0.0, 0.0, -9.81))
        table = specs.Box((1.2, 0.9, 0.04))
        self.world.spawn(solid("table", table, Pose((0.0, 0.6, TABLE_HEIGHT - 0.02)), static=True))
        urdf = Path(packages.get_path("ur5_ezgripper_robot")) / "urdf" / "ur5_with_ezgripper.urdf.xacro"
        description = read_robot(expand(urdf, {}), packages.get_path, parts, False)
        self.robot = RobotBody(self.world, description, "robot", Pose(), START)
        self.hardware = SimulatedRobotHW(self.robot)
        assert self.hardware.init(MappingNodeHandle(), MappingNodeHandle())
        self.handles = {each.name: each for each in self.hardware.get(PositionJointInterface).handles}
        folder = Path(packages.get_path("modular_framework_description")) / "models"
        file = folder / model / "model.sdf"
        spec = read_model_text(file.read_text(), str(file), Resources((folder,), packages.get_path))
        x, y, yaw = pose_xy_yaw
        at = Pose.from_xyz_rpy((x, y, TABLE_HEIGHT + height / 2 + 0.0005), (0.0, 0.0, yaw))
        self.thing = self.world.spawn(dataclasses.replace(spec, name="thing", pose=at))
        self.largest_error = 0.0

    def run(self, seconds: float, goal: dict[str, float]) -> None:
        """Moves the named joints to their goals along a smooth curve, and waits there until the time is over."""
        step_s = self.world.settings.time_step_s
        start = {name: self.handles[name].command for name in goal}
        count = round(seconds / step_s)
        for number in range(1, count + 1):
            share = min(1.0, 1.25 * number / count)
            blend = share**3 * (10 - 15 * share + 6 * share**2)
            self.hardware.read(0.0, step_s)
            for name, value in goal.items():
                self.handles[name].command = start[name] + blend * (value - start[name])
            self.hardware.write(0.0, step_s)
            self.world.step()
            positions = dict(zip(self.robot.joint_names, self.robot.read(), strict=True))
            errors = (abs(positions[name].position - self.handles[name].command) for name in ARM)
            self.largest_error = max(self.largest_error, *errors)

    def hand(self) -> Pose:
        return self.robot.body.link_state(GRASP_FRAME).pose

    def arm_goal(self, pose: Pose) -> dict[str, float]:
        """Inverse kinematics by the physics engine, on the robot itself; its joints are put back afterwards."""
        engine, body = self.world.engine, self.robot.body
        saved = dict(zip(self.robot.joint_names, self.robot.read(), strict=True))
        movable = [info[1].decode() for info in engine.joint_infos(body.number) if info[3] > -1]
        goal = dict(START)
        for _ in range(50):
            solution = engine.api.calculateInverseKinematics(
                body.number,
                body.link_indices[GRASP_FRAME],
                pose.position,
                pose.quaternion,
                maxNumIterations=200,
                residualThreshold=1e-8,
                physicsClientId=engine.client,
            )
            goal = {name: value for name, value in zip(movable, solution, strict=True) if name in ARM}
            body.reset_joints({name: reading.position for name, reading in saved.items()} | goal)
            if self.hand().distance_to(pose)[0] < 5e-4:
                break
        body.reset_joints({name: reading.position for name, reading in saved.items()})
        return goal


@pytest.mark.parametrize(
    ("model", "height", "grasp_offset", "place"),
    [
        ("wood_block", 0.10, (0.0, 0.0), (0.05, 0.50, 0.3)),
        ("can", 0.115, (0.0, 0.0), (-0.15, 0.45, 0.0)),
        ("ball", 0.064, (0.0, 0.0), (0.20, 0.55, 1.0)),
        ("l_bracket", 0.08, (-0.03, 0.01), (-0.05, 0.60, -0.7)),
    ],
)
def test_an_object_is_lifted_and_still_held_two_seconds_later(
    convex_parts: ConvexParts,
    model: str,
    height: float,
    grasp_offset: tuple[float, float],
    place: tuple[float, float, float],
) -> None:
    trial = PickTrial(convex_parts, model, height, place)
    x, y, yaw = place
    along, up = grasp_offset
    centre = (x + along * math.cos(yaw), y + along * math.sin(yaw), TABLE_HEIGHT + max(height / 2 + up, 0.03))

    def above(distance: float) -> Pose:
        # Half a centimetre beside the middle, as a grasp planner's error would be.
        position = (centre[0] + 0.003, centre[1] - 0.004, centre[2] + distance)
        return Pose.from_xyz_rpy(position, (math.pi, 0.0, yaw))

    trial.run(2.0, trial.arm_goal(above(0.12)))
    trial.run(1.5, trial.arm_goal(above(0.0)))
    trial.run(1.2, {GRIPPER: CLOSED})
    start = trial.thing.state().pose.position[2]
    trial.run(1.5, trial.arm_goal(above(0.15)))
    in_hand = trial.hand().inverse() @ trial.thing.state().pose
    trial.run(2.0, {})
    slip, turn = in_hand.distance_to(trial.hand().inverse() @ trial.thing.state().pose)
    assert trial.thing.state().pose.position[2] - start > 0.14
    assert slip < 0.002
    assert turn < 0.05
    assert trial.largest_error < 0.01
    trial.world.close()
