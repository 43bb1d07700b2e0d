# SPDX-License-Identifier: BSD-3-Clause
"""Converts a planning problem to the request of an external planner."""

from __future__ import annotations

import re
from itertools import combinations
from typing import Any

import numpy as np

from mbf_method.grasp_request import RobotState
from mbf_method.path_request import Obstacle, PathRequest
from modular_framework_planning.errors import ModelError
from modular_framework_planning.geometry.shapes import Box, Capsule, Cone, Cylinder, Mesh, Plane, Shape, Sphere
from modular_framework_planning.geometry.spatial import Array, Transform
from modular_framework_planning.octomap.octree import Octree
from modular_framework_planning.planning_interface.planner_interface import PlanningProblem
from modular_framework_planning.planning_scene.planning_scene import PlanningScene
from modular_framework_planning.robot_model.robot_model import RobotModel

MAX_SEED = 2**31
PACKAGE_URI = re.compile(r"package://[^\"'<>]+")


def path_request(problem: PlanningProblem, goals: Array, urdf: str) -> PathRequest:
    """Returns the request for a path.

    Args:
        problem: Planning problem.
        goals: Goal joint vectors, shape (g, joints) [rad or m].
        urdf: Robot description, see `portable_urdf`.
    """
    lower, upper = problem.bounds
    near_lower, near_upper = problem.search_bounds(np.vstack([problem.start_values, goals]))
    endless = problem.model.continuous[problem.group.indices]
    return PathRequest(
        frame=problem.model.planning_frame,
        group=problem.group.name,
        joint_names=problem.group.joints,
        lower=np.where(endless, near_lower, lower),
        upper=np.where(endless, near_upper, upper),
        max_velocity=problem.max_velocity,
        max_acceleration=problem.max_acceleration,
        start=problem.start_values,
        goals=goals,
        robot=RobotState(problem.model.joint_names, problem.start),
        obstacles=tuple(_obstacles(problem.scene)),
        allowed_contacts=tuple(_allowed_contacts(problem.scene)),
        padding=float(problem.scene.link_margins().max(initial=0.0)),
        urdf=urdf,
        srdf=problem.model.source[1],
        planner=problem.planner_id,
        parameters=dict(problem.planner_parameters),
        allowed_time_s=problem.deadline_s - problem.start_time_s,
        seed=int(problem.rng.integers(MAX_SEED)),
    )


def portable_urdf(model: RobotModel) -> str:
    """Returns the URDF of a robot with absolute paths in place of package URIs, except URIs of missing files."""
    urdf, _, _, resolve = model.source

    def file_name(match: re.Match[str]) -> str:
        try:
            return resolve(match[0])
        except ModelError:
            return match[0]

    return PACKAGE_URI.sub(file_name, urdf)


def _obstacles(scene: PlanningScene) -> list[Obstacle]:
    bodies = [(item, "") for item in scene.obstacles()]
    bodies += [(item.body, item.link) for item in scene.attached.values()]
    return [_obstacle(body.name, shape, body.pose * pose, link) for body, link in bodies for shape, pose in body.shapes]


def _obstacle(name: str, shape: Shape, pose: Transform, link: str) -> Obstacle:
    vertices, triangles = np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64)
    dimensions: tuple[float, ...]
    match shape:
        case Box():
            kind, dimensions = "box", (shape.x, shape.y, shape.z)
        case Sphere():
            kind, dimensions = "sphere", (shape.radius,)
        case Cylinder() | Capsule() | Cone():
            kind, dimensions = type(shape).__name__.lower(), (shape.radius, shape.height)
        case Plane():
            kind, dimensions = "plane", (shape.a, shape.b, shape.c, shape.d)
        case Mesh():
            kind, dimensions = "mesh", ()
            vertices, triangles = np.asarray(shape.vertices), np.asarray(shape.triangles)
        case Octree():
            kind, dimensions, vertices = "voxels", (shape.resolution,), shape.centers
        case _:
            raise ModelError(f"object '{name}': a {type(shape).__name__} cannot be sent to an external planner")
    return Obstacle(name, kind, np.array(dimensions, dtype=float), vertices, triangles, _matrix(pose), link)


def _matrix(pose: Any) -> Array:
    return np.array(pose.homogeneous)


def _allowed_contacts(scene: PlanningScene) -> list[tuple[str, str]]:
    """Returns the pairs of bodies that may touch, without pairs of world objects."""
    joints = {item.link: item.joint_id for item in scene.model.link_geometries}
    world = {item.name for item in scene.obstacles()}

    def may_touch(first: str, second: str) -> bool:
        held = scene.attached.get(second)
        return (
            (first in joints and joints[first] == joints.get(second))
            or (held is not None and first in (held.link, *held.touch_links))
            or scene.acm.allows(first, second)
        )

    return [
        (first, second)
        for first, second in combinations([*joints, *scene.attached, *sorted(world)], 2)
        if not {first, second} <= world and may_touch(first, second)
    ]
