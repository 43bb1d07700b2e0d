# SPDX-License-Identifier: BSD-3-Clause
"""Finds the points on the robot from its collision shapes and link poses."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from modular_framework_core.grasp_generation.convex_bodies import ConvexBody, ShapeError, collision_body
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]


class RobotBodies:
    """The collision shapes of a robot as convex bodies; meshes are replaced by their convex hulls.

    Args:
        urdf: Robot description; empty for no robot.

    Attributes:
        links: Names of the links with collision shapes.
        faults: Errors of invalid shapes, whose points are not recognised as part of the robot.
    """

    def __init__(self, urdf: str) -> None:
        self._bodies: dict[str, list[ConvexBody]] = {}
        self.faults: list[str] = []
        try:
            links = read_urdf(urdf).links if urdf else ()
        except XmlError as error:
            links = ()
            self.faults.append(str(error))
        for link in links:
            for collision in link.collisions:
                try:
                    body = collision_body(collision).transformed(collision.origin.matrix())
                    self._bodies.setdefault(link.name, []).append(body)
                except ShapeError as error:
                    self.faults.append(f"the collision shape of link '{link.name}' {error}")
        self.links = tuple(self._bodies)

    def hide(self, points: Array, poses: Mapping[str, Array], padding: float) -> Mask:
        """Returns whether each point is in a link or closer to it than the padding.

        Args:
            points: Points in any frame, shape (n, 3) [m].
            poses: Transforms from the links to that frame, shape (4, 4); links without a transform are ignored.
            padding: Outward offset of each face of a shape [m].
        """
        hidden = np.zeros(len(points), dtype=bool)
        for link, pose in poses.items():
            for body in self._bodies.get(link, []):
                placed = body.transformed(pose)
                low, high = placed.corners.min(axis=0) - padding, placed.corners.max(axis=0) + padding
                near = np.flatnonzero(~hidden & ((points >= low) & (points <= high)).all(axis=1))
                beyond = points[near] @ placed.planes[:, :3].T + placed.planes[:, 3]
                hidden[near[(beyond <= padding).all(axis=1)]] = True
        return hidden
