# SPDX-License-Identifier: BSD-3-Clause
"""Reads controller_list, and chooses controllers that cover the joints of a motion."""

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
    """Tolerances of a joint [rad or m, and their derivatives]; 0 leaves them to the controller."""

    joint: str
    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0


TOLERANCE_KEYS = ("position", "velocity", "acceleration")


@dataclass(frozen=True, slots=True)
class ControllerSpec:
    """One controller with its configuration.

    Attributes:
        kind: one of ACTION_KINDS or FAKE_KINDS.
        is_default: preferred where several controllers move the same joints.
        is_active: whether it would accept a goal now.
        command_joints: joints whose positions, added up, are the goal of a gripper.
        allow_failure: a gripper that gives up counts as done (it holds something).
        duration_scaling, duration_margin: of the time the controller may take [-, s]; None: those of all controllers.
        rate: cycles per second of a fake controller.
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
        """Name of the controller's action."""
        return f"{self.name}/{self.action_ns}" if self.action_ns else self.name


def parse_controllers(
    entries: Any, kinds: Sequence[str], default_kind: str = ""
) -> tuple[list[ControllerSpec], list[str]]:
    """Reads controller_list.

    Args:
        entries: the parameter as it came.
        kinds: values of `type` to accept.
        default_kind: for entries without a type; empty: they need one.

    Returns:
        The usable controllers, and one sentence for every entry that is not.
    """
    if not isinstance(entries, list):
        return [], [f"controller_list is a {type(entries).__name__}; needed is a list with name, joints and type"]
    specs: list[ControllerSpec] = []
    faults: list[str] = []
    for number, entry in enumerate(entries):
        fault = _fault(entry, kinds, default_kind)
        if fault:
            faults.append(f"controller_list[{number}]: {fault}")
            continue
        try:
            specs.append(_controller(entry, default_kind))
        except (TypeError, ValueError, KeyError) as error:
            faults.append(f"controller_list[{number}] '{entry['name']}': a value of the wrong kind ({error})")
    return specs, faults


def _fault(entry: Any, kinds: Sequence[str], default_kind: str) -> str:
    if not isinstance(entry, Mapping):
        return f"is a {type(entry).__name__}; needed is a mapping with name, joints and type"
    missing = [key for key in ("name", "joints") if key not in entry]
    if missing:
        return f"has no {' and no '.join(missing)}; got {', '.join(entry)}"
    kind = str(entry.get("type", default_kind))
    if kind not in kinds:
        return f"'{entry['name']}' has type '{kind}'; allowed: {', '.join(kinds)}"
    if not isinstance(entry["joints"], list) or not entry["joints"]:
        return f"'{entry['name']}' has joints {entry['joints']!r}; needed is a list of joint names"
    if "parallel" in entry and len(entry["joints"]) != 2:
        return f"'{entry['name']}' is a parallel gripper with {len(entry['joints'])} joints; it needs two"
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


def _tolerances(given: Any, joints: tuple[str, ...]) -> tuple[JointTolerance, ...]:
    """Reads a list of tolerances by joint name, or a mapping of values for all joints (one, or one a joint)."""
    if not given:
        return ()
    if isinstance(given, list):
        return tuple(
            JointTolerance(str(item["name"]), *(float(item.get(key, 0.0)) for key in TOLERANCE_KEYS)) for item in given
        )
    columns = [
        value if isinstance(value := given.get(key, 0.0), list) else [value] * len(joints) for key in TOLERANCE_KEYS
    ]
    return tuple(
        JointTolerance(joint, *(float(value) for value in values))
        for joint, *values in zip(joints, *columns, strict=True)
    )


def choose_controllers(
    joints: Collection[str], controllers: Iterable[ControllerSpec], may_switch: bool = False
) -> tuple[ControllerSpec, ...]:
    """Returns controllers that move the joints and share none of theirs.

    Few controllers are better than many, default ones than others, running ones than stopped ones, and those with few
    joints of their own than those with many.

    Args:
        joints: all that are to be moved.
        controllers: those there are.
        may_switch: stopped controllers may be chosen because they can be started.

    Raises:
        PlanningError: no such set; says which joints nobody moves and what each controller covers.
    """
    wanted = set(joints)
    known = tuple(controllers)
    useful = [spec for spec in known if wanted & set(spec.joints) and (spec.is_active or may_switch)]
    for count in range(1, len(useful) + 1):
        options = [option for option in combinations(useful, count) if _covers(option, wanted)]
        if options:
            return min(options, key=_rank)
    raise PlanningError(ErrorCode.CONTROL_FAILED, _reason(wanted, known, useful))


def _covers(option: Sequence[ControllerSpec], wanted: set[str]) -> bool:
    moved = [joint for spec in option for joint in spec.joints]
    return len(moved) == len(set(moved)) and wanted <= set(moved)


def _rank(option: Sequence[ControllerSpec]) -> tuple[int, int, int]:
    return (
        -sum(spec.is_default for spec in option),
        -sum(spec.is_active for spec in option),
        sum(len(spec.joints) for spec in option),
    )


def _reason(wanted: set[str], known: Sequence[ControllerSpec], useful: Sequence[ControllerSpec]) -> str:
    listed = (
        "; ".join(
            f"{spec.name}{'' if spec.is_active else ' (stopped)'} moves {', '.join(spec.joints)}" for spec in known
        )
        or "none"
    )
    unmoved = sorted(wanted - {joint for spec in known for joint in spec.joints})
    if unmoved:
        return (
            f"no controller moves {', '.join(unmoved)}; known controllers: {listed}. Add one to the config "
            "package's controllers file, or load one where ros_control is asked"
        )
    stopped = sorted(wanted - {joint for spec in useful for joint in spec.joints})
    if stopped:
        return (
            f"the controllers of {', '.join(stopped)} are stopped; known controllers: {listed}. Start one, or set "
            "moveit_manage_controllers"
        )
    return (
        f"controllers of {', '.join(sorted(wanted))} share joints, so no set of them can move all at a time; known "
        f"controllers: {listed}"
    )
