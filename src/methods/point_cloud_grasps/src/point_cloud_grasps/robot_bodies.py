# SPDX-License-Identifier: BSD-3-Clause
"""Finds the points that lie on the robot, from the collision shapes of its description and the poses of its links."""

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
    """The collision shapes of a robot as convex bodies; a mesh counts as its convex hull.

    Args:
        urdf: Text of the robot description; empty for no robot.

    Attributes:
        links: Links that have shapes.
        faults: One sentence for each shape that cannot be used, and is not seen as part of the robot.
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
                    body = collision_body(collision).moved(collision.origin.matrix())
                    self._bodies.setdefault(link.name, []).append(body)
                except ShapeError as error:
                    self.faults.append(f"the collision shape of link '{link.name}' {error}")
        self.links = tuple(self._bodies)

    def hide(self, points: Array, poses: Mapping[str, Array], padding: float) -> Mask:
        """Returns which points (n, 3) [m] are on or in a link, or nearer to one than the padding [m].

        Args:
            points: In any frame.
            poses: (4, 4) transforms from the links to that frame; links without one are passed over.
            padding: By how much each face of a shape is moved outwards [m].
        """
        hidden = np.zeros(len(points), dtype=bool)
        for link, pose in poses.items():
            for body in self._bodies.get(link, []):
                placed = body.moved(pose)
                low, high = placed.corners.min(axis=0) - padding, placed.corners.max(axis=0) + padding
                near = np.flatnonzero(~hidden & ((points >= low) & (points <= high)).all(axis=1))
                beyond = points[near] @ placed.planes[:, :3].T + placed.planes[:, 3]
                hidden[near[(beyond <= padding).all(axis=1)]] = True
        return hidden
