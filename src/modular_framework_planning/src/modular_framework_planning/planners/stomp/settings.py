# SPDX-License-Identifier: BSD-3-Clause
"""STOMP parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.parameter_declarations import ParameterReader, existing_declaration

NAMESPACE = "stomp_moveit"


@dataclass(frozen=True, slots=True)
class StompSettings:
    """Parameters declared in `parameters/stomp.yaml`."""

    num_timesteps: int
    num_iterations: int
    num_iterations_after_valid: int
    num_rollouts: int
    max_rollouts: int
    exponentiated_cost_sensitivity: float
    control_cost_weight: float
    delta_t: float
    stddev: float
    num_attempts: int


def read_settings(parameters: Mapping[str, Any], group: str = "") -> StompSettings:
    """Returns the settings of a planning group.

    Args:
        parameters: Parameters of the pipeline. Values below `stomp_moveit` (MoveIt 2) override values at the top level;
            values below `stomp/GROUP/optimization` (MoveIt 1) override both.
        group: Planning group.

    Raises:
        PlanningError: Lists every invalid value.
    """
    group_parameters = (parameters.get("stomp") or {}).get(group) or {}
    merged = {**parameters, **(parameters.get(NAMESPACE) or {}), **(group_parameters.get("optimization") or {})}
    try:
        declared = existing_declaration("modular_framework_planning", "stomp")
        return StompSettings(
            *ParameterReader(declared, merged.get).values(*(item.name for item in fields(StompSettings)))
        )
    except ParameterError as error:
        raise PlanningError(ErrorCode.PLANNING_FAILED, f"parameters of STOMP: {error}") from error
