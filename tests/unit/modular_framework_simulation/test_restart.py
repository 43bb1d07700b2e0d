# SPDX-License-Identifier: BSD-3-Clause
"""A world that begins again moves as it did the first time, bit for bit, whatever happened in between."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from modular_framework_simulation.loop.snapshots import take_snapshot
from modular_framework_simulation.loop.world_digest import WorldDigest
from modular_framework_simulation.models import sdf_specs as specs
from modular_framework_simulation.models.mesh_files import ConvexParts
from modular_framework_simulation.models.poses import Pose
from modular_framework_simulation.physics.physics_world import PhysicsWorld
from modular_framework_simulation.physics.robot_body import Drive, Mode, RobotBody
from modular_framework_simulation.robots.robot_description import read_robot
from modular_framework_testing.simulation.simulated_samples import exact_state, lift_robot_urdf, solid

CUBE = solid("cube", specs.Box((0.05, 0.05, 0.05)), Pose((0.0, 0.0, 0.2)))
BALL = solid("ball", specs.Sphere(0.03), Pose((0.01, 0.005, 0.4)))


@pytest.fixture
def robot(make_world: Callable[[], PhysicsWorld], convex_parts: ConvexParts) -> RobotBody:
    """A robot above a cube."""
    world = make_world()
    world.restart()
    world.spawn(solid("ground", specs.Plane((0, 0, 1), (10, 10)), Pose(), static=True), keep=True)
    world.spawn(CUBE, keep=True)
    description = read_robot(lift_robot_urdf(), lambda name: name, convex_parts, False)
    return RobotBody(world, description, "lifter", Pose(), {"lift": 0.1})


def fall(robot: RobotBody, steps: int, target: float = -0.2) -> str:
    """Drops a ball on the cube beside the moving robot; returns the hash of all steps."""
    world, digest = robot.world, WorldDigest(robot.world, robot)
    world.spawn(BALL)
    for _ in range(steps):
        robot.drive({"lift": Drive(Mode.POSITION, target, 0.0, 100.0)})
        world.step()
        digest.add()
    return digest.current_checkpoint().digest


def begin_again(robot: RobotBody) -> None:
    robot.world.restart()
    robot.reload()


def test_every_restart_gives_the_same_motion_bit_for_bit(robot: RobotBody) -> None:
    begin_again(robot)
    first = fall(robot, 300)
    state = exact_state(robot.world)
    for steps, target in ((17, 0.3), (250, -0.25)):
        begin_again(robot)
        fall(robot, steps, target)
        begin_again(robot)
        assert fall(robot, 300) == first
        assert exact_state(robot.world) == state


def test_the_hash_tells_motions_apart(robot: RobotBody) -> None:
    begin_again(robot)
    first = fall(robot, 100)
    begin_again(robot)
    assert fall(robot, 100, 0.3) != first


def test_a_restart_takes_spawned_models_out_and_time_to_zero(robot: RobotBody) -> None:
    fall(robot, 20)
    begin_again(robot)
    assert robot.world.names() == ["ground", "cube", "lifter"]
    assert robot.world.time_ns == 0


def test_a_model_after_a_restart_is_another_one_than_that_of_its_name_before(robot: RobotBody) -> None:
    before = {item.name: item.instance for item in take_snapshot(robot.world, ()).models}
    begin_again(robot)
    after = {item.name: item.instance for item in take_snapshot(robot.world, ()).models}
    assert before.keys() == after.keys()
    assert not set(before.values()) & set(after.values())
