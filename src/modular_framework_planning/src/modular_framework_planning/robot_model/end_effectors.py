# SPDX-License-Identifier: BSD-3-Clause
"""End effectors in the SRDF: selection for a planning group, and their links."""

from __future__ import annotations

from modular_framework_planning.errors import ErrorCode, PlanningError, UnknownNameError
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel
from modular_framework_urdf.srdf_reader import EndEffector


def choose_end_effector(model: RobotModel, group: str, name: str) -> tuple[JointGroup, EndEffector]:
    """Returns the group of the arm and its end effector.

    An end effector belongs to its parent group, or to a group that moves its parent link.

    Args:
        model: Robot model.
        group: Planning group; empty for the parent group of the end effector. In a group of several chains, such as
            two arms, the arm is the smallest chain that moves the end effector.
        name: Name of the end effector; empty for the only end effector of the group.

    Raises:
        PlanningError: A name is unknown, or the choice is ambiguous.
    """
    effectors = {item.name: item for item in model.semantics.end_effectors}
    if name and name not in effectors:
        raise UnknownNameError(ErrorCode.INVALID_GROUP_NAME, "end effector", name, effectors)
    if not group:
        if not name:
            raise PlanningError(
                ErrorCode.INVALID_GROUP_NAME,
                f"neither group_name nor end_effector is set; choose one of the groups {', '.join(model.groups)}",
            )
        group = effectors[name].parent_group
    arm = model.group(group)
    matches = [item for item in effectors.values() if item.parent_group == group] or [
        item for item in effectors.values() if _chain_to(model, arm, item.parent_link) is not None
    ]
    if name:
        matches = [item for item in matches if item.name == name]
    if len(matches) != 1:
        raise PlanningError(
            ErrorCode.INVALID_GROUP_NAME,
            f"group '{group}' has {len(matches)} end effectors "
            f"({', '.join(item.name for item in matches) or 'none'}"
            f"{f' named {name}' if name else ''}); exactly one is needed: set end_effector, or add an "
            "<end_effector> with this parent_group to the SRDF",
        )
    return _chain_to(model, arm, matches[0].parent_link) or arm, matches[0]


def _chain_to(model: RobotModel, group: JointGroup, link: str) -> JointGroup | None:
    """Returns the group or, if it is not a chain, the smallest chain among its subgroups that moves a link."""
    chains = [
        item
        for item in (group, *model.groups.values())
        if set(item.joints) <= set(group.joints) and _moves_link(model, item, link)
    ]
    return group if group in chains else min(chains, key=lambda item: len(item.joints), default=None)


def _moves_link(model: RobotModel, group: JointGroup, link: str) -> bool:
    """Checks that a link is rigidly fixed to the end of a group's chain."""
    if not group.is_chain or not model.has_link(link):
        return False
    frames = model.pin_model.frames
    ends = [frames[model.frame_ids[name]].parentJoint for name in (group.tip_link, link)]
    return bool(ends[0] == ends[1])


def hand_links(model: RobotModel, effector: EndEffector) -> tuple[str, ...]:
    """Returns the links of the end effector's group, and the links between this group and the parent link."""
    links = list(model.group(effector.group).links)
    for link in tuple(links):
        for _, parent in model.tree.up(link):
            if parent == effector.parent_link or not model.has_link(parent):
                break
            if parent not in links:
                links.append(parent)
    return tuple(links)
