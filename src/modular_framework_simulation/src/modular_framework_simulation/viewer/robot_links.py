# SPDX-License-Identifier: BSD-3-Clause
"""Computes the poses of a robot's links from its description and joint positions."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence

from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.poses import Pose, joint_motion
from modular_framework_urdf.mimics import resolve_mimics
from modular_framework_urdf.robot import Joint, Robot


class RobotLinks:
    """Forward kinematics of a robot.

    Args:
        robot: Description of the robot.

    Attributes:
        root: Name of the root link.

    Raises:
        DescriptionError: The links do not form a tree, or a mimic joint has no movable leading joint.
    """

    def __init__(self, robot: Robot) -> None:
        roots = robot.root_links()
        if len(roots) != 1:
            raise DescriptionError("robot_description", f"has {len(roots)} root links", "expected a tree of links")
        self.root = roots[0]
        self._joints = _sorted_from_root(self.root, robot.joints)
        names = [joint.name for joint in robot.movable_joints()]
        try:
            self._mimics = resolve_mimics({j.name: j.mimic for j in robot.joints if j.mimic is not None}, names)
        except ValueError as error:
            raise DescriptionError("robot_description", str(error), "correct the description") from None
        self._origins = {j.name: Pose.from_xyz_rpy(j.origin.xyz, j.origin.rpy) for j in self._joints}

    def poses(self, positions: Mapping[str, float]) -> dict[str, Pose]:
        """Returns the poses of all links in the frame of the root link.

        Args:
            positions: Positions by joint name [rad or m]; the default is 0, or the mimic relation.
        """
        poses = {self.root: Pose()}
        for joint in self._joints:
            pose = poses[joint.parent] @ self._origins[joint.name]
            if joint.is_movable:
                position = self._position(joint.name, positions)
                pose = pose @ joint_motion(joint.axis, position, is_prismatic=joint.kind == "prismatic")
            poses[joint.child] = pose
        return poses

    def tip(self, joints: Collection[str]) -> str:
        """Returns the child link of the joint that is farthest from the root, measured in joints.

        Args:
            joints: Names of the considered joints; without a known joint, the result is the root link.
        """
        depths, tip, max_depth = {self.root: 0}, self.root, 0
        for joint in self._joints:
            depths[joint.child] = depths[joint.parent] + 1
            if joint.name in joints and depths[joint.child] > max_depth:
                tip, max_depth = joint.child, depths[joint.child]
        return tip

    def carried_by(self, joints: Collection[str]) -> set[str]:
        """Returns the links that move with some joints or with the joints that mimic them."""
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
    """Returns the finite positions of a message, by joint name.

    Raises:
        ValueError: The numbers of joints and positions differ.
    """
    if len(names) != len(positions):
        raise ValueError(f"{len(names)} joints have {len(positions)} positions; expected one position per joint")
    return {name: value for name, value in zip(names, positions, strict=True) if math.isfinite(value)}


def _sorted_from_root(root: str, joints: Sequence[Joint]) -> list[Joint]:
    """Returns the joints in an order in which parent joints precede child joints."""
    by_parent: dict[str, list[Joint]] = {}
    for joint in joints:
        by_parent.setdefault(joint.parent, []).append(joint)
    ordered: list[Joint] = []
    links = [root]
    while links:
        children = by_parent.pop(links.pop(), [])
        ordered += children
        links += [joint.child for joint in children]
    return ordered
