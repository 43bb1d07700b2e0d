# SPDX-License-Identifier: BSD-3-Clause
"""Where the framework's own states and templates are, in devel and install space, and where it writes."""
from __future__ import annotations

import importlib.util
import os
from pathlib import Path

import rospkg

STATES_PACKAGE = "modular_framework_states.states"
TEMPLATES_PACKAGE = "modular_framework_core"


def framework_home() -> Path:
    """Return where the framework writes files of its own: ``$ROS_HOME`` (or ``~/.ros``) ``/modular_framework``."""
    return Path(os.environ.get("ROS_HOME") or Path.home() / ".ros") / "modular_framework"


def states_folder() -> Path:
    """Return the folder of the framework's states.

    Raises:
        FileNotFoundError: the package of the states is not on the Python path.
    """
    try:
        found = importlib.util.find_spec(STATES_PACKAGE)
    except ModuleNotFoundError:
        found = None
    if found is None or not found.submodule_search_locations:
        raise FileNotFoundError(
            f"{STATES_PACKAGE} is not on the Python path; source the workspace's setup.bash, or name the states "
            "directory"
        )
    return Path(next(iter(found.submodule_search_locations)))


def templates_folder() -> Path:
    """Return the folder of the framework's templates.

    Raises:
        FileNotFoundError: the package that has them is not in ROS_PACKAGE_PATH.
    """
    try:
        return Path(rospkg.RosPack().get_path(TEMPLATES_PACKAGE)) / "templates"
    except rospkg.ResourceNotFound as error:
        raise FileNotFoundError(
            f"the package {TEMPLATES_PACKAGE} is not in ROS_PACKAGE_PATH; source the workspace's setup.bash, or name "
            "the templates directory"
        ) from error
