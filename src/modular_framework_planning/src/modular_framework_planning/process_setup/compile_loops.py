# SPDX-License-Identifier: BSD-3-Clause
"""Compiles all numba kernels into numba's cache, so that no request and no launch waits for a compilation.

The module calls each kernel with the argument types that the product uses, for a small robot and scene. Cached kernels
are only loaded. Run the module once after the build:
python3 -m modular_framework_planning.process_setup.compile_loops
Two processes then share the compilation. Both compile the kinematics, which the collision kernels inline.
"""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np
from pinocchio import SE3 as Transform

from modular_framework_planning.collision_detection.exact_collision_checker import ExactCollisionChecker
from modular_framework_planning.collision_detection.kernels.compiled_triangles import build_sphere_tree
from modular_framework_planning.constraints import constrained_motion
from modular_framework_planning.geometry.shapes import Box, Mesh, Shape, Sphere
from modular_framework_planning.kinematics import compiled_kinematics
from modular_framework_planning.numba_cache import cache_is_empty, make_saves_exclusive
from modular_framework_planning.octomap.encoding import read_stream, write_binary, write_full
from modular_framework_planning.octomap.octree import Octree
from modular_framework_planning.octomap.voxel_map import VoxelMap, empty_map
from modular_framework_planning.perception.self_filter import RegionCache, bodies_in_scene, self_filter_of
from modular_framework_planning.planners.rrt_connect import rrt_connect
from modular_framework_planning.planning_scene.planning_scene import (
    AttachedObject,
    CollisionObject,
    PlanningScene,
    empty_scene,
)
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.trajectory_processing import compiled_polylines, time_parameterization

COLLISIONS = "collisions"
"""Command-line argument of the second process."""
LINKS = 4  # links of the robot
MOTION_STEP = 0.05  # [rad]
TETRAHEDRON = np.array(
    [
        [0, 0, 0, 0, 1, 0, 1, 0, 0],
        [0, 0, 0, 1, 0, 0, 0, 0, 1],
        [0, 0, 0, 0, 0, 1, 0, 1, 0],
        [1, 0, 0, 0, 1, 0, 0, 0, 1],
    ],
    dtype=float,
)


def compile_all() -> float:
    """Compiles all kernels, or loads them from the cache; returns the duration [s]."""
    start = time.monotonic()
    robot = _robot()
    _compile_motions(robot)
    _compile_collisions(robot)
    return time.monotonic() - start


def compile_in_two_processes() -> float:
    """Compiles all kernels, with the collision kernels in a second process; returns the duration [s].

    Raises:
        subprocess.CalledProcessError: The second process failed; its output contains the reason.
    """
    start = time.monotonic()
    make_saves_exclusive()
    with subprocess.Popen([sys.executable, "-m", f"{__package__}.compile_loops", COLLISIONS]) as collisions:
        try:
            _compile_motions(_robot())
            exit_code = collisions.wait()
        finally:
            collisions.kill()
    if exit_code:
        raise subprocess.CalledProcessError(exit_code, collisions.args)
    compile_all()  # loads all kernels and compiles missing kernels
    return time.monotonic() - start


def _compile_motions(robot: RobotModel) -> None:
    """Compiles the kernels of kinematics, timing and constraints."""
    compiled_kinematics.warm_up()
    compiled_polylines.warm_up()
    time_parameterization.warm_up()
    constrained_motion.warm_up(robot)


def _compile_collisions(robot: RobotModel) -> None:
    """Compiles the kernels that need a scene: octomaps, collision checks and searches."""
    build_sphere_tree(TETRAHEDRON)
    _check_motions(_scene(robot, _voxels()))
    links = bodies_in_scene(empty_scene(robot), robot.default_positions())  # boxes, because meshes need a slow import
    self_filter_of(RegionCache(), links, 1.0, 0.0).hides(np.ones((2, 3)), np.zeros(3))


def _robot() -> RobotModel:
    """Returns a robot with a chain of boxes."""
    links = "".join(
        f'<link name="l{n}"><collision><geometry><box size="0.1 0.1 0.2"/></geometry></collision></link>'
        for n in range(LINKS)
    )
    joints = "".join(
        f'<joint name="j{n}" type="revolute"><parent link="l{n}"/><child link="l{n + 1}"/>'
        '<origin xyz="0 0 0.3"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" velocity="1" effort="1"/>'
        "</joint>"
        for n in range(LINKS - 1)
    )
    pairs = "".join(f'<disable_collisions link1="l{n}" link2="l{n + 1}" reason="Adjacent"/>' for n in range(LINKS - 1))
    return RobotModel(f'<robot name="chain">{links}{joints}</robot>', f'<robot name="chain">{pairs}</robot>')


def _voxels() -> VoxelMap:
    """Returns a map of a point cloud that was written and read in both encodings."""
    point = np.array([[1.5, 0.0, 0.0]])
    seen = empty_map(0.1).with_point_cloud(np.zeros(3), point, point + 0.5, point + 1.0)
    return read_stream(write_binary(read_stream(write_full(seen), seen.resolution, False)), seen.resolution, True)


def _scene(model: RobotModel, voxels: VoxelMap) -> PlanningScene:
    """Returns a scene with one obstacle of each kind, a mesh around the last link, and a held object."""
    corners = np.array([[0.0, 0.0, 0.0], [0.2, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.2]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])

    def body(name: str, shape: Shape, *position: float) -> CollisionObject:
        return CollisionObject(name, Transform(np.eye(3), np.array(position)), ((shape, Transform.Identity()),))

    scene = empty_scene(model).with_octomap(Octree(voxels), Transform.Identity())
    for item in (
        body("box", Box(0.1, 0.1, 0.1), 0.7, 0.0, 0.3),
        body("ball", Sphere(0.05), -0.7, 0.0, 0.3),
        body("mesh", Mesh(corners, faces), 0.0, 0.6, 0.0),
        body("around", Mesh(8.0 * (corners - 0.05), faces), 0.0, 0.0, 10.0),
    ):
        scene = scene.with_object(item)
    return scene.with_attached(
        AttachedObject(
            body("held", Mesh(corners, faces), 0.0, 0.0, 0.2), f"l{LINKS - 1}", frozenset((f"l{LINKS - 1}",))
        )
    )


def _check_motions(scene: PlanningScene) -> None:
    """Runs every kind of collision check and a search in the scene."""
    checker = ExactCollisionChecker(scene)
    checker.is_free(scene.positions)
    checker.path_is_free(np.array([scene.positions, scene.positions + 0.1]), MOTION_STEP)
    checker.contacts(scene.positions)
    checker.collision_costs(np.array([scene.positions]))
    rrt_connect.warm_up(checker, scene.positions)


def main(arguments: list[str]) -> None:
    """Compiles all kernels and prints the duration, or compiles the collision kernels as the second process."""
    if arguments == [COLLISIONS]:
        make_saves_exclusive()
        _compile_collisions(_robot())
    else:
        took_s = compile_in_two_processes() if cache_is_empty() else compile_all()
        print(f"the compiled kernels are ready after {took_s:.1f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
