# SPDX-License-Identifier: BSD-3-Clause
"""Writes the two packages of a robot from templates."""

from __future__ import annotations

import re
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jinja2

from modular_framework_setup.config_files.config_package import find_package
from modular_framework_setup.creation.robot_parts import Arm
from modular_framework_setup.creation.robot_plan import RobotPlan
from modular_framework_setup.errors import CreationError

SUFFIX = ".jinja"
FRAMEWORK_FILES = (
    "sensors_config.yaml", "motion_planner_config.yaml", "manipulator_controller_parameters.yaml",
    "generative_methods_config.yaml",
)  # fmt: skip


def refuse_existing(parent: Path, names: tuple[str, ...]) -> None:
    """Raises CreationError if one of the packages exists already."""
    existing = [str(parent / name) for name in names if (parent / name).exists()]
    if existing:
        raise CreationError(
            f"{' and '.join(existing)} {'exists' if len(existing) == 1 else 'exist'} already and will not be "
            "overwritten; choose a different --name or --into, or move the folder"
        )


def write_packages(plan: RobotPlan, parent: Path) -> tuple[Path, Path]:
    """Writes the robot package and the config package.

    Args:
        plan: Content of the packages.
        parent: Parent folder of both packages.

    Returns:
        The folders of the robot package and of the config package.

    Raises:
        CreationError: One of the packages exists already.
    """
    names = plan.choices.robot_package, plan.choices.config_package
    refuse_existing(parent, names)
    templates = Path(find_package("modular_framework_setup")) / "templates"
    values = _values(plan)
    for kind, name in zip(("robot", "moveit_config"), names, strict=True):
        _render(templates / kind, parent / name, values)
    robot = parent / names[0]
    (robot / "urdf" / f"{plan.choices.name}.urdf").write_text(f'<?xml version="1.0"?>\n{plan.urdf}\n')
    for target, source in plan.copies.items():
        (robot / target).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, robot / target)
    if values["hand"]:
        _write_framework_files(plan, robot / "config")
    return robot, parent / names[1]


@dataclass(frozen=True, slots=True)
class Controller:
    """A controller in both packages.

    Attributes:
        name: Name of the controller.
        kind: Type of the controller in MoveIt.
        action: Name of the action.
        joints: Joint names.
        stroke: Range of the first joint [rad or m].
    """

    name: str
    kind: str
    action: str
    joints: tuple[str, ...]
    stroke: float


def _values(plan: RobotPlan) -> dict[str, Any]:
    parts = plan.parts
    arm = next((item for item in parts.arms if item.gripper), parts.arms[0])
    hand = parts.gripper_of(arm)
    is_placed = plan.root != "world"
    ready = [plan.states[item.name]["ready"] for item in parts.arms]
    opened = [plan.states[item.name]["open"] for item in parts.grippers]
    return {
        "plan": plan,
        "choices": plan.choices,
        "name": plan.choices.name,
        "robot_package": plan.choices.robot_package,
        "config_package": plan.choices.config_package,
        "parts": parts,
        "arms": parts.arms,
        "grippers": parts.grippers,
        "arm": arm,
        "hand": hand,
        "is_placed": is_placed,
        "root_frame": "world" if is_placed else plan.root,
        "end_effectors": [_end_effector(plan, item) for item in parts.arms if item.gripper],
        "controllers": _controllers(plan),
        "folders": [
            "urdf",
            "controllers",
            "launch",
            *(["meshes"] if plan.copies else []),
            *(["config"] if hand else []),
        ],
        "start": {joint: position for state in (*ready, *opened) for joint, position in state.items()},
        "hand_words": _hand_words(plan),
        "urdf_file": plan.urdf_file,
        "timestamp": int(time.time()),
    }


def _end_effector(plan: RobotPlan, arm: Arm) -> dict[str, str]:
    gripper = plan.parts.gripper_of(arm)
    palm = gripper.palm if gripper else arm.tip
    link = plan.palm_parents.get(palm, palm)
    return {"name": f"{arm.gripper}_tool", "group": arm.gripper, "parent_group": arm.name, "parent_link": link}


def _controllers(plan: RobotPlan) -> list[Controller]:
    def stroke(joint: str) -> float:
        return plan.joints[joint].upper - plan.joints[joint].lower

    chains = [(f"{arm.name}_trajectory_controller", arm.joints) for arm in plan.parts.arms]
    chains += [("torso_trajectory_controller", plan.parts.torso)] if plan.parts.torso else []
    controllers = [
        Controller(name, "FollowJointTrajectory", "follow_joint_trajectory", joints, stroke(joints[0]))
        for name, joints in chains
    ]
    for item in plan.parts.grippers:
        joints = (item.driver,)
        controllers.append(
            Controller(f"{item.name}_controller", "GripperCommand", "gripper_cmd", joints, stroke(item.driver))
        )
    return controllers


def _hand_words(plan: RobotPlan) -> str:
    """Returns the link names of all grippers, separated by spaces."""
    return " ".join(link for gripper in plan.parts.grippers for link in (gripper.palm, *gripper.links))


def _render(templates: Path, folder: Path, values: dict[str, Any]) -> None:
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(templates),
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
        trim_blocks=True,
        lstrip_blocks=True,
        autoescape=False,
    )
    for name in sorted(environment.list_templates()):
        text = environment.get_template(name).render(values)
        if text.strip():
            path = folder / name.removesuffix(SUFFIX).replace("NAME", values["name"])
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)


def _write_framework_files(plan: RobotPlan, folder: Path) -> None:
    """Copies the default configuration and inserts the names of this robot."""
    source = Path(find_package("modular_framework_api")) / "config"
    arm = next(item for item in plan.parts.arms if item.gripper)
    hand = plan.parts.gripper_of(arm)
    names = {
        "arm_group_name": arm.name,
        "manipulator_group_name": arm.gripper,
        "gripper_joint": hand.driver if hand else "",
    }
    folder.mkdir(exist_ok=True)
    for name in FRAMEWORK_FILES:
        text = (source / name).read_text()
        for key, value in names.items():
            text = _with_value(text, key, value)
        (folder / name).write_text(text)


def _with_value(text: str, key: str, value: str) -> str:
    """Returns a YAML text with a replaced text value of a key."""
    return re.sub(rf'^(\s*{key}: )"[^"]*"', rf'\g<1>"{value}"', text, flags=re.M)
