# SPDX-License-Identifier: BSD-3-Clause
"""Decides whether a vendor's driver is ready, and whether a driver that was ready is lost."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from modular_framework_planning.trajectory_execution.controllers import ACTION_KINDS, parse_controllers
from modular_framework_ros.allowed_names import listing, nearest

CONTROLLER_KEYS = (
    "name", "action_ns", "type", "default", "joints", "max_effort", "command_joint", "parallel", "allow_failure",
    "allowed_execution_duration_scaling", "allowed_goal_duration_margin", "path_tolerance", "goal_tolerance",
    "goal_time_tolerance",
)  # fmt: skip
"""Keys of an entry in `controller_list` whose controller is an action server."""


@dataclass(frozen=True, slots=True)
class DriverAction:
    """An action of the driver.

    Attributes:
        name: Resolved name.
        type: One of ACTION_KINDS.
        joints: Joints that the action moves.
    """

    name: str
    type: str
    joints: tuple[str, ...]

    @property
    def goal_type(self) -> str:
        """Message type of the topic `goal`."""
        return f"control_msgs/{self.type}ActionGoal"


def driver_actions(controllers: Iterable[Mapping[str, Any]]) -> tuple[DriverAction, ...]:
    """Returns the actions of the entries of `controller_list`, which have no faults.

    Relative names are in the root namespace, in which move_group runs.
    """
    specs, _ = parse_controllers(list(controllers), ACTION_KINDS)
    return tuple(DriverAction("/" + spec.action.strip("/"), spec.kind, spec.joints) for spec in specs)


def controller_list_faults(controllers: Sequence[Any], joints: Collection[str]) -> list[str]:
    """Returns the faults of `controller_list`, each with the index of its entry.

    Args:
        controllers: Value of the parameter.
        joints: Movable joints of the robot; empty if unknown.
    """
    # move_group would pass over the entries that its parser refuses
    return list(_name_faults(controllers, joints)) or parse_controllers(list(controllers), ACTION_KINDS)[1]


def _name_faults(controllers: Sequence[Any], joints: Collection[str]) -> Iterator[str]:
    """Yields missing and unknown names."""
    if not controllers:
        yield "is empty; list at least one controller of the driver with name, type and joints"
    for index, entry in enumerate(controllers):
        where = f"entry {index}"
        if not isinstance(entry, Mapping):
            yield f"{where} is {entry!r}; it must be a mapping with name, type and joints"
            continue
        for key in entry:
            if key not in CONTROLLER_KEYS:
                yield f"{where} has no key '{key}'; {listing(CONTROLLER_KEYS)}{nearest(key, CONTROLLER_KEYS)}"
        if not isinstance(entry.get("name"), str) or not entry["name"].strip("/"):
            yield f"{where}: name is {entry.get('name')!r}; it must be the name of a controller"
        if entry.get("type") not in ACTION_KINDS:
            kind = str(entry.get("type"))
            yield f"{where}: type is '{kind}'; {listing(ACTION_KINDS)}{nearest(kind, ACTION_KINDS)}"
        named = entry.get("joints")
        if not isinstance(named, list) or not named or not all(isinstance(joint, str) for joint in named):
            yield f"{where}: joints is {named!r}; it must be a list of joint names"
            continue
        for joint in named if joints else ():
            if joint not in joints:
                yield f"{where}: the robot has no joint '{joint}'; {listing(joints)}{nearest(joint, joints)}"


class DriverHealth:
    """Collects what the driver sends, and names what is missing. Times are real times [s].

    Args:
        actions: Actions of the driver.
        joint_states: Topics with joint states.
        signals: Further topics and services that must exist before the start, as text for messages.
        program_topic: Topic with the state of the robot's program; empty for none.
        silence_timeout_s: Maximum time between messages [s].
    """

    def __init__(
        self,
        actions: tuple[DriverAction, ...],
        joint_states: Iterable[str],
        signals: Iterable[str],
        program_topic: str,
        silence_timeout_s: float,
    ) -> None:
        self._joints = sorted({joint for action in actions for joint in action.joints})
        self._signals = dict.fromkeys(signals, False)
        self._program_topic, self._runs = program_topic, False
        self._timeout_s = silence_timeout_s
        # topics with the time of their latest message
        self._actions: dict[str, float | None] = {action.name: None for action in actions}
        self._states: dict[str, float | None] = dict.fromkeys(joint_states)
        self._known_joints: set[str] = set()

    def on_status(self, action: str, now_s: float) -> None:
        """Records a status message of an action server."""
        self._actions[action] = now_s

    def on_joint_states(self, topic: str, names: Iterable[str], now_s: float) -> None:
        """Records the joints in a message of joint states.

        Args:
            topic: Topic of the message.
            names: Joints in the message.
            now_s: Real time of the arrival [s].
        """
        self._states[topic] = now_s
        self._known_joints.update(names)

    def on_signal(self, signal: str) -> None:
        """Records that a further topic or service exists."""
        self._signals[signal] = True

    def on_program(self, runs: bool) -> None:
        """Records whether the robot's program runs."""
        self._runs = runs

    def missing(self, now_s: float) -> list[str]:
        """Returns a phrase for each missing item; empty if the driver works."""
        missing = [f"action {name} {_silence(s, now_s)}" for name, s in self._actions.items() if self._silent(s, now_s)]
        missing += [f"topic {name} {_silence(s, now_s)}" for name, s in self._states.items() if self._silent(s, now_s)]
        absent = [joint for joint in self._joints if joint not in self._known_joints]
        if absent and all(s is not None for s in self._states.values()):
            known = sorted(self._known_joints)
            hint = f"{listing(known, 'no joint is')}".replace("allowed:", "the topics contain")
            missing.append(f"joints {', '.join(absent)} are in none of the topics {', '.join(self._states)} ({hint})")
        if self._program_topic and not self._runs:
            missing.append(f"topic {self._program_topic} is not true")
        return missing + [f"{signal} does not exist" for signal, exists in self._signals.items() if not exists]

    def _silent(self, last_s: float | None, now_s: float) -> bool:
        return last_s is None or now_s - last_s > self._timeout_s


def _silence(last_s: float | None, now_s: float) -> str:
    return "has not answered" if last_s is None else f"has been silent for {now_s - last_s:.1f} s"
