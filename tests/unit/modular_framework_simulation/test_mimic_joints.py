# SPDX-License-Identifier: BSD-3-Clause
"""Mimic joints keep the relation of their description while their leader moves and something pushes against them."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.engine_choice import ENGINES
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import Drive, Mode, RobotBody
from modular_framework_simulation.robots.robot_description import read_robot

LINK = """<link name="{name}"><inertial><origin xyz="0.1 0 0"/><mass value="0.5"/>
  <inertia ixx="0.002" iyy="0.002" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>
  <origin xyz="0 {y} 0.5"/><axis xyz="0 0 1"/><limit lower="-6" upper="6" effort="{effort}" velocity="{velocity}"/>
  {mimic}</joint>"""
FOLLOWER = '<mimic joint="leader" multiplier="-1.5" offset="0.2"/>'
SECOND = '<mimic joint="follower" multiplier="0.5" offset="-0.3"/>'
EFFORT, VELOCITY = 20.0, 2.5
PUSH = 0.8 * EFFORT
TOLERANCE = 1e-3

COMMANDS: dict[Mode, Callable[[float], tuple[float, float]]] = {  # command and its rate, by time
    Mode.POSITION: lambda time_s: (1.0 - math.cos(2.0 * time_s), 2.0 * math.sin(2.0 * time_s)),
    Mode.VELOCITY: lambda time_s: (2.0 * math.sin(2.0 * time_s), 0.0),
    Mode.EFFORT: lambda time_s: (0.1 * math.cos(6.0 * time_s), 0.0),
}


def robot_urdf(parent_of_second: str) -> str:
    """Three joints about vertical axes: a leader, its follower, and a joint that mimics the follower."""
    links = "".join(LINK.format(name=name) for name in ("a", "b", "c"))
    like = {"effort": EFFORT, "velocity": VELOCITY}
    joints = (
        JOINT.format(name="leader", parent="base", child="a", y=0, mimic="", **like),
        JOINT.format(name="follower", parent="base", child="b", y=1, mimic=FOLLOWER, **like),
        JOINT.format(name="second", parent=parent_of_second, child="c", y=0.3, mimic=SECOND, **like),
    )
    return f'<robot name="mimics"><link name="base"/>{links}{"".join(joints)}</robot>'


@pytest.fixture(params=ENGINES)
def engine(request: pytest.FixtureRequest) -> str:
    """Every engine."""
    name: str = request.param
    return name


@pytest.mark.parametrize("mode", COMMANDS)
@pytest.mark.parametrize("parent_of_second", ["base", "b"])
def test_mimic_joints_keep_their_relation_while_they_move_under_load(
    world: PhysicsWorld, convex_parts: ConvexParts, mode: Mode, parent_of_second: str
) -> None:
    robot = RobotBody(world, read_robot(robot_urdf(parent_of_second), str, convex_parts, False), "m", Pose(), {})
    reached = []
    for step in range(1500):
        time_s = step * world.settings.time_step_s
        command, rate = COMMANDS[mode](time_s)
        readings = robot.read()
        leader, follower, second = (readings[robot.joint_names.index(n)] for n in ("leader", "follower", "second"))
        assert follower.position == pytest.approx(-1.5 * leader.position + 0.2, abs=TOLERANCE)
        assert second.position == pytest.approx(0.5 * (-1.5 * leader.position + 0.2) - 0.3, abs=TOLERANCE)
        robot.drive({"leader": Drive(mode, command, rate, EFFORT)})
        for name, push in (("follower", PUSH), ("second", -PUSH)):
            world.engine.apply_effort(robot.body.number, robot.body.joint_indices[name], push * math.sin(9.0 * time_s))
        world.step()
        reached.append(leader.position)
    assert max(reached) - min(reached) > 0.7
