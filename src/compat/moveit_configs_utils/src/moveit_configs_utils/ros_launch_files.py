# SPDX-License-Identifier: BSD-3-Clause
"""Reads the parameters in a roslaunch file, in which MoveIt 1 keeps a pipeline's planner and adapters."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import roslaunch.config
import roslaunch.core
import roslaunch.xmlloader
import rospkg
from launch.core.parameter_plan import nested

from modular_framework_urdf.launch_arguments import ARGUMENT
from modular_framework_urdf.xml_text import read, to_text

LOGGER = logging.getLogger(__name__)


def launch_file_parameters(path: Path, values: Mapping[str, str]) -> dict[str, Any]:
    """Returns the parameters that a roslaunch file sets with its default arguments, as nested mappings.

    No node is started, and no master is needed.

    Args:
        path: Path of the launch file.
        values: Values of arguments without a default, possibly including undeclared arguments.

    Returns:
        The parameters; empty, with a warning, if roslaunch rejects the file.
    """
    config = roslaunch.config.ROSLaunchConfig()
    try:
        loader = roslaunch.xmlloader.XmlLoader()
        loader.ignore_unset_args = False
        given = [f"{name}:={values[name]}" for name in _arguments_without_value(path) if name in values]
        loader.load(str(path), config, argv=given, verbose=False)
    except (roslaunch.core.RLException, rospkg.ResourceNotFound, ValueError, OSError) as error:
        reason = str(error).partition("\nROS path")[0]  # excludes the search path that rospkg appends
        LOGGER.warning("%s: its parameters are left out, because roslaunch cannot load it: %s", path, reason)
        return {}
    return nested({name: parameter.value for name, parameter in sorted(config.params.items())})


def _arguments_without_value(path: Path) -> list[str]:
    """Returns the arguments without value or default that a launch file declares or uses."""
    root = read(path)
    declared = [item for item in root.iter("arg") if item.getparent().tag != "include"]
    used = ARGUMENT.findall(to_text(root))
    with_value = {item.get("name") for item in declared if {"value", "default"} & set(item.keys())}
    return sorted({str(item.get("name")) for item in declared}.union(used) - with_value)
