# SPDX-License-Identifier: BSD-3-Clause
"""Checks before an experiment that the gripper of the robot can take the blocks of a tower."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from typing import Any

from modular_framework_benchmark.experiments.mode import ReadSettings, SettingFault
from modular_framework_benchmark.experiments.model_sizes import longest_side, sides
from modular_framework_benchmark.experiments.scene_objects import SceneObject
from modular_framework_benchmark.experiments.task_mode import TaskSettings
from modular_framework_benchmark.predicates.conditions import Stacked
from modular_framework_core.commander.robot_groups import RobotModelError, read_group
from modular_framework_core.grasp_generation.gripper_geometry import (
    GripperGeometryError,
    driven_joint,
    measure_gripper,
)

ARM_GROUP, HAND_GROUP = "/arm_group_name", "/manipulator_group_name"
JOINT, CLEARANCE = "gripper_joint", "min_finger_clearance"


def grasp_width_faults(
    read: ReadSettings[TaskSettings], parameters: Mapping[str, Any], methods: Iterable[str]
) -> Iterator[SettingFault]:
    """Yields a fault for each object to be stacked that is wider than the gripper opens.

    Args:
        read: Settings of a combination, with its objects.
        parameters: Parameters of the launch, keyed by full name.
        methods: Names of the nodes of the grasp method; without any, nothing is checked.
    """
    names = _stacked_names(read.settings)
    objects = [item for item in read.objects if item.name in names]
    for method in methods if objects else ():
        opening_m = _opening(parameters, str(parameters.get(f"{method}/{JOINT}", "")))
        if opening_m is None:
            continue
        widest_m = opening_m - 2.0 * float(parameters.get(f"{method}/{CLEARANCE}", 0.0))
        for item in objects:
            if _width(item) > widest_m:
                text = (
                    f"object '{item.name}' is {_width(item):.3f} m wide, and the gripper opens to {opening_m:.3f} m; "
                    f"allowed: at most {widest_m:.3f} m, with the clearance of the fingers; choose a smaller size"
                )
                yield SettingFault(("objects",), text)


def _stacked_names(settings: TaskSettings) -> set[str]:
    """Returns the names of the objects that must be put on others."""
    stacked = [condition for condition in settings.conditions if isinstance(condition, Stacked)]
    return {name for condition in stacked for name in condition.objects[1:]}


def _width(item: SceneObject) -> float:
    """Returns the largest possible length of the narrowest side [m]."""
    narrowest = min(sides(item.file))
    return narrowest if item.size is None else narrowest * item.size.high / longest_side(item.file)


def _opening(parameters: Mapping[str, Any], joint: str) -> float | None:
    """Returns the largest opening of the gripper [m]; None for a robot without a known gripper."""
    urdf, srdf = (str(parameters.get(f"/robot_description{end}", "")) for end in ("", "_semantic"))
    groups = str(parameters.get(ARM_GROUP, "")), str(parameters.get(HAND_GROUP, ""))
    return _measured_opening(urdf, srdf, *groups, joint)


@lru_cache(maxsize=16)
def _measured_opening(urdf: str, srdf: str, arm: str, hand: str, joint: str) -> float | None:
    try:
        tip = read_group(urdf, srdf, arm).tip_link
        return measure_gripper(urdf, tip, joint or driven_joint(urdf, srdf, hand)).max_opening
    except (GripperGeometryError, RobotModelError):
        return None
