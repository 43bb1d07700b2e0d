# SPDX-License-Identifier: BSD-3-Clause
"""Converts the parameters of a planning pipeline in the format of MoveIt 1 or MoveIt 2 to ROS 1."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from launch_param_builder import ParameterFileError

LOGGER = logging.getLogger(__name__)
REQUEST, RESPONSE = "default_planning_request_adapters/", "default_planning_response_adapters/"
MOVEIT1 = "default_planner_request_adapters/"
# MoveIt 1's names of MoveIt 2's adapters.
RENAMED = {"ValidateWorkspaceBounds": "FixWorkspaceBounds", "CheckStartStateBounds": "FixStartStateBounds"}
# Adapters of MoveIt 2 whose function is always part of a pipeline in MoveIt 1.
BUILT_IN = frozenset({"CheckStartStateCollision", "ValidateSolution", "DisplayMotionPath"})
# Keys that are taken from the launch file or the packaged defaults if missing.
KEYS_WITH_DEFAULTS = ("planning_plugin", "request_adapters", "capabilities", "default_planner_config")


def ros1_pipeline(parameters: Mapping[str, Any], where: Path) -> dict[str, Any]:
    """Returns the parameters of a pipeline with `planning_plugin` and `request_adapters` of ROS 1.

    MoveIt 2 lists `planning_plugins`, and adapters before planning (`request_adapters`) and after planning
    (`response_adapters`) in the order of execution. MoveIt 1 has one plugin and a text with the adapters, outermost
    first, so the last adapter after planning is the first in this text.

    Args:
        parameters: Parameters in either format.
        where: Path of the file for messages.

    Raises:
        ParameterFileError: A value is not a name or a list of names.
    """
    result = {key: value for key, value in parameters.items() if key not in ("planning_plugins", "response_adapters")}
    plugins = _names(parameters, "planning_plugins", where)
    if plugins:
        result.setdefault("planning_plugin", plugins[0])
    if len(plugins) > 1:
        LOGGER.warning(
            "%s: planning_plugins lists %s; a pipeline of ROS 1 has a single planner, %s, so the others do not run",
            where,
            ", ".join(plugins),
            result["planning_plugin"],
        )
    if "request_adapters" in parameters or "response_adapters" in parameters:
        before, after = (_names(parameters, key, where) for key in ("request_adapters", "response_adapters"))
        adapters = [_moveit1_name(name) for name in (*reversed(after), *before)]
        result["request_adapters"] = " ".join(name for name in adapters if name)
    return result


def _names(parameters: Mapping[str, Any], key: str, where: Path) -> list[str]:
    value = parameters.get(key, [])
    if isinstance(value, str):
        return value.split()
    if isinstance(value, list) and all(isinstance(item, str) for item in value):
        return value
    raise ParameterFileError(f"{where}: {key} is {value!r}; expected a list of names, or a text of names with spaces")


def _moveit1_name(name: str) -> str:
    """Returns MoveIt 1's name of an adapter; empty for a function that is always part of a pipeline."""
    short = name.removeprefix(REQUEST).removeprefix(RESPONSE)
    if short == name:
        return name
    return "" if short in BUILT_IN else MOVEIT1 + RENAMED.get(short, short)


def with_missing_keys(
    parameters: Mapping[str, Any], source: Mapping[str, Any], keys: tuple[str, ...]
) -> dict[str, Any]:
    """Returns the parameters, completed by the parameters of a source.

    Args:
        parameters: Parameters, which take precedence.
        source: Parameters that are added if `parameters` lacks them.
        keys: Keys that may be added; empty for all keys.
    """
    wanted = {key: value for key, value in source.items() if not keys or key in keys}
    return {**wanted, **parameters}
