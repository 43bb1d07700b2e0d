# SPDX-License-Identifier: BSD-3-Clause
"""Collects the names that a task may use for messages, postures, planning groups and planners."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import yaml

from modular_framework_core.files import default_folders, shallow_yaml
from modular_framework_core.files.atomic_files import read_text
from modular_framework_core.files.model_files import MODEL_FILE
from modular_framework_urdf.srdf_reader import read_srdf

JOINT_STATES_FILE, TRAJECTORIES_FILE = "named_joint_states.yaml", "named_trajectories.yaml"
POSES_FILE = "named_poses.yaml"
_FILES = {"joint_state": JOINT_STATES_FILE, "trajectory": TRAJECTORIES_FILE, "pose": POSES_FILE}
_MANIPULATOR_FILE = "manipulator_controller_parameters.yaml"
_GROUP_KEY = "manipulator_group_name"
PLANNER, MODEL, SERIES, OBJECT_TYPE = "planner", "model", "series", "object_type"
MODEL_PATH = "/gazebo_model_path"
"""Parameter with the folders of models."""


@dataclass(frozen=True, slots=True)
class PlannerNames(Collection[str]):
    """Names of planners, each as PLANNER and as PIPELINE/PLANNER.

    Attributes:
        by_pipeline: Pipeline -> planners; empty for a pipeline that accepts any planner.
    """

    by_pipeline: Mapping[str, Collection[str]]

    def __contains__(self, name: object) -> bool:
        pipeline, _, planner = str(name).rpartition("/")
        if not pipeline:
            return any(planner in planners for planners in self.by_pipeline.values())
        planners = self.by_pipeline.get(pipeline)
        return planners is not None and (planner in planners or not planners)

    def __iter__(self) -> Iterator[str]:
        pairs = [(pipeline, planner) for pipeline, planners in self.by_pipeline.items() for planner in planners]
        return iter(dict.fromkeys(text for pipeline, item in pairs for text in (item, f"{pipeline}/{item}")))

    def __len__(self) -> int:
        return len(list(iter(self)))


@dataclass(frozen=True, slots=True)
class KnownNames:
    """Known names by kind.

    The kinds are joint_state, trajectory, pose, robot_pose, plan, grasp, posture, group, region, model,
    object_type (folder of a model), planner; and series, the common parts of numbered models.

    Attributes:
        names: Kind -> known names, except for planners. Names of an absent kind are not checked.
        origins: Kind -> source of its names, for messages.
        manipulator_group: Planning group whose named states are the postures; "" if unknown.
        planners: Function that returns the available planners, called only for tasks that name a planner because the
            names are slow to find. Returns None if planners are not checked.
    """

    names: Mapping[str, frozenset[str]] = field(default_factory=dict)
    origins: Mapping[str, str] = field(default_factory=dict)
    manipulator_group: str = ""
    planners: Callable[[], PlannerNames | None] = lambda: None

    def of_kind(self, kind: str) -> Collection[str] | None:
        """Returns the known names of a kind; None if names of this kind are not checked."""
        if kind == SERIES:
            models = self.names.get(MODEL)
            return None if models is None else {name.removesuffix("_1") for name in models if name.endswith("_1")}
        return self.planners() if kind == PLANNER else self.names.get(kind)

    def with_names(self, further_names: Mapping[str, frozenset[str]]) -> KnownNames:
        """Returns a copy with further names. Absent kinds stay absent, except for ``plan``."""
        merged = {kind: names | further_names.get(kind, frozenset()) for kind, names in self.names.items()}
        return replace(
            self, names=merged | {"plan": merged.get("plan", frozenset()) | further_names.get("plan", frozenset())}
        )

    def with_regions(self, regions: Collection[str], origin: str) -> KnownNames:
        """Returns a copy with named regions.

        Args:
            regions: Names of the regions.
            origin: Source of the regions, for messages.
        """
        names, origins = {**self.names, "region": frozenset(regions)}, {**self.origins, "region": origin}
        return replace(self, names=names, origins=origins)

    def with_models(self, models: Collection[str], origin: str) -> KnownNames:
        """Returns a copy with the models of the world.

        Args:
            models: Names of the models.
            origin: Source of the models, for messages.
        """
        names, origins = {**self.names, MODEL: frozenset(models)}, {**self.origins, MODEL: origin}
        return replace(self, names=names, origins=origins | {SERIES: origin})

    def with_object_types(self, path: str, origin: str = "") -> KnownNames:
        """Returns a copy with the types of objects: the folders of models; unchanged for an empty path.

        Args:
            path: Folders with one folder per model, separated by colons, as in the parameter MODEL_PATH.
            origin: Source of the path, for messages; the parameter by default.
        """
        if not path:
            return self
        folders = [Path(folder) for folder in path.split(":") if folder]
        types = frozenset(
            str(file.parent.relative_to(folder)) for folder in folders for file in folder.glob(f"**/{MODEL_FILE}")
        )
        names, origins = (
            {**self.names, OBJECT_TYPE: types},
            {**self.origins, OBJECT_TYPE: origin or f"the parameter {MODEL_PATH}, {path}"},
        )
        return replace(self, names=names, origins=origins)

    def with_planners(self, planners: Callable[[], PlannerNames | None]) -> KnownNames:
        """Returns a copy with the function that returns the available planners; the copy calls the function once."""
        return replace(self, planners=cache(planners))

    def with_robot(self, srdf: str, origin: str) -> KnownNames:
        """Returns a copy with the planning groups and postures of a robot.

        Args:
            srdf: SRDF text.
            origin: Source of the SRDF, for messages.

        Raises:
            ValueError: The text is not a valid SRDF.
        """
        robot = read_srdf(srdf, origin)
        groups = frozenset(robot.groups)
        names, origins = {**self.names, "group": groups}, {**self.origins, "group": origin}
        if self.manipulator_group in groups:
            names["posture"] = frozenset(robot.group_states.get(self.manipulator_group, {}))
            origins["posture"] = f"group '{self.manipulator_group}' of {origin}"
        return replace(self, names=names, origins=origins)


def model_of(name: str) -> str:
    """Returns the model name of a planning scene object with the name MODEL or MODEL__LINK."""
    return name.partition("__")[0]


def names_of_config(folder: Path) -> KnownNames:
    """Returns the names in the YAML files of a configuration folder. A missing file leaves its kind absent.

    Raises:
        ValueError: The folder does not exist, or a file cannot be read.
    """
    if not folder.is_dir():
        raise ValueError(
            f"configuration folder {folder} is not a directory; name the folder with named_joint_states.yaml"
        )
    names: dict[str, frozenset[str]] = {}
    origins: dict[str, str] = {}
    for kind, file in _FILES.items():
        content = mapping_in_file(folder / file)
        if content is None:
            continue
        is_pose = {name: not isinstance(entry, dict) or "position" in entry for name, entry in content.items()}
        names[kind] = frozenset(str(name) for name in content if kind != "pose" or is_pose[name])
        origins[kind] = str(folder / file)
        if kind == "pose":
            names["robot_pose"], origins["robot_pose"] = frozenset(map(str, content)) - names[kind], origins[kind]
    group = (mapping_in_file(folder / _MANIPULATOR_FILE) or {}).get(_GROUP_KEY, "")
    return KnownNames(names, origins, str(group))


def names_of_installation(config: Path | None, moveit_package: str = "", description: str = "") -> KnownNames:
    """Returns the names of a configuration folder, of the robot in a MoveIt configuration package, and of models.

    Args:
        config: Configuration folder; None for the API package's folder, if installed.
        moveit_package: MoveIt configuration package; "" for the package in the API package's launch file.
        description: Package with the models; "" for the package in the API package's launch file.

    Raises:
        ValueError: A file cannot be read, or a given folder or package does not exist.
    """
    folder = config or default_folders.config_folder()
    names = KnownNames() if folder is None else names_of_config(folder)
    models = default_folders.models_folder(description)
    if models is not None:
        path = os.pathsep.join(map(str, default_folders.model_search_path(models)))
        names = names.with_object_types(path, path)
    elif description:
        raise ValueError(
            f"package '{description}' is not found, or has no folder models; name the package with the models"
        )
    srdf = default_folders.srdf_file(moveit_package)
    if srdf is None and moveit_package:
        raise ValueError(
            f"package '{moveit_package}' is not found, or does not have exactly one SRDF in config/; name the "
            "robot's MoveIt configuration package and add it to ROS_PACKAGE_PATH"
        )
    return names if srdf is None else names.with_robot(srdf.read_text(encoding="utf-8"), str(srdf))


def mapping_in_file(file: Path) -> dict[Any, Any] | None:
    """Returns the mapping in a YAML file, or None if the file does not exist."""
    try:
        content = shallow_yaml.load(read_text(file))
    except FileNotFoundError:
        return None
    except (OSError, ValueError, yaml.YAMLError, RecursionError) as error:
        raise ValueError(f"{file} cannot be read: {error}; correct it so that its names can be checked") from error
    if content is not None and not isinstance(content, dict):
        raise ValueError(f"{file} must be a mapping of names, found {type(content).__name__}")
    return content or {}
