# SPDX-License-Identifier: BSD-3-Clause
"""Output of a policy, and the checks of this output."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Mapping

import numpy as np

from mbf_method.errors import InvalidOutputError
from mbf_method.observation import GRIPPER_COLUMN, ActionSpec, Observation

LIMIT_TOLERANCE = 1e-3
"""Maximum excess of a target beyond a limit, which is clipped [rad or m]; single precision needs 1e-6."""


@dataclass(frozen=True)
class Actions:
    """Chunk of actions.

    Attributes:
        actions: Actions at the rate of the observation's `ActionSpec`, shape (horizon, a). The joint columns are target
            positions [rad or m], velocities [rad/s or m/s], or differences from the previous target [rad or m]. The
            columns of the end effector are a translation [m] and a rotation vector [rad] from the previous target. The
            gripper column is a fraction, from 0 (open) to 1 (closed). No action means that the task is done.
    """

    actions: np.ndarray


@dataclass(frozen=True)
class Targets:
    """Targets of a chunk within the limits.

    Attributes:
        values: Target positions of the columns after each action, shape (n, a) [rad or m; fraction for the gripper].
        clipped: Whether the wanted target of each action exceeded a limit, shape (n,).
        fault: First target that exceeded a limit, as text; "" if all targets respect the limits.
    """

    values: np.ndarray
    clipped: np.ndarray
    fault: str


def task_done(observation: Observation) -> Actions:
    """Returns the result of a policy that has completed its task."""
    return Actions(np.zeros((0, len(observation.actions.names))))


def checked_actions(message: Mapping[str, Any], spec: ActionSpec) -> np.ndarray:
    """Checks a result and returns its actions, shape (horizon, a); shape (0, a) if the task is done.

    Args:
        message: Fields of `Actions`, keyed by name.
        spec: Required actions.

    Raises:
        InvalidOutputError: A field name, shape or value is invalid.
    """
    if list(message) != ["actions"]:
        raise InvalidOutputError(f"the result has the fields {sorted(message)}; it must have ['actions']")
    actions, columns = message["actions"], len(spec.names)
    required = f"it must be an array of numbers of shape ({spec.horizon}, {columns}): {', '.join(spec.names)}"
    if not isinstance(actions, np.ndarray):
        raise InvalidOutputError(f"actions is a {type(actions).__name__}; {required}")
    if actions.dtype.kind not in "fiu" or actions.shape not in ((spec.horizon, columns), (0, columns)):
        raise InvalidOutputError(f"actions has shape {actions.shape} and type {actions.dtype}; {required}")
    finite = np.isfinite(actions)
    if not finite.all():
        row, column = np.argwhere(~finite)[0]
        raise InvalidOutputError(f"actions[{row}] has a {spec.names[column]} that is not finite")
    return actions.astype(np.float64)


def limited_targets(
    actions: np.ndarray, spec: ActionSpec, start: np.ndarray, before: np.ndarray | None = None
) -> Targets:
    """Converts joint actions to target positions within the position, velocity and acceleration limits.

    Velocities and accelerations are differences between successive targets.

    Args:
        actions: Checked actions, shape (n, a).
        spec: Required actions with joint columns.
        start: Target before the first action, shape (a,).
        before: Target before `start`, shape (a,); None for a start at rest.
    """
    values, clipped, fault, previous = np.zeros(actions.shape), np.zeros(len(actions), bool), "", start
    step = np.zeros(len(start)) if before is None else start - before
    reach, change = spec.max_velocity / spec.rate_hz, spec.max_acceleration / spec.rate_hz**2
    for index, action in enumerate(actions):
        wanted = _target(action, spec, previous)
        lower, upper = np.maximum(-reach, step - change), np.minimum(reach, step + change)
        reachable = np.clip(wanted, previous + lower, previous + upper)
        values[index] = np.clip(reachable, spec.lower, spec.upper)
        excess = np.abs(wanted - values[index])
        clipped[index] = excess.max() > LIMIT_TOLERANCE
        if clipped[index] and not fault:
            worst = int(np.argmax(excess))
            fault = _fault_text(index, worst, spec, (previous - step, previous, wanted))
        step, previous = values[index] - previous, values[index]
    return Targets(values, clipped, fault)


def _target(action: np.ndarray, spec: ActionSpec, previous: np.ndarray) -> np.ndarray:
    if spec.kind == "positions":
        return action
    target = previous + (action / spec.rate_hz if spec.kind == "velocities" else action)
    if spec.names[-1] == GRIPPER_COLUMN:
        target[-1] = action[-1]
    return target


def _fault_text(index: int, column: int, spec: ActionSpec, motion: tuple[np.ndarray, ...]) -> str:
    """Returns the limit that a column exceeds in a motion, given as the target before, the start and the target."""
    before, start, target = (float(positions[column]) for positions in motion)
    name, lower, upper = spec.names[column], spec.lower[column], spec.upper[column]
    if not lower - LIMIT_TOLERANCE <= target <= upper + LIMIT_TOLERANCE:
        return f"actions[{index}] moves {name} to {target:.4f}; it must be from {lower:.4f} to {upper:.4f}"
    velocity = (target - start) * spec.rate_hz
    move = f"actions[{index}] moves {name} from {start:.4f} to {target:.4f}"
    if abs(target - start) > spec.max_velocity[column] / spec.rate_hz + LIMIT_TOLERANCE:
        limit = spec.max_velocity[column]
        return f"{move} at {abs(velocity):.4f} per s; the maximum velocity is {limit:.4f} per s"
    acceleration = abs(velocity - (start - before) * spec.rate_hz) * spec.rate_hz
    limit = spec.max_acceleration[column]
    return f"{move} with {acceleration:.4f} per s^2; the maximum acceleration is {limit:.4f} per s^2"
