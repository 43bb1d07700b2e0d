# SPDX-License-Identifier: BSD-3-Clause
"""A switch of controllers, checked on a thread that may wait and executed cycle by cycle in the control loop."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum, IntEnum

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.controller_manager.controller_statistics import UpdateStatistics
from modular_framework_control.hardware_interface.interfaces import ControllerInfo
from modular_framework_control.hardware_interface.robot_hw import HardwareFault, RobotHW, SwitchState

# Below rospy's logger "rosout", so that messages also reach /rosout if rospy runs.
LOGGER = logging.getLogger("rosout.controller_manager")


class ControllerState(Enum):
    """States of a loaded controller, by their names in `list_controllers`.

    A starting controller waits until the hardware is ready, and is aborted if the hardware does not become ready.
    """

    INITIALIZED = "initialized"
    RUNNING = "running"
    STOPPED = "stopped"
    WAITING = "waiting"
    ABORTED = "aborted"


class Strictness(IntEnum):
    """Handling of impossible items of a switch: skip them, or refuse the whole switch."""

    BEST_EFFORT = 1
    STRICT = 2

    @classmethod
    def of(cls, number: int) -> Strictness:
        """Returns the strictness of a request; 0 means BEST_EFFORT, as in ros_control.

        Raises:
            ControllerError: The value is unknown.
        """
        if number == 0:
            LOGGER.warning("switch_controller: strictness 0 is not defined; using BEST_EFFORT (1)")
            return cls.BEST_EFFORT
        try:
            return cls(number)
        except ValueError:
            raise ControllerError(f"unknown strictness {number}; use BEST_EFFORT (1) or STRICT (2)") from None


@dataclass(slots=True)
class LoadedController:
    """A loaded controller with its state; the control loop writes `state` and `fault`.

    Attributes:
        info: Name, type and claimed joints.
        controller: Controller instance.
        state: State of the controller.
        failure: Reason why the manager stopped the controller, or "".
        fault: Hardware fault of the last notification, or "".
        statistics: Update times.
        joints: Claimed joints of all interfaces.
    """

    info: ControllerInfo
    controller: Controller
    state: ControllerState = ControllerState.INITIALIZED
    failure: str = ""
    fault: str = ""
    statistics: UpdateStatistics = field(default_factory=UpdateStatistics)
    joints: frozenset[str] = field(init=False)

    def __post_init__(self) -> None:
        self.joints = frozenset(name for claim in self.info.claimed_resources for name in claim.resources)

    @property
    def name(self) -> str:
        return self.info.name

    @property
    def running(self) -> bool:
        return self.state is ControllerState.RUNNING

    def start(self, time_s: float) -> str:
        """Starts the controller; returns the reason of a failure, or ""."""
        try:
            self.controller.starting(time_s)
        except Exception as error:  # a user's controller may raise anything; the loop must continue
            return self.fail(time_s, f"starting() raised {type(error).__name__}: {error}")
        self.failure = self.fault = ""
        self.statistics.reset()
        self.state = ControllerState.RUNNING
        return ""

    def wait(self, time_s: float) -> str:
        """Runs one waiting cycle; returns the reason of a failure, or ""."""
        self.state = ControllerState.WAITING
        try:
            self.controller.waiting(time_s)
        except Exception as error:  # a user's controller may raise anything; the loop must continue
            return self.fail(time_s, f"waiting() raised {type(error).__name__}: {error}")
        return ""

    def abort(self, time_s: float) -> None:
        """Aborts the start; an exception in `aborting` is logged."""
        self._end(ControllerState.ABORTED, self.controller.aborting, time_s)

    def stop(self, time_s: float) -> None:
        """Stops the controller; an exception in `stopping` is logged."""
        self._end(ControllerState.STOPPED, self.controller.stopping, time_s)

    def interrupt(self, time_s: float, reason: str) -> None:
        """Stops the controller before an immediate restart; an exception in `interrupted` is logged."""
        self._end(ControllerState.STOPPED, lambda now_s: self.controller.interrupted(now_s, reason), time_s)

    def _end(self, state: ControllerState, hook: Callable[[float], None], time_s: float) -> None:
        self.state = state
        try:
            hook(time_s)
        except Exception as error:  # a user's controller may raise anything; the loop must continue
            name = "aborting" if state is ControllerState.ABORTED else "stopping"
            self.failure = f"{name}() raised {type(error).__name__}: {error}"
            LOGGER.exception("controller '%s': %s", self.name, self.failure)

    def notify_fault(self, time_s: float, faults: Sequence[HardwareFault]) -> None:
        """Notifies the controller if the faults of its joints' hardware have changed."""
        reason = "; ".join(fault.reason for fault in faults if not fault.joints.isdisjoint(self.joints))
        if reason == self.fault:
            return
        self.fault = reason
        method = "on_hardware_fault()" if reason else "on_hardware_recovered()"
        try:
            if reason:
                self.controller.on_hardware_fault(time_s, reason)
            else:
                self.controller.on_hardware_recovered(time_s)
        except Exception as error:  # a user's controller may raise anything; the loop must continue
            self.fail(time_s, f"{method} raised {type(error).__name__}: {error}")

    def fail(self, time_s: float, reason: str) -> str:
        """Stops the controller after an exception, from within the except block; returns `reason`."""
        self.failure = reason
        self.state = ControllerState.STOPPED
        LOGGER.exception("controller '%s' is stopped: %s", self.name, reason)
        try:
            self.controller.failed(time_s, reason)
        except Exception as error:
            LOGGER.exception("controller '%s': failed() raised %s: %s", self.name, type(error).__name__, error)
        return reason


