# SPDX-License-Identifier: BSD-3-Clause
"""Input of a planner: joints, start, goals, planning scene and robot description."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Mapping

import numpy as np

from mbf_method.grasp_request import RobotState


@dataclass(frozen=True)
class Obstacle:
    """Shape of the planning scene. An object with several shapes is several obstacles of the same name.

    Attributes:
        name: Name of the object.
        kind: `box`, `sphere`, `cylinder`, `cone`, `capsule`, `plane`, `mesh` or `voxels`.
        dimensions: Edge lengths x, y, z of a box; radius of a sphere; radius and height along z of a cylinder, cone or
            capsule, where the height excludes the half spheres [m]; a, b, c, d of the plane a x + b y + c z + d = 0;
            edge length of the voxels; empty for a mesh.
        vertices: Vertices of a mesh, or centres of the voxels, shape (n, 3) [m]; empty for other kinds.
        triangles: Vertex indices of a mesh, shape (m, 3).
        pose: Pose of the shape's centre in the frame of the request, or in the frame of `link`, shape (4, 4) [m].
        link: Link that carries the object; "" for an object of the world.
    """

    name: str
    kind: str
    dimensions: np.ndarray
    vertices: np.ndarray
    triangles: np.ndarray
    pose: np.ndarray
    link: str = ""


@dataclass(frozen=True)
class PathRequest:
    """Input of a planner.

    Attributes:
        frame: Frame of the obstacles: the root link of the robot, or the parent frame of a moving base.
        group: Planning group.
        joint_names: Joints of the group, in the order of all joint vectors.
        lower: Lower position limits, shape (j,) [rad or m].
        upper: Upper position limits, shape (j,) [rad or m].
        max_velocity: Velocity limits, shape (j,) [rad/s or m/s].
        max_acceleration: Acceleration limits, shape (j,) [rad/s^2 or m/s^2].
        start: Start, shape (j,) [rad or m].
        goals: Alternative goals, nearest first, shape (g, j) [rad or m]; all of them are free of collisions.
        robot: Positions of all joints at the start; joints outside the group keep their positions.
        obstacles: Objects of the planning scene.
        allowed_contacts: Pairs of links and objects that may touch, including the pairs of the SRDF.
        padding: Distance at which a link touches an object [m].
        urdf: Robot description; file names of meshes are absolute paths.
        srdf: Semantic description of the robot: groups, named states, end effectors.
        planner: Name of the planner in the experiment; "" for none.
        parameters: Parameters of the planner in the experiment, keyed by name.
        allowed_time_s: Time for the whole plan, from the start of the request in the framework [s]; the process
            has a little less.
        seed: Seed of all random numbers.
    """

    frame: str
    group: str
    joint_names: tuple[str, ...]
    lower: np.ndarray
    upper: np.ndarray
    max_velocity: np.ndarray
    max_acceleration: np.ndarray
    start: np.ndarray
    goals: np.ndarray
    robot: RobotState
    obstacles: tuple[Obstacle, ...]
    allowed_contacts: tuple[tuple[str, str], ...]
    padding: float
    urdf: str
    srdf: str
    planner: str
    parameters: Mapping[str, Any]
    allowed_time_s: float
    seed: int

    @classmethod
    def from_message(cls, message: Mapping[str, Any]) -> PathRequest:
        """Creates the request from the dictionary of a decoded message."""
        robot = message["robot"]
        converted = {
            "joint_names": tuple(message["joint_names"]),
            "robot": RobotState(tuple(robot["joint_names"]), robot["positions"]),
            "obstacles": tuple(Obstacle(**item) for item in message["obstacles"]),
            "allowed_contacts": tuple((first, second) for first, second in message["allowed_contacts"]),
        }
        return cls(**{**message, **converted})
