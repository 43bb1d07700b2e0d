# SPDX-License-Identifier: BSD-3-Clause
"""Controller that reports the measured state of all joints at a fixed rate."""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from modular_framework_control.controller_interface.controller import Controller
from modular_framework_control.hardware_interface.handles import JointStateHandle
from modular_framework_control.hardware_interface.interfaces import JointStateInterface
from modular_framework_control.realtime.schedule import Schedule
from modular_framework_ros.node_handle import NodeHandle, join_names, read_names, read_number

LOGGER = logging.getLogger("rosout.joint_state_controller")
PAUSED_PERIOD_S = 0.05
"""Wall time between reports while loop time is paused [s], for nodes that start during the pause."""
STATE_KEYS = ("position", "velocity", "effort")


@dataclass(frozen=True, slots=True)
class JointStateSnapshot:
    """States of all joints in one cycle.

    Attributes:
        time_s: Time of the cycle.
        names: Joint names, extra joints last.
        positions: Joint positions [rad|m].
        velocities: Joint velocities [rad/s|m/s].
        efforts: Joint efforts [Nm|N].
    """

    time_s: float
    names: list[str]
    positions: list[float]
    velocities: list[float]
    efforts: list[float]


class JointStateController(Controller):
    """joint_state_controller/JointStateController.

    Parameters, below the controller's name: `publish_rate` [1/s] 50, 0 disables publishing; `joints`, the reported
    joints in order, by default all joints sorted by name; `extra_joints`, a list of {name, position, velocity, effort}
    reported as constants unless the hardware has the joint. As in ros_controllers, an invalid entry is logged and
    skipped.

    Attributes:
        on_state: Function called in the control loop at `publish_rate`; must not block.
    """

    interface_class = JointStateInterface

    def __init__(self) -> None:
        self.on_state: Callable[[JointStateSnapshot], None] | None = None
        self._handles: list[JointStateHandle] = []
        self._extra: list[JointStateHandle] = []
        self._clock: Callable[[], float] = time.monotonic
        self._reported_s = -math.inf
        self._next_repeat_s = 0.0

    def init(self, hw: Any, root_nh: NodeHandle, controller_nh: NodeHandle) -> bool:
        names = read_names(controller_nh, "joints") if controller_nh.has_param("joints") else sorted(hw.names)
        self._handles = [hw.get_handle(name) for name in names]
        self._schedule = Schedule(read_number(controller_nh, "publish_rate", 50.0))
        self._extra = [joint for joint in _extra_joints(controller_nh) if joint.name not in hw.names]
        self._names = [handle.name for handle in (*self._handles, *self._extra)]
        return True

    def starting(self, time_s: float) -> None:
        self._schedule.start(time_s)

    def _is_due(self, time_s: float, period_s: float) -> bool:
        """Returns whether a report is due at the fixed rate or, while loop time is paused, in wall time."""
        if self._schedule.take_if_due(time_s):
            self._reported_s = time_s
            return True
        if period_s > 0.0:
            return False
        now_s = self._clock()
        if time_s == self._reported_s and now_s < self._next_repeat_s:
            return False
        self._reported_s, self._next_repeat_s = time_s, now_s + PAUSED_PERIOD_S
        return True

    def update(self, time_s: float, period_s: float) -> None:
        if self.on_state is None or not self._is_due(time_s, period_s):
            return
        joints = (*self._handles, *self._extra)
        self.on_state(
            JointStateSnapshot(
                time_s,
                self._names,
                [joint.position for joint in joints],
                [joint.velocity for joint in joints],
                [joint.effort for joint in joints],
            )
        )


def _extra_joints(controller_nh: NodeHandle) -> list[JointStateHandle]:
    entries = controller_nh.get_param("extra_joints", [])
    where = join_names(controller_nh.namespace, "extra_joints")
    if not isinstance(entries, list):
        LOGGER.error(
            "parameter %s is ignored: got %r; expected a list of mappings with name, %s",
            where,
            entries,
            ", ".join(STATE_KEYS),
        )
        return []
    joints: dict[str, JointStateHandle] = {}
    for index, entry in enumerate(entries):
        fault = _fault_of_extra_joint(entry, joints)
        if fault:
            LOGGER.error("parameter %s: entry %d is skipped: %s", where, index, fault)
        else:
            name = entry["name"]
            joints[name] = JointStateHandle(name, *(float(entry.get(key, 0.0)) for key in STATE_KEYS))
    return list(joints.values())


def _fault_of_extra_joint(entry: Any, joints: Mapping[str, Any]) -> str:
    if not isinstance(entry, dict) or not isinstance(entry.get("name"), str) or not entry["name"]:
        return f"it is {entry!r}; expected a mapping with a name"
    if entry["name"] in joints:
        return f"joint '{entry['name']}' is repeated; name each joint once"
    values = [entry.get(key, 0.0) for key in STATE_KEYS]
    if any(isinstance(v, bool) or not isinstance(v, (int, float)) or not math.isfinite(v) for v in values):
        return f"{', '.join(STATE_KEYS)} of joint '{entry['name']}' are {values}; expected finite numbers"
    return ""