@dataclass(frozen=True, slots=True)
class SwitchPlan:
    """The executable part of a request, according to the rules of STRICT or BEST_EFFORT.

    Attributes:
        start: Controllers to start.
        stop: Controllers to stop first; controllers in both tuples are restarted.
        resulting: Infos of all controllers that run afterwards.
    """

    start: tuple[LoadedController, ...]
    stop: tuple[LoadedController, ...]
    resulting: tuple[ControllerInfo, ...]


def plan_switch(
    loaded: Mapping[str, LoadedController], start: Sequence[str], stop: Sequence[str], strictness: Strictness
) -> SwitchPlan:
    """Applies the rules of STRICT and BEST_EFFORT to a request.

    A running controller in both lists is restarted. A controller in both lists that is not running cannot be stopped;
    STRICT refuses this item, and BEST_EFFORT skips it.

    Args:
        loaded: All loaded controllers by name.
        start: Names of controllers to start.
        stop: Names of controllers to stop.
        strictness: Handling of impossible items.

    Raises:
        ControllerError: The strictness is STRICT and items are impossible; the message lists all of them.
    """
    faults: list[str] = []
    accepted_stop: list[str] = []
    accepted_start: list[str] = []
    for name in dict.fromkeys(stop):
        if name not in loaded:
            faults.append(f"cannot stop '{name}': it is not loaded")
        elif not loaded[name].running:
            faults.append(f"cannot stop '{name}': it is {loaded[name].state.value}, not running")
        else:
            accepted_stop.append(name)
    for name in dict.fromkeys(start):
        if name not in loaded:
            faults.append(f"cannot start '{name}': it is not loaded")
        elif loaded[name].running and name not in accepted_stop:
            faults.append(f"cannot start '{name}': it is already running")
        else:
            accepted_start.append(name)
    if faults and strictness is Strictness.STRICT:
        names = ", ".join(sorted(loaded)) or "none"
        raise ControllerError(f"{'; '.join(faults)} (strictness STRICT; loaded controllers: {names})")
    for fault in faults:
        LOGGER.warning("switch_controller: left out: %s", fault)
    resulting = tuple(
        entry.info
        for entry in loaded.values()
        if entry.name in accepted_start or (entry.running and entry.name not in accepted_stop)
    )
    return SwitchPlan(
        tuple(loaded[name] for name in accepted_start), tuple(loaded[name] for name in accepted_stop), resulting
    )


@dataclass(slots=True)
class SwitchRequest:
    """A planned switch for the control loop to execute.

    Attributes:
        plan: Controllers to stop and to start.
        start_asap: Whether each controller starts as soon as the hardware is ready for it, instead of all together.
        timeout_s: Maximum time for the hardware to get ready [s of loop time]; 0 for no limit.
        cycles: Number of control cycles spent on the switch.
        done: Event that the loop sets at the end of the switch.
        errors: Errors, written by the loop before `done` is set.
    """

    plan: SwitchPlan
    start_asap: bool = False
    timeout_s: float = 0.0
    cycles: int = 0
    done: threading.Event = field(default_factory=threading.Event)
    errors: list[str] = field(default_factory=list)
    _start_s: float | None = None
    _waiting: list[LoadedController] = field(default_factory=list)

    @property
    def hardware_lists(self) -> tuple[list[ControllerInfo], list[ControllerInfo]]:
        """Infos of the controllers that start and that stop, without restarted controllers."""
        start, stop = self.plan.start, self.plan.stop
        return (
            [entry.info for entry in start if entry not in stop],
            [entry.info for entry in stop if entry not in start],
        )

    def step(self, robot_hw: RobotHW, time_s: float) -> bool:
        """Executes one cycle of the switch in the control loop; returns whether the switch is finished."""
        self.cycles += 1
        if self._start_s is None:
            self._begin(robot_hw, time_s)
        if self.start_asap:
            for entry in list(self._waiting):
                self._advance([entry], robot_hw.switch_result(entry.info), time_s)
        elif self._waiting:
            self._advance(list(self._waiting), robot_hw.switch_result(), time_s)
        start_s = time_s if self._start_s is None else self._start_s
        if self._waiting and 0.0 < self.timeout_s < time_s - start_s:
            names = ", ".join(entry.name for entry in self._waiting)
            self.errors.append(f"hardware was not ready within {self.timeout_s} s to start: {names}")
            self.abort_waiting(time_s)
        return not self._waiting

    def abort_waiting(self, time_s: float) -> None:
        """Aborts all waiting controllers."""
        while self._waiting:
            self._waiting.pop(0).abort(time_s)

    def _begin(self, robot_hw: RobotHW, time_s: float) -> None:
        self._start_s = time_s
        robot_hw.do_switch(*self.hardware_lists)
        for entry in self.plan.stop:
            if entry.running:
                entry.stop(time_s)
        self._waiting = list(self.plan.start)

    def _advance(self, entries: list[LoadedController], result: SwitchState, time_s: float) -> None:
        for entry in entries:
            failure = ""
            match result:
                case SwitchState.ONGOING:
                    failure = entry.wait(time_s)
                    if not failure:
                        continue
                case SwitchState.ERROR:
                    entry.abort(time_s)
                    self.errors.append(f"hardware refused to switch for '{entry.name}'")
                case SwitchState.DONE:
                    failure = entry.start(time_s)
                case _:
                    raise ValueError(f"switch_result() answered {result!r}; expected a SwitchState")
            self._waiting.remove(entry)
            if failure:
                self.errors.append(f"'{entry.name}' did not start: {failure}")
