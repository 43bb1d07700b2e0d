# SPDX-License-Identifier: BSD-3-Clause
"""Finds the planners of a MoveIt configuration package without starting its move_group."""

from __future__ import annotations

from functools import lru_cache

import roslaunch.core

from modular_framework_core.files import default_folders
from modular_framework_core.launching.ros_launch_preview import preview_launch
from modular_framework_core.task_constructor.known_names import PlannerNames

MOVE_GROUP = "move_group"


@lru_cache(maxsize=16)
def installed_planners(package: str = "") -> PlannerNames | None:
    """Returns the planners of a robot's move_group.

    Args:
        package: MoveIt configuration package; "" for the package in the API package's launch file.

    Returns:
        The names, or None if the package is not found or its launch file starts no move_group.

    Raises:
        ValueError: The launch file or a pipeline in it is invalid.
    """
    # imported here because the import takes half a second and most tasks name no planner
    from modular_framework_planning.errors import PlanningError
    from modular_framework_planning.planning_pipeline.planner_registry import PlannerRegistry

    folder = default_folders.moveit_config_folder(package)
    launch_file = None if folder is None else folder / "launch" / "move_group.launch"
    if launch_file is None or not launch_file.is_file():
        return None
    try:
        launch = preview_launch(str(launch_file), [])
        node = next((node for node in launch.nodes if node.executable == MOVE_GROUP), None)
        return None if node is None else PlannerNames(PlannerRegistry(launch.below(node.name)).by_pipeline())
    except (roslaunch.core.RLException, PlanningError) as error:
        raise ValueError(
            f"{launch_file}: the planners that a task may name cannot be read: {error}; correct the launch file, or "
            "name the robot's MoveIt configuration package (--moveit-config)"
        ) from error
