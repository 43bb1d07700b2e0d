# SPDX-License-Identifier: BSD-3-Clause
"""Loads the robots of the modes without simulation from a MoveIt configuration package, or from URDF and SRDF files."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from modular_framework_benchmark.episodes.ros_file_digests import robot_digests
from modular_framework_benchmark.experiments.robot_setting import RobotFiles, RobotSource
from modular_framework_benchmark.modes.errors import ModeError
from modular_framework_benchmark.modes.robots import Robot
from modular_framework_benchmark.records.episode_settings import as_json
from modular_framework_planning.errors import GeometryError, ModelError, PlanningError
from modular_framework_planning.kinematics.kinematics_settings import settings_from
from modular_framework_planning.robot_model.robot_model import RobotModel
from modular_framework_planning.robot_model.urdf_document import directory_resolver, package_resolver


@dataclass(frozen=True, slots=True)
class _MeshesBeside:
    """Picklable mesh resolver that searches packages first and a folder second."""

    folder: Path

    def __call__(self, uri: str) -> str:
        try:
            return package_resolver(uri)
        except ModelError:
            return directory_resolver(self.folder)(uri)


def load_robot(robot: RobotSource) -> Robot:
    """Returns a robot.

    Args:
        robot: MoveIt configuration package, or files; meshes of packages outside ROS_PACKAGE_PATH are searched beside
            the URDF.

    Raises:
        ModeError: A file is missing or invalid.
    """
    try:
        return _from_package(robot) if isinstance(robot, str) else _from_files(robot)
    except (ModelError, PlanningError, GeometryError, OSError) as error:
        raise ModeError(f"robot {as_json(robot)}: {error}") from error


def digests_of(robot: Robot) -> Mapping[str, str]:
    """Returns the SHA-256 of a robot's descriptions and meshes, keyed by description."""
    urdf, srdf, *_ = robot.model.source
    return robot_digests(urdf, srdf, robot.mesh_folder)


def _from_files(files: RobotFiles) -> Robot:
    urdf = Path(files.urdf)
    text = urdf.read_text()
    return Robot(
        RobotModel(text, Path(files.srdf).read_text(), {}, _MeshesBeside(urdf.parent)),
        urdf=text,
        mesh_folder=urdf.parent,
    )


def _from_package(package: str) -> Robot:
    from moveit_configs_utils import MoveItConfigsBuilder

    try:
        configs = MoveItConfigsBuilder(package.removesuffix("_moveit_config"), package_name=package).to_moveit_configs()
    except Exception as error:  # noqa: BLE001 - the builder raises many kinds of errors, which name the file
        raise ModeError(f"robot: MoveIt configuration package '{package}' cannot be loaded: {error}") from error
    (urdf,) = configs.robot_description.values()
    (srdf,) = configs.robot_description_semantic.values()
    planning = configs.joint_limits.get("robot_description_planning", {})
    return Robot(
        RobotModel(urdf, srdf, planning.get("joint_limits", {}), package_resolver),
        settings_from(configs.robot_description_kinematics.get("robot_description_kinematics", {})),
        {**planning, **configs.pilz_cartesian_limits.get("robot_description_planning", {})},
        _pipelines(configs.planning_pipelines),
        urdf,
    )


def _pipelines(parameters: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    parent = parameters.get("planning_pipelines")
    if isinstance(parent, Mapping):
        return {name: item for name, item in parent.items() if isinstance(item, Mapping)}
    return {
        name.removeprefix("planning_pipelines/"): item
        for name, item in parameters.items()
        if name.startswith("planning_pipelines/") and isinstance(item, Mapping)
    }
