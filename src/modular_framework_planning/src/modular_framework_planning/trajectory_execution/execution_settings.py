# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of trajectory execution, under MoveIt's names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any


@dataclass(frozen=True, slots=True)
class ExecutionSettings:
    """Parameters below ~trajectory_execution.

    Attributes:
        execution_duration_monitoring: whether a motion that takes too long is stopped.
        allowed_execution_duration_scaling, allowed_goal_duration_margin: too long is the planned time times the one,
            plus the other [s]; an entry of controller_list may set its own.
        execution_velocity_scaling: how many times as fast as planned motions are executed.
        allowed_start_tolerance: how far a joint may be from the first point [rad or m]; 0 switches the check off.
        joints_allowed_start_tolerance: the same for single joints.
        wait_for_trajectory_completion: whether to wait, when the controllers are done, until the joints stand still.
        controller_connection_timeout: how long a controller may take to answer [s].
    """

    execution_duration_monitoring: bool = True
    allowed_execution_duration_scaling: float = 1.1
    allowed_goal_duration_margin: float = 0.5
    execution_velocity_scaling: float = 1.0
    allowed_start_tolerance: float = 0.01
    joints_allowed_start_tolerance: Mapping[str, float] = field(default_factory=dict)
    wait_for_trajectory_completion: bool = True
    controller_connection_timeout: float = 5.0

    def start_tolerance(self, joint: str) -> float:
        """Returns the tolerance of a joint; 0 or less: any distance is allowed."""
        return self.joints_allowed_start_tolerance.get(joint, self.allowed_start_tolerance)


def parse_execution_settings(given: Mapping[str, Any]) -> tuple[ExecutionSettings, list[str]]:
    """Reads the parameters.

    Returns:
        The settings, with defaults for what is not given or not usable, and one sentence for each of the latter.
    """
    values: dict[str, Any] = {}
    faults = []
    for item in fields(ExecutionSettings):
        if item.name not in given:
            continue
        value, fault = _checked(item.name, given[item.name])
        if fault:
            faults.append(f"{item.name} is {given[item.name]!r}; needed is {fault}")
        else:
            values[item.name] = value
    return ExecutionSettings(**values), faults


def _checked(name: str, value: Any) -> tuple[Any, str]:
    """Returns the value in its type, or what was needed."""
    if name in ("execution_duration_monitoring", "wait_for_trajectory_completion"):
        return value, "" if isinstance(value, bool) else "true or false"
    if name == "joints_allowed_start_tolerance":
        usable = isinstance(value, Mapping) and all(_is_number(item) for item in value.values())
        return (dict(value), "") if usable else (None, "a mapping from joint names to numbers")
    lowest = 1e-3 if name == "execution_velocity_scaling" else 0.0
    return (float(value), "") if _is_number(value) and value >= lowest else (None, f"a number of at least {lowest:g}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
