# SPDX-License-Identifier: BSD-3-Clause
"""Reads the grippers in the SRDF of a config package, for the self-collision matrix."""

from __future__ import annotations

from collections.abc import Mapping

from modular_framework_planning.geometry.spatial import Array
from modular_framework_planning.robot_model.end_effectors import hand_links
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_setup.creation.self_collisions import Hand
from modular_framework_urdf.srdf_reader import EndEffector


def hands_of(model: RobotModel) -> list[Hand]:
    """Returns the hand of each end effector, with the named states of its group.

    A hand consists of the group's links, the parent link, the links between them, and the links of joints that mimic
    the group's joints. Without named states, the joint limits count as open and closed.

    Args:
        model: Robot model with the SRDF of the package.

    Raises:
        UnknownNameError: A group is unknown.
    """
    return [Hand(_links(model, item), _states(model, item.group)) for item in model.semantics.end_effectors]


def _links(model: RobotModel, effector: EndEffector) -> frozenset[str]:
    document, members = model.document, model.group(effector.group).joints
    followers = [document.joint_children[name] for name, mimic in document.mimics.items() if mimic.leader in members]
    return frozenset((effector.parent_link, *hand_links(model, effector), *followers))


def _states(model: RobotModel, group: str) -> tuple[Array, ...]:
    named = model.semantics.group_states.get(group, {})
    if named:
        return tuple(_state(model, positions) for positions in named.values())
    active = model.group(group).joints
    return tuple(
        _state(model, {name: float(bounds[model.index[name]]) for name in active})
        for bounds in (model.lower, model.upper)
    )


def _state(model: RobotModel, positions: Mapping[str, float]) -> Array:
    state = model.default_positions()
    for name, position in positions.items():
        if name in model.index:
            state[model.index[name]] = position
    return model.with_mimics(state)
