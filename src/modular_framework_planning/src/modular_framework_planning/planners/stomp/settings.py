# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of STOMP, read and checked once."""

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
    """Parameters as `parameters/stomp.yaml` declares them."""

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
    """Reads the parameters of the pipeline.

    Args:
        parameters: from their own level, then below `stomp_moveit` (MoveIt 2), then below `stomp/GROUP/optimization`
            (MoveIt 1); later ones count.
        group: planning group.

    Raises:
        PlanningError: lists every value that is not allowed.
    """
    of_group = (parameters.get("stomp") or {}).get(group) or {}
    given = {**parameters, **(parameters.get(NAMESPACE) or {}), **(of_group.get("optimization") or {})}
    try:
        declared = existing_declaration("modular_framework_planning", "stomp")
        return StompSettings(
            *ParameterReader(declared, given.get).values(*(item.name for item in fields(StompSettings)))
        )
    except ParameterError as error:
        raise PlanningError(ErrorCode.PLANNING_FAILED, f"parameters of STOMP: {error}") from error
