# SPDX-License-Identifier: BSD-3-Clause
"""Converts the octomap sensors in the format of MoveIt 1 or MoveIt 2 to the parameter `sensors` of ROS 1."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from launch_param_builder import ParameterFileError


def ros1_sensors(content: Mapping[str, Any], where: Path) -> dict[str, Any]:
    """Returns the parameters with `sensors` as a list of mappings; no parameters if the first sensor is empty.

    MoveIt 2 may list only names, with the parameters of each sensor in a mapping of the same name.

    Args:
        content: Content of the file.
        where: Path of the file for messages.

    Raises:
        ParameterFileError: `sensors` is not a list, or a listed name has no mapping.
    """
    sensors = content.get("sensors", [])
    if not isinstance(sensors, list):
        raise ParameterFileError(f"{where}: sensors is {sensors!r}; expected a list")
    if not sensors or not sensors[0]:
        return {}
    missing = [item for item in sensors if isinstance(item, str) and not isinstance(content.get(item), Mapping)]
    if missing:
        raise ParameterFileError(f"{where}: sensors lists {', '.join(missing)}; add a mapping of that name")
    named = {item for item in sensors if isinstance(item, str)}
    listed = [content[item] if isinstance(item, str) else item for item in sensors]
    return {**{key: value for key, value in content.items() if key not in named}, "sensors": listed}
