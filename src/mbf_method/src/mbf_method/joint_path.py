# SPDX-License-Identifier: BSD-3-Clause
"""Output of a planner, and the checks of this output."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Mapping

import numpy as np

from mbf_method.errors import InvalidOutputError
from mbf_method.path_request import PathRequest

END_TOLERANCE = 1e-3
"""Maximum distance of a joint from start or goal, and beyond its limits [rad or m]; single precision needs 1e-6."""


@dataclass(frozen=True)
class JointPath:
    """Path in joint space, straight between its points.

    Attributes:
        positions: Joint vectors in the order of `PathRequest.joint_names`, shape (n, j) [rad or m]. The first is the
            start and the last is one of the goals. No joint vector means that the planner found no path.
    """

    positions: np.ndarray


def no_path(request: PathRequest) -> JointPath:
    """Returns the result of a planner that found no path."""
    return JointPath(np.zeros((0, len(request.joint_names))))


def checked_path(message: Mapping[str, Any], request: PathRequest, max_points: int) -> np.ndarray:
    """Checks a result and returns its joint vectors with the exact start and goal, shape (n, j) [rad or m].

    Args:
        message: Fields of `JointPath`, keyed by name.
        request: Request to which the result belongs.
        max_points: Maximum number of joint vectors.

    Raises:
        InvalidOutputError: A field name, shape or value is invalid; the message lists all faults.
    """
    if list(message) != ["positions"]:
        raise InvalidOutputError(f"the result has the fields {sorted(message)}; it must have ['positions']")
    positions, joints = message["positions"], len(request.joint_names)
    required = f"it must be an array of numbers of shape (n, {joints})"
    if not isinstance(positions, np.ndarray):
        raise InvalidOutputError(f"positions is a {type(positions).__name__}; {required}")
    if positions.dtype.kind not in "fiu" or positions.ndim != 2 or positions.shape[1] != joints:
        raise InvalidOutputError(f"positions has shape {positions.shape} and type {positions.dtype}; {required}")
    if len(positions) > max_points:
        raise InvalidOutputError(f"the path has {len(positions)} points; at most {max_points} are allowed")
    finite = np.isfinite(positions).all(axis=1)
    if not finite.all():
        raise InvalidOutputError(f"positions[{np.argmin(finite)}] is not finite; all values must be finite")
    path = positions.astype(np.float64)
    faults = _value_faults(path, request) if len(path) else []
    if faults:
        raise InvalidOutputError("; ".join(faults))
    if len(path):
        path = np.clip(path, request.lower, request.upper)
        path[-1] = request.goals[_nearest_goal(path, request)]
        path[0] = request.start
    return path


def _nearest_goal(path: np.ndarray, request: PathRequest) -> int:
    return int(np.argmin(np.abs(request.goals - path[-1]).max(axis=1)))


def _value_faults(path: np.ndarray, request: PathRequest) -> list[str]:
    goal = request.goals[_nearest_goal(path, request)]
    faults = []
    for name, point, required in (("positions[0]", path[0], request.start), ("positions[-1]", path[-1], goal)):
        end, worst = "start" if name == "positions[0]" else "nearest goal", int(np.argmax(np.abs(point - required)))
        if abs(point[worst] - required[worst]) > END_TOLERANCE:
            faults.append(
                f"{name} has {request.joint_names[worst]} at {point[worst]:.4f}, the {end} at {required[worst]:.4f}; "
                f"the path must reach the {end} within {END_TOLERANCE:g}"
            )
    outside = np.maximum(request.lower - path, path - request.upper)
    row, column = np.unravel_index(int(np.argmax(outside)), outside.shape)
    if outside[row, column] > END_TOLERANCE:
        faults.append(
            f"positions[{row}] has {request.joint_names[column]} at {path[row, column]:.4f}; it must be from "
            f"{request.lower[column]:.4f} to {request.upper[column]:.4f}"
        )
    return faults
