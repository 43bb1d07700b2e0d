# SPDX-License-Identifier: BSD-3-Clause
"""Asks a person on the terminal what cannot be known from a URDF; Enter takes what was found."""

from __future__ import annotations

from modular_framework_setup.config_files.robot_tree import RobotTree
from modular_framework_setup.creation.robot_parts import RobotParts, find_parts
from modular_framework_setup.creation.robot_plan import Choices
from modular_framework_setup.errors import CreationError


def ask_name(found: str) -> str:
    """Returns the name of the robot."""
    return input(f"Name of the robot, in the names of the packages [{found}]: ").strip() or found


def confirm_parts(tree: RobotTree, parts: RobotParts, choices: Choices) -> RobotParts:
    """Shows the arms and grippers, and takes other links until the person is content."""
    while True:
        fingers = [_ask_links(f"Fingers of {item.name} on {item.palm}", item.links) for item in parts.grippers]
        if not parts.grippers:
            given = input("No gripper was found. Links of its fingers, separated by spaces [none]: ").split()
            fingers = [given] if given else []
        chains = []
        for arm in parts.arms:
            base, tip = _ask_links(
                f"Base and tip link of {arm.name} ({len(arm.joints)} joints)", (arm.base, arm.tip), 2
            )
            chains.append((base, tip))
        is_as_found = chains == [(arm.base, arm.tip) for arm in parts.arms] and fingers == [
            list(item.links) for item in parts.grippers
        ]
        if is_as_found:
            return parts
        try:
            return find_parts(tree, chains, fingers)
        except CreationError as error:
            print(error)


def _ask_links(question: str, found: tuple[str, ...], count: int | None = None) -> list[str]:
    while True:
        answer = input(f"{question} [{' '.join(found)}]: ").split() or list(found)
        if count is None or len(answer) == count:
            return answer
        print(f"got {len(answer)} links; give {count}")
