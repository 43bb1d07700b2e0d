# SPDX-License-Identifier: BSD-3-Clause
"""Input of a grasp method: target object, obstacles, gripper, robot state and camera images."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Mapping

import numpy as np


@dataclass(frozen=True)
class SceneObject:
    """Object of the planning scene, in the frame of the request.

    Attributes:
        name: Name of the object.
        points: Points on the surface, shape (n, 3) [m].
        normals: Outward unit normals at the points, shape (n, 3).
        vertices: Vertices of the closed meshes of the object's parts, shape (m, 3) [m]; empty if only the surface is
            known.
        triangles: Vertex indices, counter-clockwise seen from outside, shape (k, 3).
    """

    name: str
    points: np.ndarray
    normals: np.ndarray
    vertices: np.ndarray
    triangles: np.ndarray


@dataclass(frozen=True)
class Gripper:
    """Two-finger hand.

    Attributes:
        max_opening: Maximum free width between the pads [m].
        pad_width: Size of a pad across the closing and approach directions [m].
        pad_height: Size of a pad along the approach direction [m].
        fingertip: Maximum distance from the centre between the pads to the fingertips, along the approach [m].
    """

    max_opening: float
    pad_width: float
    pad_height: float
    fingertip: float


@dataclass(frozen=True)
class RobotState:
    """Joint positions of the robot.

    Attributes:
        joint_names: Names of the joints; empty if the state is unknown.
        positions: Position of each joint, shape (j,) [rad or m].
    """

    joint_names: tuple[str, ...]
    positions: np.ndarray


@dataclass(frozen=True)
class CameraView:
    """Registered depth and colour images of a camera.

    Attributes:
        depth: Depths along the optical axis, shape (h, w) [m]; NaN for pixels without a measurement.
        colour: RGB colours, shape (h, w, 3), uint8.
        intrinsics: Camera matrix, shape (3, 3) [pixel]; the images have no lens distortion.
        pose: Pose of the optical frame (x right, y down, z forward) in the frame of the request, shape (4, 4) [m].
    """

    depth: np.ndarray
    colour: np.ndarray
    intrinsics: np.ndarray
    pose: np.ndarray

    def points(self) -> np.ndarray:
        """Returns the point of each pixel in the frame of the request, shape (h, w, 3) [m]; NaN for unknown depths."""
        rows, columns = np.indices(self.depth.shape)
        pixels = np.stack([columns, rows, np.ones_like(rows)], axis=-1)
        rays = pixels @ np.linalg.inv(self.intrinsics).T
        return (rays * self.depth[..., None]) @ self.pose[:3, :3].T + self.pose[:3, 3]


@dataclass(frozen=True)
class GraspRequest:
    """Input of a grasp method.

    Attributes:
        frame: Frame of all coordinates; z is up.
        target: Object to grasp.
        obstacles: All other objects of the scene.
        support_z: Height of the surface that supports the target [m].
        gripper: Dimensions of the hand.
        robot: Joint positions of the robot.
        seed: Seed of all random numbers.
        camera: Camera images of the scene; None unless the method requires them (`grasp_method(camera=True)`).
    """

    frame: str
    target: SceneObject
    obstacles: tuple[SceneObject, ...]
    support_z: float
    gripper: Gripper
    robot: RobotState
    seed: int
    camera: CameraView | None = None

    @classmethod
    def from_message(cls, message: Mapping[str, Any]) -> GraspRequest:
        """Creates the request from the dictionary of a decoded message."""
        robot, camera = message["robot"], message["camera"]
        return cls(
            frame=message["frame"],
            target=SceneObject(**message["target"]),
            obstacles=tuple(SceneObject(**item) for item in message["obstacles"]),
            support_z=message["support_z"],
            gripper=Gripper(**message["gripper"]),
            robot=RobotState(tuple(robot["joint_names"]), robot["positions"]),
            seed=message["seed"],
            camera=None if camera is None else CameraView(**camera),
        )
