# SPDX-License-Identifier: BSD-3-Clause
"""Finds the framework's states, templates, configuration and output folder, in devel and install space."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Sequence
from pathlib import Path

import rospkg

from modular_framework_urdf import xml_text

STATES_PACKAGE = "modular_framework_states.states"
TEMPLATES_PACKAGE = "modular_framework_core"
API_PACKAGE = "modular_framework_api"
SCRIPTS_FOLDER = "task_constructor_scripts"
LAUNCH_FILE = "start_framework.launch"
MODEL_PATH_VARIABLE = "GAZEBO_MODEL_PATH"
"""Environment variable that lists folders of models, separated by colons, as in Gazebo."""


def framework_home() -> Path:
    """Returns the framework's output folder, ``$ROS_HOME/modular_framework``, where ROS_HOME defaults to ``~/.ros``."""
    return Path(os.environ.get("ROS_HOME") or Path.home() / ".ros") / "modular_framework"


def states_folder() -> Path:
    """Returns the folder of the framework's states.

    Raises:
        FileNotFoundError: The package of the states is not on the Python path.
    """
    try:
        spec = importlib.util.find_spec(STATES_PACKAGE)
    except ModuleNotFoundError:
        spec = None
    if spec is None or not spec.submodule_search_locations:
        raise FileNotFoundError(
            f"{STATES_PACKAGE} is not on the Python path; source the workspace's setup.bash, or name the states "
            "directory"
        )
    return Path(next(iter(spec.submodule_search_locations)))


def states_folders(user_folders: Sequence[Path]) -> list[Path]:
    """Returns the user's states folders followed by the framework's."""
    return [*user_folders, *([] if states_folder() in user_folders else [states_folder()])]


def templates_folders(user_folders: Sequence[Path]) -> list[Path]:
    """Returns the user's templates folders followed by the framework's."""
    return [*user_folders, *([] if templates_folder() in user_folders else [templates_folder()])]


def config_folder() -> Path | None:
    """Returns the configuration folder of the API package, or None if the package is not installed."""
    folder = _package(API_PACKAGE)
    return None if folder is None or not (folder / "config").is_dir() else folder / "config"


def task_script(name: Path) -> Path:
    """Returns the path of a task script. A relative path that does not exist is resolved in the API package."""
    folder = _package(API_PACKAGE)
    if name.exists() or name.is_absolute() or folder is None:
        return name
    return folder / SCRIPTS_FOLDER / name


def moveit_config_folder(package: str = "") -> Path | None:
    """Returns the folder of a MoveIt configuration package, by default the package in the API package's launch file.

    Returns None if the package is not found.
    """
    package = package or _default_argument("moveit_config_package")
    return _package(package) if package else None


def models_folder(package: str = "") -> Path | None:
    """Returns the folder of the models in a package, by default in the description package of the API's launch file.

    Returns None if the package is not found or has no models.
    """
    package = package or _default_argument("description_package")
    folder = _package(package) if package else None
    return None if folder is None or not (folder / "models").is_dir() else folder / "models"


def model_search_path(models: Path) -> tuple[Path, ...]:
    """Returns the folders in which tasks and experiments find models by name, in search order.

    Args:
        models: Folder of the models of the description package; the folders in GAZEBO_MODEL_PATH follow.
    """
    return (models, *(Path(folder) for folder in os.environ.get(MODEL_PATH_VARIABLE, "").split(os.pathsep) if folder))


def _default_argument(name: str) -> str:
    """Returns the default of an argument of the API package's launch file; "" if there is none."""
    api = _package(API_PACKAGE)
    launch = None if api is None else api / "launch" / LAUNCH_FILE
    if launch is None or not launch.is_file():
        return ""
    args = xml_text.read(launch).findall("arg")
    return next((item.get("default", "") for item in args if item.get("name") == name), "")


def srdf_file(package: str = "") -> Path | None:
    """Returns the SRDF of a MoveIt configuration package, by default the package in the API package's launch file.

    Returns None if the package is missing or does not have exactly one SRDF.
    """
    folder = moveit_config_folder(package)
    srdf_files = [] if folder is None else sorted(folder.glob("config/*.srdf"))
    return srdf_files[0] if len(srdf_files) == 1 else None


def _package(name: str) -> Path | None:
    try:
        return Path(rospkg.RosPack().get_path(name))
    except rospkg.ResourceNotFound:
        return None


def templates_folder() -> Path:
    """Returns the folder of the framework's templates.

    Raises:
        FileNotFoundError: The package with the templates is not in ROS_PACKAGE_PATH.
    """
    try:
        return Path(rospkg.RosPack().get_path(TEMPLATES_PACKAGE)) / "templates"
    except rospkg.ResourceNotFound as error:
        raise FileNotFoundError(
            f"the package {TEMPLATES_PACKAGE} is not in ROS_PACKAGE_PATH; source the workspace's setup.bash, or name "
            "the templates directory"
        ) from error
