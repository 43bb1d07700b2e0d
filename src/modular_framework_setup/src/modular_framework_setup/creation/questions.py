# SPDX-License-Identifier: BSD-3-Clause
"""Asks the user on the terminal to confirm or correct the parts found in a URDF; Enter confirms."""

from __future__ import annotations

from modular_framework_setup.config_files.robot_tree import RobotTree
from modular_framework_setup.creation.robot_parts import RobotParts, find_parts
from modular_framework_setup.creation.robot_plan import Choices
from modular_framework_setup.errors import CreationError


def ask_name(default: str) -> str:
    """Returns the robot name that the user enters, or the default."""
    return input(f"Name of the robot, used in the package names [{default}]: ").strip() or default


def confirm_parts(tree: RobotTree, parts: RobotParts, choices: Choices) -> RobotParts:
    """Asks for the links of arms and grippers until the user confirms the parts.

    Args:
        tree: Kinematic tree of the robot.
        parts: Parts found in the URDF.
        choices: Command-line options of the user.
    """
    while True:
        fingers = [_ask_links(f"Fingers of {item.name} on {item.palm}", item.links) for item in parts.grippers]
        if not parts.grippers:
            links = input("No gripper was found. Links of its fingers, separated by spaces [none]: ").split()
            fingers = [links] if links else []
        chains = []
        for arm in parts.arms:
            base, tip = _ask_links(
                f"Base and tip link of {arm.name} ({len(arm.joints)} joints)", (arm.base, arm.tip), 2
            )
            chains.append((base, tip))
        is_confirmed = chains == [(arm.base, arm.tip) for arm in parts.arms] and fingers == [
            list(item.links) for item in parts.grippers
        ]
        if is_confirmed:
            return parts
        try:
            return find_parts(tree, chains, fingers)
        except CreationError as error:
            print(error)


def _ask_links(question: str, default: tuple[str, ...], count: int | None = None) -> list[str]:
    while True:
        links = input(f"{question} [{' '.join(default)}]: ").split() or list(default)
        if count is None or len(links) == count:
            return links
        print(f"got {len(links)} links; give {count}")
