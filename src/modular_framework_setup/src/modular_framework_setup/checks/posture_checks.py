# SPDX-License-Identifier: BSD-3-Clause
"""Checks that no named state is in collision; without named states, checks the default state instead."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_planning.contacts import Contact, describe_contacts
from modular_framework_planning.errors import PlanningError
from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.planning_interface.collision_detectors import DEFAULT_CHECKER
from modular_framework_planning.planning_scene.planning_scene import empty_scene
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_setup.config_files.description_files import XmlDocument
from modular_framework_urdf.xml_text import Element


def check_postures(
    urdf: XmlDocument, srdf: XmlDocument, root: Element, resolve: Callable[[str], str], faults: FaultList
) -> None:
    """Checks the named states of a robot for collisions. A robot that cannot be loaded is not checked.

    Args:
        urdf: URDF document.
        srdf: SRDF document.
        root: Root element of the SRDF.
        resolve: Function that returns the path of a mesh file from its URI.
        faults: Receives the faults.
    """
    try:
        model = RobotModel(urdf.text, srdf.text, resolve=resolve)
        states = root.findall("group_state")
        for element in states:
            _check_state(model, element, srdf.where, faults)
        default = model.default_positions()
        if not states and (contacts := _contacts(model, default)):
            faults.add(
                SourceLocation(srdf.where, root.sourceline, 1),
                "there is no named state, and the default state is in collision: "
                f"{describe_contacts(contacts)}; add a named state, or disable the collisions of links that may touch",
            )
    except PlanningError:
        return


def _check_state(model: RobotModel, element: Element, where: str, faults: FaultList) -> None:
    """Checks a named state for collisions between links whose relative pose the state determines."""
    group, name = element.get("group", ""), element.get("name", "")
    values = model.semantics.group_states.get(group, {}).get(name, {})
    positions, set_joints = model.default_positions(), {model.index[joint] for joint in values if joint in model.index}
    for joint, value in values.items():
        if joint in model.index:
            positions[model.index[joint]] = value
    set_joints |= {follower for follower, leader, _, _ in model.mimics if leader in set_joints}
    contacts = [
        contact
        for contact in _contacts(model, model.with_mimics(positions))
        if set_joints.issuperset(_joints_between(model, contact))
    ]
    if contacts:
        faults.add(
            SourceLocation(where, element.sourceline, 1),
            f"state '{name}' of group '{group}' is in collision: {describe_contacts(contacts)}; correct the state, or "
            "disable the collisions of links that may touch",
        )


def _joints_between(model: RobotModel, contact: Contact) -> set[int]:
    """Returns the indices of the joints that determine the relative pose of two links."""
    first, second = (set(model.joints_above(body.name)) for body in (contact.first, contact.second))
    return {model.index[joint] for joint in first ^ second}


def _contacts(model: RobotModel, positions: Array) -> list[Contact]:
    checker = DEFAULT_CHECKER(empty_scene(model, positions), np.arange(len(positions)))
    return checker.contacts(positions)
