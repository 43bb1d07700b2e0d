# SPDX-License-Identifier: BSD-3-Clause
"""Which messages, postures and planning groups a task may name: those of configuration files and of the robot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from modular_framework_core.files import default_folders, shallow_yaml
from modular_framework_core.files.atomic_files import read_text
from modular_framework_urdf.srdf_reader import read_srdf

_FILES = {"joint_state": "named_joint_states.yaml", "trajectory": "named_trajectories.yaml", "pose": "named_poses.yaml"}
_MANIPULATOR_FILE = "manipulator_controller_parameters.yaml"
_GROUP_KEY = "manipulator_group_name"


@dataclass(frozen=True, slots=True)
class KnownNames:
    """Names by kind: joint_state, trajectory, pose, robot_pose, plan, grasp, posture, group, planner.

    Attributes:
        names: Kind -> the names there are; a kind that is left out is not known, and any name of it may be right.
        origins: Kind -> where its names come from, for messages.
        manipulator_group: Planning group whose named states are the postures; "" when it is not known.
    """

    names: Mapping[str, frozenset[str]] = field(default_factory=dict)
    origins: Mapping[str, str] = field(default_factory=dict)
    manipulator_group: str = ""

    def with_names(self, more: Mapping[str, frozenset[str]]) -> KnownNames:
        """Returns these names with more of them; kinds that are not known stay so."""
        merged = {kind: names | more.get(kind, frozenset()) for kind, names in self.names.items()}
        return KnownNames(
            merged | {"plan": merged.get("plan", frozenset()) | more.get("plan", frozenset())},
            self.origins,
            self.manipulator_group,
        )

    def with_planners(self, planners: frozenset[str]) -> KnownNames:
        """Returns these names with the planners there are."""
        return KnownNames({**self.names, "planner": planners}, self.origins, self.manipulator_group)

    def with_robot(self, srdf: str, origin: str) -> KnownNames:
        """Returns these names with the planning groups and postures of a robot.

        Args:
            srdf: Text of the robot's SRDF.
            origin: Where it comes from, for messages.

        Raises:
            ValueError: The text cannot be read as SRDF.
        """
        robot = read_srdf(srdf, origin)
        groups = frozenset(robot.groups)
        names, origins = {**self.names, "group": groups}, {**self.origins, "group": origin}
        if self.manipulator_group in groups:
            names["posture"] = frozenset(robot.group_states.get(self.manipulator_group, {}))
            origins["posture"] = f"group '{self.manipulator_group}' of {origin}"
        return KnownNames(names, origins, self.manipulator_group)


def names_of_config(folder: Path) -> KnownNames:
    """Returns the names in the YAML files of a configuration folder; a file that is not there leaves its kind unknown.

    Raises:
        ValueError: The folder is not there, or a file cannot be read; names it.
    """
    if not folder.is_dir():
        raise ValueError(f"configuration folder {folder} is not a directory; name the one with named_joint_states.yaml")
    names: dict[str, frozenset[str]] = {}
    origins: dict[str, str] = {}
    for kind, file in _FILES.items():
        content = _mapping_in(folder / file)
        if content is None:
            continue
        is_pose = {name: not isinstance(entry, dict) or "position" in entry for name, entry in content.items()}
        names[kind] = frozenset(str(name) for name in content if kind != "pose" or is_pose[name])
        origins[kind] = str(folder / file)
        if kind == "pose":
            names["robot_pose"], origins["robot_pose"] = frozenset(map(str, content)) - names[kind], origins[kind]
    group = (_mapping_in(folder / _MANIPULATOR_FILE) or {}).get(_GROUP_KEY, "")
    return KnownNames(names, origins, str(group))


def names_of_installation(config: Path | None, moveit_package: str = "") -> KnownNames:
    """Returns the names of a configuration folder and of a MoveIt configuration package's robot.

    Args:
        config: The folder; None for that of the API package, where that is installed.
        moveit_package: Name of the package; "" for that of the API package's launch file.

    Raises:
        ValueError: A file cannot be read, or what was named is not there.
    """
    folder = config or default_folders.config_folder()
    names = KnownNames() if folder is None else names_of_config(folder)
    srdf = default_folders.srdf_file(moveit_package)
    if srdf is None and moveit_package:
        raise ValueError(
            f"package '{moveit_package}' is not found, or has not exactly one SRDF in config/; name the "
            "robot's MoveIt configuration package, one that is on ROS_PACKAGE_PATH"
        )
    return names if srdf is None else names.with_robot(srdf.read_text(encoding="utf-8"), str(srdf))


def _mapping_in(file: Path) -> dict[Any, Any] | None:
    """Returns the mapping in a YAML file; None when the file is not there."""
    try:
        content = shallow_yaml.load(read_text(file))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, yaml.YAMLError, RecursionError) as error:
        raise ValueError(f"{file} cannot be read: {error}; names of it cannot be checked before it can") from error
    if content is not None and not isinstance(content, dict):
        raise ValueError(f"{file} must be a mapping of names, found {type(content).__name__}")
    return content or {}
