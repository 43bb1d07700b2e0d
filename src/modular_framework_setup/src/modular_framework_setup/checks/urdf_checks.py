# SPDX-License-Identifier: BSD-3-Clause
"""Checks the tree, limits, mimic joints, transmissions and mesh files of a URDF."""

from __future__ import annotations

import re
from collections import Counter

from modular_framework_core.files.faults import FaultList
from modular_framework_setup.config_files.config_package import find_package
from modular_framework_setup.config_files.description_files import XmlDocument, add_xml_error
from modular_framework_setup.config_files.robot_tree import RobotTree
from modular_framework_urdf.mesh_paths import mesh_path
from modular_framework_urdf.mesh_reader import MeshError
from modular_framework_urdf.robot import MOVABLE_KINDS, Joint, MeshFile, Robot
from modular_framework_urdf.urdf_reader import read_urdf
from modular_framework_urdf.xml_text import XmlError

KINDS = (*MOVABLE_KINDS, "fixed", "floating", "planar")
_PACKAGE = re.compile(r"package://([^/]+)/")


def check_urdf(document: XmlDocument, faults: FaultList) -> RobotTree | None:
    """Checks a URDF and returns its kinematic tree, or None if unreadable."""
    try:
        robot = read_urdf(document.text, document.where)
    except XmlError as error:
        add_xml_error(error, faults)
        return None
    tree = RobotTree(robot, document.where)
    check_tree(tree, faults)
    _check_meshes(robot, tree, faults)
    return tree


def check_tree(tree: RobotTree, faults: FaultList) -> None:
    """Checks the links, joints and transmissions of a URDF, but not its meshes."""
    robot = tree.robot
    _check_names(robot, tree, faults)
    _check_roots(tree, faults)
    for joint in robot.joints:
        _check_ends(joint, tree, faults)
        _check_axis(joint, tree, faults)
        _check_limit(joint, tree, faults)
        _check_mimic(joint, tree, faults)
    _check_transmissions(robot, tree, faults)


def _check_names(robot: Robot, tree: RobotTree, faults: FaultList) -> None:
    for noun, items in (("link", robot.links), ("joint", robot.joints)):
        count = Counter(item.name for item in items)
        seen_names = set()
        for item in items:
            if not item.name:
                faults.add(tree.location(item.line), f"a {noun} has no name; give it one")
            elif count[item.name] > 1 and item.name in seen_names:
                faults.add(tree.location(item.line), f"{noun} '{item.name}' exists twice; rename one of them")
            seen_names.add(item.name)
    children: set[str] = set()
    for joint in robot.joints:
        if joint.child in children:
            faults.add(
                tree.location(joint.line),
                f"joint '{joint.name}': link '{joint.child}' is already the child of another joint; a link may have "
                "only one parent joint; remove one of them",
            )
        children.add(joint.child)


def _check_roots(tree: RobotTree, faults: FaultList) -> None:
    roots = tree.roots
    if len(roots) == 1:
        return
    line = tree.links[roots[1]].line if roots else 1
    names = ", ".join(roots) or "none"
    faults.add(
        tree.location(line),
        f"{len(roots)} links have no parent joint ({names}); only the root link may have none; "
        "connect the other links to the tree by joints",
    )


def _check_ends(joint: Joint, tree: RobotTree, faults: FaultList) -> None:
    for role, link in (("parent", joint.parent), ("child", joint.child)):
        if link not in tree.links:
            faults.add_unknown(tree.location(joint.line), f"joint '{joint.name}': {role} link", link, tree.links)
    if joint.kind not in KINDS:
        faults.add_unknown(tree.location(joint.line), f"joint '{joint.name}': type", joint.kind, KINDS)


def _check_axis(joint: Joint, tree: RobotTree, faults: FaultList) -> None:
    if joint.is_movable and not any(joint.axis):
        faults.add(
            tree.location(joint.line), f"joint '{joint.name}': its axis is 0 0 0; give it a direction, such as 0 0 1"
        )


def _check_limit(joint: Joint, tree: RobotTree, faults: FaultList) -> None:
    if joint.kind not in ("revolute", "prismatic"):
        return
    where = tree.location(joint.line)
    if joint.limit is None:
        faults.add(where, f"joint '{joint.name}' is {joint.kind}, but has no <limit>; add lower, upper and velocity")
    elif joint.limit.lower > joint.limit.upper:
        faults.add(
            where,
            f"joint '{joint.name}': its lower limit {joint.limit.lower:g} is above its upper limit "
            f"{joint.limit.upper:g}; swap or correct them",
        )
    elif joint.limit.velocity is not None and joint.limit.velocity < 0.0:
        faults.add(where, f"joint '{joint.name}': its velocity is {joint.limit.velocity:g}; it must be above 0")


def _check_mimic(joint: Joint, tree: RobotTree, faults: FaultList) -> None:
    if joint.mimic is None:
        return
    leaders = [name for name, item in tree.joints.items() if item.is_movable and name != joint.name]
    if joint.mimic.leader not in leaders:
        faults.add_unknown(
            tree.location(joint.line), f"joint '{joint.name}' mimics: joint", joint.mimic.leader, leaders
        )


def _check_transmissions(robot: Robot, tree: RobotTree, faults: FaultList) -> None:
    for item in robot.transmissions:
        for part in item.joints:
            if part.name not in tree.joints:
                faults.add_unknown(
                    tree.location(part.line), f"transmission '{item.name}': joint", part.name, tree.joints
                )


def _check_meshes(robot: Robot, tree: RobotTree, faults: FaultList) -> None:
    """Reports each missing mesh once, and each missing package once."""
    lines: dict[str, int] = {}
    for link in robot.links:
        for placed in (*link.visuals, *link.collisions):
            for shape in placed.shapes:
                if isinstance(shape, MeshFile):
                    lines.setdefault(shape.uri, placed.line)
    missing: set[str] = set()
    for uri, line in lines.items():
        match = _PACKAGE.match(uri)
        if match and match[1] in missing:
            continue
        try:
            mesh_path(uri, find_package)
        except MeshError as error:
            is_package = error.found.startswith("package ")
            if match and is_package:
                missing.add(match[1])
            count = sum(other.startswith(f"package://{match[1]}/") for other in lines) if match and is_package else 0
            note = f" ({count} meshes refer to it)" if count > 1 else ""
            faults.add(tree.location(line), f"mesh '{uri}': {error.found}{note}; {error.allowed}")
