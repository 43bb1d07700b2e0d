# SPDX-License-Identifier: BSD-3-Clause
"""Reads the parameters that a launch file of roslaunch sets: MoveIt 1 keeps a pipeline's planner and adapters there."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import roslaunch.config
import roslaunch.core
import roslaunch.xmlloader
import rospkg

LOGGER = logging.getLogger(__name__)


def launch_file_parameters(path: Path) -> dict[str, Any]:
    """Returns the parameters that a launch file of roslaunch sets with its default arguments, as nested mappings.

    Nothing is started, and no master is needed.

    Returns:
        The parameters; none, with a warning, where roslaunch refuses the file.
    """
    config = roslaunch.config.ROSLaunchConfig()
    try:
        roslaunch.xmlloader.XmlLoader().load(str(path), config, argv=[], verbose=False)
    except (roslaunch.core.RLException, rospkg.ResourceNotFound, ValueError, OSError) as error:
        LOGGER.warning("%s: its parameters are left out, roslaunch cannot load it: %s", path, error)
        return {}
    result: dict[str, Any] = {}
    for name, parameter in sorted(config.params.items()):
        *namespaces, last = name.strip("/").split("/")
        inner = result
        for namespace in namespaces:
            inner = inner.setdefault(namespace, {})
        inner[last] = parameter.value
    return result
