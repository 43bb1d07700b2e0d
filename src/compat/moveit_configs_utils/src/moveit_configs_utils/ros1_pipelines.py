# SPDX-License-Identifier: BSD-3-Clause
"""Turns the parameters of a planning pipeline, as MoveIt 1 or MoveIt 2 writes them, into ROS 1's."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from launch_param_builder import ParameterFileError

LOGGER = logging.getLogger(__name__)
REQUEST, RESPONSE = "default_planning_request_adapters/", "default_planning_response_adapters/"
MOVEIT1 = "default_planner_request_adapters/"
# Adapters of MoveIt 2 that have another name in MoveIt 1.
RENAMED = {"ValidateWorkspaceBounds": "FixWorkspaceBounds", "CheckStartStateBounds": "FixStartStateBounds"}
# What MoveIt 2 does in an adapter and a pipeline of MoveIt 1 does always.
BUILT_IN = frozenset({"CheckStartStateCollision", "ValidateSolution", "DisplayMotionPath"})
# What a pipeline that says nothing of it takes from its launch file or from the packaged defaults.
COMPLETED = ("planning_plugin", "request_adapters", "capabilities", "default_planner_config")


def ros1_pipeline(parameters: Mapping[str, Any], where: Path) -> dict[str, Any]:
    """Returns the parameters of a pipeline with `planning_plugin` and `request_adapters` as ROS 1 has them.

    MoveIt 2 lists several `planning_plugins`, and adapters before (`request_adapters`) and after planning
    (`response_adapters`), in the order they run. MoveIt 1 has one plugin and one text of adapters, outermost first:
    what runs last after planning comes first in it.

    Args:
        parameters: as they stand in a file of either.
        where: that file, for messages.

    Raises:
        ParameterFileError: a value is no name or list of names.
    """
    result = {key: value for key, value in parameters.items() if key not in ("planning_plugins", "response_adapters")}
    plugins = _names(parameters, "planning_plugins", where)
    if plugins:
        result.setdefault("planning_plugin", plugins[0])
    if len(plugins) > 1:
        LOGGER.warning(
            "%s: planning_plugins lists %s; a pipeline of ROS 1 has one planner, %s: the others do not run",
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
    raise ParameterFileError(f"{where}: {key} is {value!r}; a list of names is needed, or one text of them with spaces")


def _moveit1_name(name: str) -> str:
    """Returns MoveIt 1's name of an adapter; empty for what its pipelines do always."""
    short = name.removeprefix(REQUEST).removeprefix(RESPONSE)
    if short == name:
        return name
    return "" if short in BUILT_IN else MOVEIT1 + RENAMED.get(short, short)


def completed(parameters: Mapping[str, Any], source: Mapping[str, Any], keys: tuple[str, ...]) -> dict[str, Any]:
    """Returns the parameters, completed by those of a source.

    Args:
        parameters: Parameters that stay.
        source: Parameters that are added where `parameters` lacks them.
        keys: Keys that may be added; empty for all keys.
    """
    wanted = {key: value for key, value in source.items() if not keys or key in keys}
    return {**wanted, **parameters}
