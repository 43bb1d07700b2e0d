# SPDX-License-Identifier: BSD-3-Clause
"""ROS parameters of an episode, for the modes without a parameter server."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from modular_framework_benchmark.modes.errors import ModeError


def parameters_below(parameters: Mapping[str, Any], parents: Sequence[str]) -> dict[str, Any]:
    """Returns the parameters below their parents as nested dictionaries.

    Args:
        parameters: Values by full name, such as `/move_group/planner_configs/RRTConnect/range`.
        parents: Full names with a trailing slash; the longest matching parent applies.

    Raises:
        ModeError: A parameter has no parent, so it would have no effect.
    """
    result: dict[str, Any] = {}
    for name, value in parameters.items():
        matching = [parent for parent in parents if name.startswith(parent)]
        if not matching:
            raise ModeError(
                f"parameter '{name}' has no effect in this mode; allowed: names below {' and '.join(parents)}"
            )
        *path, last = name.removeprefix(max(matching, key=len)).split("/")
        inner = result
        for part in path:
            inner = inner.setdefault(part, {})
        inner[last] = value
    return result


def merge_parameters(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Returns nested mappings merged recursively; values of `changes` take precedence."""
    result = dict(base)
    for key, value in changes.items():
        old = result.get(key)
        result[key] = merge_parameters(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return result
