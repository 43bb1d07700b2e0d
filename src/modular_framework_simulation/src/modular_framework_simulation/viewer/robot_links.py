# SPDX-License-Identifier: BSD-3-Clause
"""Where the links of a robot are, from its description and joint positions."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.poses import Pose
from modular_framework_urdf.mimics import resolved
from modular_framework_urdf.robot import Joint, Robot


class RobotLinks:
    """Forward kinematics of a robot.

    Args:
        robot: Its description.

    Attributes:
        root: Name of the link that no joint carries.

    Raises:
        DescriptionError: The links do not form a tree, or a joint mimics none that moves.
    """

    def __init__(self, robot: Robot) -> None:
        roots = robot.root_links()
        if len(roots) != 1:
            raise DescriptionError("robot_description", f"has {len(roots)} root links", "expected a tree of links")
        self.root = roots[0]
        self._joints = _outwards(self.root, robot.joints)
        names = [joint.name for joint in robot.movable_joints()]
        try:
            self._mimics = resolved({j.name: j.mimic for j in robot.joints if j.mimic is not None}, names)
        except ValueError as error:
            raise DescriptionError("robot_description", str(error), "mend the description") from None
        self._origins = {j.name: Pose.from_xyz_rpy(j.origin.xyz, j.origin.rpy) for j in self._joints}

    def poses(self, positions: Mapping[str, float]) -> dict[str, Pose]:
        """Returns the poses of all links in the frame of the root.

        Args:
            positions: Of joints [rad or m]; one that is missing and mimics none is at 0.
        """
        found = {self.root: Pose()}
        for joint in self._joints:
            pose = found[joint.parent] @ self._origins[joint.name]
            found[joint.child] = pose @ _motion(joint, self._position(joint.name, positions)) if joint.movable else pose
        return found

    def tip(self, joints: Collection[str]) -> str:
        """Returns the link that the last of some joints carries: the one with most joints of the robot before it.

        Without a known joint, that is the root.
        """
        depths, tip, deepest = {self.root: 0}, self.root, 0
        for joint in self._joints:
            depths[joint.child] = depths[joint.parent] + 1
            if joint.name in joints and depths[joint.child] > deepest:
                tip, deepest = joint.child, depths[joint.child]
        return tip

    def carried_by(self, joints: Collection[str]) -> set[str]:
        """Returns the links that some joints move, and joints that mimic them."""
        moved: set[str] = set()
        for joint in self._joints:
            mimic = self._mimics.get(joint.name)
            if joint.parent in moved or joint.name in joints or (mimic is not None and mimic.leader in joints):
                moved.add(joint.child)
        return moved

    def _position(self, name: str, positions: Mapping[str, float]) -> float:
        mimic = self._mimics.get(name)
        if name in positions or mimic is None:
            return positions.get(name, 0.0)
        return mimic.multiplier * positions.get(mimic.leader, 0.0) + mimic.offset


def finite_positions(names: Sequence[str], positions: Sequence[float]) -> dict[str, float]:
    """Returns the positions of a message by joint; numbers that are not finite are left out.

    Raises:
        ValueError: There is not one position for each joint.
    """
    if len(names) != len(positions):
        raise ValueError(f"{len(names)} joints have {len(positions)} positions; expected as many")
    return {name: value for name, value in zip(names, positions, strict=True) if math.isfinite(value)}


def _outwards(root: str, joints: Sequence[Joint]) -> list[Joint]:
    """Returns the joints so that each comes after those that carry it."""
    by_parent: dict[str, list[Joint]] = {}
    for joint in joints:
        by_parent.setdefault(joint.parent, []).append(joint)
    ordered: list[Joint] = []
    links = [root]
    while links:
        below = by_parent.pop(links.pop(), [])
        ordered += below
        links += [joint.child for joint in below]
    return ordered


def _motion(joint: Joint, position: float) -> Pose:
    x, y, z = joint.axis
    length = math.hypot(x, y, z) or 1.0
    if joint.kind == "prismatic":
        return Pose((x / length * position, y / length * position, z / length * position))
    sine = math.sin(position / 2) / length
    return Pose(quaternion=(x * sine, y * sine, z * sine, math.cos(position / 2)))
