# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of STOMP, read and checked once."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from modular_framework_planning.errors import ErrorCode, PlanningError

NAMESPACE = "stomp_moveit"
LOWEST: dict[str, float] = {
    "num_timesteps": 5,
    "num_iterations": 1,
    "num_rollouts": 2,
    "max_rollouts": 2,
    "delta_t": 1e-6,
    "stddev": 1e-6,
    "num_attempts": 1,
}


@dataclass(frozen=True, slots=True)
class StompSettings:
    """Keys of MoveIt 2's plugin with the values of its Panda example; the last two are this planner's own.

    Attributes:
        num_timesteps: states of a motion.
        num_iterations: most iterations of an attempt; num_iterations_after_valid: of them after the first valid motion.
        num_rollouts: noisy motions of an iteration; max_rollouts: that many with the best ones of the last iteration.
        exponentiated_cost_sensitivity: how much cheaper noisy motions outweigh others, above 0.
        control_cost_weight: weight of the squared accelerations.
        delta_t: time between two states, for the accelerations [s].
        stddev: standard deviation of the noise in the middle of the motion [rad or m].
        num_attempts: starts with different goals and first guesses.
    """

    num_timesteps: int = 60
    num_iterations: int = 40
    num_iterations_after_valid: int = 0
    num_rollouts: int = 30
    max_rollouts: int = 30
    exponentiated_cost_sensitivity: float = 0.8
    control_cost_weight: float = 0.1
    delta_t: float = 0.1
    stddev: float = 0.3
    num_attempts: int = 4


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
    values: dict[str, Any] = {}
    faults = []
    for item in fields(StompSettings):
        if item.name not in given:
            continue
        value, lowest = given[item.name], LOWEST.get(item.name, 0)
        kinds = (int,) if isinstance(item.default, int) else (int, float)
        if isinstance(value, bool) or not isinstance(value, kinds) or not lowest <= value < float("inf"):
            faults.append(
                f"{item.name} is {value!r}, allowed is {'a whole number' if len(kinds) == 1 else 'a number'} "
                f"of at least {lowest}"
            )
        values[item.name] = value
    if faults:
        raise PlanningError(ErrorCode.PLANNING_FAILED, f"parameters of STOMP: {'; '.join(faults)}")
    return StompSettings(**values)
