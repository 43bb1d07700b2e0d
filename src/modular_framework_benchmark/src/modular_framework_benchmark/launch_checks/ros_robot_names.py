# SPDX-License-Identifier: BSD-3-Clause
"""Names in a robot description to which parameters, controllers and files of an experiment refer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from modular_framework_planning.robot_model.multi_dof_joint import FLOATING, PLANAR, MultiDofJoint
from modular_framework_ros.allowed_names import listing, nearest
from modular_framework_simulation.errors import DescriptionError
from modular_framework_simulation.models.urdf_extensions import misspelt_extensions
from modular_framework_simulation.models.xml_nodes import parse_xml
from modular_framework_urdf.robot import Robot
from modular_framework_urdf.srdf_reader import read_srdf
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError


@dataclass(frozen=True, slots=True)
class RobotNames:
    """Names in a robot description; empty if the description is missing or invalid.

    Attributes:
        groups: Planning groups.
        joints: All joints.
        movable_joints: Movable joints, and the variables of planar or floating virtual joints.
        links: All links.
        fault: Error of an invalid URDF; empty for a valid one.
        robot: Name of the robot in its URDF.
        misspelt: Misspelt elements and references of the `<gazebo>` elements of the URDF.
    """

    groups: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    movable_joints: tuple[str, ...] = ()
    links: tuple[str, ...] = ()
    fault: str = ""
    robot: str = ""
    misspelt: tuple[str, ...] = ()

    @property
    def joint_prefixes(self) -> tuple[str, ...]:
        """Returns the parts of joint names in front of an underscore."""
        ends = ((joint, end) for joint in self.joints for end, letter in enumerate(joint) if letter == "_")
        return tuple(sorted({joint[:end] for joint, end in ends if end}))

    def by_kind(self) -> dict[str, tuple[str, ...]]:
        """Returns the known names, keyed by the kinds in parameter declarations."""
        kinds = {"group": self.groups, "joint": self.movable_joints, "link": self.links}
        return {kind: names for kind, names in kinds.items() if names}


@lru_cache(maxsize=16)
def robot_names(urdf: str, srdf: str) -> RobotNames:
    """Returns the names in a URDF and an SRDF; both may be empty."""
    groups: tuple[str, ...] = ()
    variables: tuple[str, ...] = ()
    try:
        if srdf:
            semantics = read_srdf(srdf, "robot_description_semantic")
            groups = tuple(semantics.groups)
            for joint in semantics.virtual_joints:
                if joint.kind in (PLANAR, FLOATING):
                    multi_dof = MultiDofJoint(joint.name, joint.kind, joint.parent_frame, joint.child_link)
                    variables += (*multi_dof.variables, *joint.variables)
    except XmlError:
        pass  # reported by the check of the task
    try:
        robot = read_urdf(urdf) if urdf else None
    except XmlError as error:
        return RobotNames(groups, fault=str(error))
    if robot is None:
        return RobotNames(groups)
    if fault := _tree_fault(robot):
        return RobotNames(groups, fault=fault)
    movable = tuple(joint.name for joint in robot.joints if joint.kind != "fixed")
    links = tuple(link.name for link in robot.links)
    joints = tuple(joint.name for joint in robot.joints)
    return RobotNames(groups, joints, (*movable, *variables), links, robot=robot.name, misspelt=_misspelt(urdf))


def _misspelt(urdf: str) -> tuple[str, ...]:
    """Returns the misspelt parts of the `<gazebo>` elements of a URDF."""
    try:
        return tuple(misspelt_extensions(parse_xml(urdf, "robot_description")))
    except DescriptionError:
        return ()  # the simulation reports the reason


def _tree_fault(robot: Robot) -> str:
    """Returns the first fault in the tree of links that the simulation and planning would refuse, or ""."""
    links = [link.name for link in robot.links]
    for joint in robot.joints:
        where = f"robot_description:{joint.line}: joint '{joint.name}'"
        for role, link in (("parent", joint.parent), ("child", joint.child)):
            if link not in links:
                hint = f"{listing(links)}{nearest(link, links)}"
                return f"{where} has the {role} link '{link}', which does not exist; {hint}"
        if joint.is_movable and not any(joint.axis):
            return f"{where} has the axis 0 0 0; give it a direction, such as 0 0 1"
    roots = robot.root_links()
    if len(roots) != 1:
        names = ", ".join(roots) or "none"
        return f"{len(roots)} links have no parent joint ({names}); allowed: a URDF with one root link"
    return ""
