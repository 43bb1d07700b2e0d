# SPDX-License-Identifier: BSD-3-Clause
"""Errors of the planner, with a MoveIt error code and a reason for the user."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import IntEnum

from modular_framework_planning.contacts import Contact
from modular_framework_planning.plan_statistics import PlanStatistics
from modular_framework_ros.allowed_names import nearest


class ErrorCode(IntEnum):
    """Result codes, with the values of moveit_msgs/MoveItErrorCodes."""

    SUCCESS = 1
    FAILURE = 99999
    PLANNING_FAILED = -1
    INVALID_MOTION_PLAN = -2
    MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE = -3
    CONTROL_FAILED = -4
    UNABLE_TO_AQUIRE_SENSOR_DATA = -5
    TIMED_OUT = -6
    PREEMPTED = -7
    START_STATE_IN_COLLISION = -10
    START_STATE_VIOLATES_PATH_CONSTRAINTS = -11
    GOAL_IN_COLLISION = -12
    GOAL_VIOLATES_PATH_CONSTRAINTS = -13
    GOAL_CONSTRAINTS_VIOLATED = -14
    INVALID_GROUP_NAME = -15
    INVALID_GOAL_CONSTRAINTS = -16
    INVALID_ROBOT_STATE = -17
    INVALID_LINK_NAME = -18
    INVALID_OBJECT_NAME = -19
    FRAME_TRANSFORM_FAILURE = -21
    COLLISION_CHECKING_UNAVAILABLE = -22
    ROBOT_STATE_STALE = -23
    SENSOR_INFO_STALE = -24
    COMMUNICATION_FAILURE = -25
    START_STATE_INVALID = -26
    GOAL_STATE_INVALID = -27
    UNRECOGNIZED_GOAL_TYPE = -28
    CRASH = -29
    ABORT = -30
    NO_IK_SOLUTION = -31


class PlanningError(Exception):
    """Base class of the errors of this package.

    Attributes:
        code: Error code of the response message.
        reason: Location, value found, allowed values and remedy.
        contacts: Contacts that caused the error; empty for other causes.
        statistics: Statistics of the failed plan; None if planning has not started.
    """

    def __init__(
        self,
        code: ErrorCode,
        reason: str,
        contacts: Sequence[Contact] = (),
        statistics: PlanStatistics | None = None,
    ) -> None:
        super().__init__(reason)
        self.code = code
        self.reason = reason
        self.contacts = tuple(contacts)
        self.statistics = statistics


class ModelError(PlanningError):
    """The robot description is invalid."""

    def __init__(self, reason: str) -> None:
        super().__init__(ErrorCode.FAILURE, reason)


class GeometryError(PlanningError):
    """A shape, a pose or a number in a message is invalid."""

    def __init__(self, reason: str, code: ErrorCode = ErrorCode.FAILURE) -> None:
        super().__init__(code, reason)


class UnknownNameError(PlanningError):
    """A group, joint, link, frame or object with the given name does not exist."""

    def __init__(self, code: ErrorCode, kind: str, name: str, allowed: object) -> None:
        names = sorted(str(item) for item in allowed) if isinstance(allowed, Iterable) else [str(allowed)]
        known = ", ".join(names) or "none"
        super().__init__(code, f"{kind} '{name}' does not exist; known: {known}{nearest(name, names)}")
        self.kind = kind
        self.name = name
