# SPDX-License-Identifier: BSD-3-Clause
"""Parsing of controller_list, and selection of controllers for the joints of a motion."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from modular_framework_planning.errors import ErrorCode, PlanningError

TRAJECTORY = "FollowJointTrajectory"
GRIPPER = "GripperCommand"
ACTION_KINDS = (TRAJECTORY, GRIPPER)
FAKE_KINDS = ("interpolate", "via points", "last point")


@dataclass(frozen=True, slots=True)
class JointTolerance:
    """Tolerances of a joint [rad or m, per s, per s^2]; 0 for the tolerance of the controller."""

    joint: str
    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0


TOLERANCE_KEYS = ("position", "velocity", "acceleration")


@dataclass(frozen=True, slots=True)
class ControllerSpec:
    """Configuration of a controller.

    Attributes:
        name: Name of the controller.
        action_ns: Namespace of the action below the name.
        kind: One of ACTION_KINDS or FAKE_KINDS.
        joints: Joints that the controller moves.
        is_default: Whether the controller is preferred among controllers of the same joints.
        is_active: Whether the controller accepts goals now.
        max_effort: Maximum effort of a gripper [N or Nm].
        command_joints: Joints whose summed positions are the goal of a gripper.
        allow_failure: Whether an aborted gripper goal counts as success, because the gripper holds an object.
        duration_scaling, duration_margin: Factor and additional time of the allowed execution time [-, s]; None for the
            values of ExecutionSettings.
        path_tolerances, goal_tolerances: Joint tolerances along the path and at the goal.
        goal_time_tolerance: Allowed delay at the goal [s].
        rate: Frequency of a fake controller [Hz].
    """

    name: str
    action_ns: str
    kind: str
    joints: tuple[str, ...]
    is_default: bool = False
    is_active: bool = True
    max_effort: float = 0.0
    command_joints: tuple[str, ...] = ()
    allow_failure: bool = False
    duration_scaling: float | None = None
    duration_margin: float | None = None
    path_tolerances: tuple[JointTolerance, ...] = ()
    goal_tolerances: tuple[JointTolerance, ...] = ()
    goal_time_tolerance: float = 0.0
    rate: float = 0.0

    @property
    def action(self) -> str:
        """Action name of the controller."""
        return f"{self.name}/{self.action_ns}" if self.action_ns else self.name


def parse_controllers(
    entries: Any, kinds: Sequence[str], default_kind: str = ""
) -> tuple[list[ControllerSpec], list[str]]:
    """Returns the valid controllers of controller_list, and a message per invalid entry.

    Args:
        entries: Value of the parameter.
        kinds: Accepted values of `type`.
        default_kind: Type of entries without `type`; empty to require `type`.
    """
    if not isinstance(entries, list):
        return [], [f"controller_list is a {type(entries).__name__}; it must be a list with name, joints and type"]
    specs: list[ControllerSpec] = []
    faults: list[str] = []
    for index, entry in enumerate(entries):
        fault = _fault(entry, kinds, default_kind)
        if fault:
            faults.append(f"controller_list[{index}]: {fault}")
            continue
        try:
            specs.append(_controller(entry, default_kind))
        except (TypeError, ValueError, KeyError) as error:
            faults.append(f"controller_list[{index}] '{entry['name']}': a value has the wrong type ({error})")
    return specs, faults


def _fault(entry: Any, kinds: Sequence[str], default_kind: str) -> str:
    if not isinstance(entry, Mapping):
        return f"is a {type(entry).__name__}; it must be a mapping with name, joints and type"
    missing = [key for key in ("name", "joints") if key not in entry]
    if missing:
        return f"has no {' and no '.join(missing)}; got {', '.join(entry)}"
    kind = str(entry.get("type", default_kind))
    if kind not in kinds:
        return f"'{entry['name']}' has type '{kind}'; allowed: {', '.join(kinds)}"
    if not isinstance(entry["joints"], list) or not entry["joints"]:
        return f"'{entry['name']}' has joints {entry['joints']!r}; it must be a list of joint names"
    if "parallel" in entry and len(entry["joints"]) != 2:
        return f"'{entry['name']}' is a parallel gripper with {len(entry['joints'])} joints; it must have two"
    return ""


def _controller(entry: Mapping[str, Any], default_kind: str) -> ControllerSpec:
    joints = tuple(str(joint) for joint in entry["joints"])
    command = joints if "parallel" in entry else (str(entry.get("command_joint", joints[0])),)
    scaling, margin = (
        None if entry.get(key) is None else float(entry[key])
        for key in ("allowed_execution_duration_scaling", "allowed_goal_duration_margin")
    )
    return ControllerSpec(
        name=str(entry["name"]),
        action_ns=str(entry.get("action_ns", "")),
        kind=str(entry.get("type", default_kind)),
        joints=joints,
        is_default=bool(entry.get("default", False)),
        max_effort=float(entry.get("max_effort", 0.0)),
        command_joints=command,
        allow_failure="allow_failure" in entry and bool(entry["allow_failure"]),
        duration_scaling=scaling,
        duration_margin=margin,
        path_tolerances=_tolerances(entry.get("path_tolerance"), joints),
        goal_tolerances=_tolerances(entry.get("goal_tolerance"), joints),
        goal_time_tolerance=float(entry.get("goal_time_tolerance", 0.0)),
        rate=float(entry.get("rate", 0.0)),
    )


def _tolerances(entry: Any, joints: tuple[str, ...]) -> tuple[JointTolerance, ...]:
    """Reads a list of tolerances with joint names, or a mapping with a value for all joints or a value per joint."""
    if not entry:
        return ()
    if isinstance(entry, list):
        return tuple(
            JointTolerance(str(item["name"]), *(float(item.get(key, 0.0)) for key in TOLERANCE_KEYS)) for item in entry
        )
    columns = [
        value if isinstance(value := entry.get(key, 0.0), list) else [value] * len(joints) for key in TOLERANCE_KEYS
    ]
    return tuple(
        JointTolerance(joint, *(float(value) for value in values))
        for joint, *values in zip(joints, *columns, strict=True)
    )


def choose_controllers(
    joints: Collection[str], controllers: Iterable[ControllerSpec], may_switch: bool = False
) -> tuple[ControllerSpec, ...]:
    """Returns controllers with disjoint joints that together move all requested joints.

    Preferred in this order: fewer controllers, default controllers, active controllers, controllers with fewer joints.

    Args:
        joints: Requested joints.
        controllers: Available controllers.
        may_switch: Whether stopped controllers can be started.

    Raises:
        PlanningError: No such selection exists; names the missing joints and the joints of each controller.
    """
    requested = set(joints)
    specs = tuple(controllers)
    candidates = [spec for spec in specs if requested & set(spec.joints) and (spec.is_active or may_switch)]
    for count in range(1, len(candidates) + 1):
        selections = [selection for selection in combinations(candidates, count) if _moves_all(selection, requested)]
        if selections:
            return min(selections, key=_cost)
    raise PlanningError(ErrorCode.CONTROL_FAILED, _reason(requested, specs, candidates))


def _moves_all(selection: Sequence[ControllerSpec], requested: set[str]) -> bool:
    moved = [joint for spec in selection for joint in spec.joints]
    return len(moved) == len(set(moved)) and requested <= set(moved)


def _cost(selection: Sequence[ControllerSpec]) -> tuple[int, int, int]:
    return (
        -sum(spec.is_default for spec in selection),
        -sum(spec.is_active for spec in selection),
        sum(len(spec.joints) for spec in selection),
    )


def _reason(requested: set[str], specs: Sequence[ControllerSpec], candidates: Sequence[ControllerSpec]) -> str:
    spec_list = (
        "; ".join(
            f"{spec.name}{'' if spec.is_active else ' (stopped)'} moves {', '.join(spec.joints)}" for spec in specs
        )
        or "none"
    )
    missing = sorted(requested - {joint for spec in specs for joint in spec.joints})
    if missing:
        return (
            f"no controller moves {', '.join(missing)}; known controllers: {spec_list}. Add a controller to the "
            "controllers file of the config package, or load a controller in the controller manager"
        )
    stopped = sorted(requested - {joint for spec in candidates for joint in spec.joints})
    if stopped:
        return (
            f"the controllers of {', '.join(stopped)} are stopped; known controllers: {spec_list}. Start a controller, "
            "or set moveit_manage_controllers"
        )
    return (
        f"the controllers of {', '.join(sorted(requested))} share joints and cannot be active at the same time; known "
        f"controllers: {spec_list}"
    )
