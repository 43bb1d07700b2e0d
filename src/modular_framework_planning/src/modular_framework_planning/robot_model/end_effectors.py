# SPDX-License-Identifier: BSD-3-Clause
"""Finds the gripper of a planning group in the SRDF, and which links are the gripper's."""

from __future__ import annotations

from modular_framework_planning.errors import ErrorCode, PlanningError, UnknownNameError
from modular_framework_planning.robot_model.robot_model import JointGroup, RobotModel
from modular_framework_urdf.srdf_reader import EndEffector


def choose_end_effector(model: RobotModel, group: str, name: str) -> tuple[JointGroup, EndEffector]:
    """Returns the arm's group and its end effector.

    Args:
        model: the robot.
        group: planning group; empty: the parent group of the end effector. Of a group that is no chain, such as two
            arms, the smallest chain in it that moves the end effector is the arm.
        name: of the end effector; empty: the group's only one. An end effector belongs to a group that is its parent
            group, or that moves its parent link.

    Raises:
        PlanningError: a name is unknown, or the choice is not clear.
    """
    known = {item.name: item for item in model.semantics.end_effectors}
    if name and name not in known:
        raise UnknownNameError(ErrorCode.INVALID_GROUP_NAME, "end effector", name, known)
    if not group:
        if not name:
            raise PlanningError(
                ErrorCode.INVALID_GROUP_NAME,
                f"neither group_name nor end_effector is given; name one of the groups {', '.join(model.groups)}",
            )
        group = known[name].parent_group
    arm = model.group(group)
    fitting = [item for item in known.values() if item.parent_group == group] or [
        item for item in known.values() if _chain_to(model, arm, item.parent_link) is not None
    ]
    if name:
        fitting = [item for item in fitting if item.name == name]
    if len(fitting) != 1:
        raise PlanningError(
            ErrorCode.INVALID_GROUP_NAME,
            f"group '{group}' has {len(fitting)} end effectors "
            f"({', '.join(item.name for item in fitting) or 'none'}"
            f"{f' named {name}' if name else ''}); exactly one is needed: name it, or add "
            "<end_effector> with this parent_group to the SRDF",
        )
    return _chain_to(model, arm, fitting[0].parent_link) or arm, fitting[0]


def _chain_to(model: RobotModel, group: JointGroup, link: str) -> JointGroup | None:
    """Returns the group, or the smallest group of some of its joints, that is a chain and moves a link."""
    chains = [
        item
        for item in (group, *model.groups.values())
        if set(item.joints) <= set(group.joints) and _moves(model, item, link)
    ]
    return group if group in chains else min(chains, key=lambda item: len(item.joints), default=None)


def _moves(model: RobotModel, group: JointGroup, link: str) -> bool:
    """Whether a link is rigidly fixed to the end of a group's chain."""
    if not group.is_chain or not model.has_link(link):
        return False
    frames = model.pin_model.frames
    ends = [frames[model.frame_ids[name]].parentJoint for name in (group.tip_link, link)]
    return bool(ends[0] == ends[1])


def hand_links(model: RobotModel, effector: EndEffector) -> tuple[str, ...]:
    """Returns the links of the end effector's group and what lies between them and the link it is fixed to."""
    parents = {child: model.document.joint_parents[joint] for joint, child in model.document.joint_children.items()}
    links = list(model.group(effector.group).links)
    for link in tuple(links):
        while model.has_link(parents.get(link, "")) and parents[link] != effector.parent_link:
            link = parents[link]
            if link not in links:
                links.append(link)
    return tuple(links)
