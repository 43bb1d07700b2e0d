# SPDX-License-Identifier: BSD-3-Clause
"""Turns the sensors of an octomap, as MoveIt 1 or MoveIt 2 writes them, into the parameter `sensors` of ROS 1."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from launch_param_builder import ParameterFileError


def ros1_sensors(content: Mapping[str, Any], where: Path) -> dict[str, Any]:
    """Returns the parameters with `sensors` as a list of mappings; none where the first sensor is empty.

    MoveIt 2 may list names only, each described by a mapping of that name beside the list.

    Args:
        content: of the file.
        where: the file, for messages.

    Raises:
        ParameterFileError: `sensors` is no list, or a name in it is not described.
    """
    sensors = content.get("sensors", [])
    if not isinstance(sensors, list):
        raise ParameterFileError(f"{where}: sensors is {sensors!r}; a list is needed")
    if not sensors or not sensors[0]:
        return {}
    missing = [item for item in sensors if isinstance(item, str) and not isinstance(content.get(item), Mapping)]
    if missing:
        raise ParameterFileError(f"{where}: sensors lists {', '.join(missing)}; a mapping of that name is needed, too")
    named = {item for item in sensors if isinstance(item, str)}
    listed = [content[item] if isinstance(item, str) else item for item in sensors]
    return {**{key: value for key, value in content.items() if key not in named}, "sensors": listed}
