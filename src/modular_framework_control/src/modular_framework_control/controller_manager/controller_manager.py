# SPDX-License-Identifier: BSD-3-Clause
"""Loads, starts, updates, stops and unloads controllers on one `RobotHW`, with the rules of ros_control.

Threads that may wait (services) load and unload controllers and request switches. The control loop calls `update`,
which never waits for these threads: the tuple of controllers is replaced, and a switch is passed in one attribute.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.controller_manager.controller_parameters import parameter_faults
from modular_framework_control.controller_manager.controller_statistics import StatisticsSnapshot
from modular_framework_control.controller_manager.controller_switch import (
    LOGGER,
    ControllerState,
    LoadedController,
    Strictness,
    SwitchRequest,
    plan_switch,
)
from modular_framework_control.controller_manager.controller_types import BASE_CLASS, ControllerTypes
from modular_framework_control.controller_manager.fault_watch import FaultWatch
from modular_framework_control.hardware_interface.interfaces import ControllerInfo, InterfaceResources
from modular_framework_control.hardware_interface.joint_limits import missing_limits
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_ros.node_handle import NodeHandle, join_names
from modular_framework_ros.parameter_declarations import DeclarationError

Detach = Callable[[], None]
Attach = Callable[[str, Controller], Detach]
RESET_REASON = "time went back, or the robot was moved to a new pose"


@dataclass(frozen=True, slots=True)
class ControllerReport:
    """One line of `list_controllers`.

    Attributes:
        info: Name, type and claimed joints.
        state: State of the controller.
        failure: Reason why the manager stopped the controller, or "".
        statistics: Update times since the last start.
    """

    info: ControllerInfo
    state: ControllerState
    failure: str
    statistics: StatisticsSnapshot


def _attach_nothing(name: str, controller: Controller) -> Detach:
    del name, controller
    return lambda: None


class ControllerManager:
    """The controllers of one robot.

    Args:
        robot_hw: Initialized hardware.
        root_nh: Namespace of the robot, with each controller's parameters below the controller's name.
        types: Known controller types.
        attach: Function that opens the topics and actions of a loaded controller and returns a function to close them.
        update_wait_s: Maximum wait of a switch for the next control cycle [s of wall time].
        clock: Wall time for the statistics [s].
    """

    def __init__(
        self,
        robot_hw: RobotHW,
        root_nh: NodeHandle,
        types: ControllerTypes | None = None,
        *,
        attach: Attach = _attach_nothing,
        update_wait_s: float = 10.0,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._robot_hw = robot_hw
        self._root_nh = root_nh
        self.types = types if types is not None else ControllerTypes()
        self._attach = attach
        self._update_wait_s = update_wait_s
        self._clock = clock
        self._services = threading.RLock()
        self._slot_lock = threading.Lock()
        self._pending: SwitchRequest | None = None
        self._ended = False
        self._loaded: tuple[LoadedController, ...] = ()
        self._detach: dict[str, Detach] = {}
        self._last_time_s = float("-inf")
        self._watch = FaultWatch(robot_hw)
        unlimited = missing_limits(robot_hw)
        if unlimited:
            LOGGER.warning("no limits in robot_description or joint_limits: %s; commands are not limited", unlimited)

    @property
    def fault(self) -> str:
        """Hardware fault in the last cycle, or ""."""
        return self._watch.text

    # ---- control loop ----

    def watch_hardware(self) -> None:
        """Reads the faults of the hardware; runs in each cycle until the hardware is ready for controllers."""
        self._watch.faults(log=False)

    @property
    def moving(self) -> bool:
        """Whether a running controller executes a goal."""
        return any(entry.running and entry.controller.moving for entry in self._loaded)

    def update(
        self,
        time_s: float,
        period_s: float,
        reset_controllers: bool = False,
        reset_reason: str = RESET_REASON,
    ) -> None:
        """Updates every running controller, then executes a pending switch; never raises and never waits.

        Args:
            time_s: Time of this cycle.
            period_s: Time since the last cycle.
            reset_controllers: Whether running controllers restart first, as after a reset of the simulation; they also
                restart if time goes back.
            reset_reason: Reason for the results of goals that the restart ends.
        """
        self._robot_hw.seed_commands()
        reset = reset_controllers or time_s < self._last_time_s
        self._last_time_s = time_s
        faults = self._watch.faults()
        start_s = self._clock()
        deadline_s = start_s + period_s if period_s > 0.0 else math.inf
        for entry in self._loaded:
            if entry.state is not ControllerState.RUNNING:
                continue
            if reset:
                entry.interrupt(time_s, reset_reason)
                if entry.start(time_s):
                    continue
            if faults or entry.fault:
                entry.notify_fault(time_s, faults)
                if not entry.running:
                    continue
            try:
                entry.controller.update(time_s, period_s)
            except Exception as error:  # an error in one controller must not stop other controllers
                entry.fail(time_s, f"update() raised {type(error).__name__}: {error}")
            end_s = self._clock()
            entry.statistics.add(time_s, end_s - start_s, start_s <= deadline_s < end_s)
            start_s = end_s
        if self._pending is not None:
            self._step_switch(time_s)

    def _step_switch(self, time_s: float) -> None:
        if not self._slot_lock.acquire(blocking=False):
            return
        try:
            request = self._pending
            if request is None:
                return
            try:
                finished = request.step(self._robot_hw, time_s)
            except Exception as error:
                LOGGER.exception("switch_controller: the hardware raised")
                request.errors.append(f"hardware raised {type(error).__name__}: {error}")
                request.abort_waiting(time_s)
                finished = True
            if finished:
                self._pending = None
                request.done.set()
        finally:
            self._slot_lock.release()

    # ---- threads that may wait ----

    def load_controller(self, name: str) -> None:
        """Creates and initializes the controller with parameters below `name`.

        Raises:
            ControllerError: The controller is already loaded, the type is missing or unknown, `init` failed, or topics
                and actions cannot be opened.
        """
        with self._services:
            if any(entry.name == name for entry in self._loaded):
                raise ControllerError(f"cannot load controller '{name}': it is already loaded; unload it first")
            controller_nh = self._root_nh.child(name)
            controller_type = controller_nh.get_param("type")
            if not isinstance(controller_type, str) or not controller_type:
                where = join_names(controller_nh.namespace, "type")
                raise ControllerError(
                    f"cannot load controller '{name}': parameter {where} is {controller_type!r}; "
                    f"expected one of: {', '.join(self.types.names)}. Is the controller file loaded?"
                )
            controller = self.types.create(controller_type)
            info = ControllerInfo(name, controller_type, self._init_controller(name, controller, controller_nh))
            try:
                detach = self._attach(name, controller)
            except Exception as error:  # user code may raise anything
                _close(name, controller, lambda: None)
                raise ControllerError(
                    f"cannot load controller '{name}': opening its topics and actions raised "
                    f"{type(error).__name__}: {error}"
                ) from error
            _warn_of_unread_parameters(info, controller_nh)
            self._detach[name] = lambda: _close(name, controller, detach)
            self._loaded = (*self._loaded, LoadedController(info, controller))

    def _init_controller(
        self, name: str, controller: Controller, controller_nh: NodeHandle
    ) -> tuple[InterfaceResources, ...]:
        for interface in self._robot_hw.interfaces:
            interface.take_claims()
        try:
            main_interface = self._robot_hw.get(controller.interface_class)
            controller.robot_hw = self._robot_hw
            if controller.init(main_interface, self._root_nh, controller_nh) is not True:
                raise ControllerError("init() returned False")
        except Exception as error:  # a user's controller may raise anything
            raise ControllerError(f"cannot load controller '{name}': {error}") from error
        others = [interface for interface in self._robot_hw.interfaces if interface is not main_interface]
        claims = [
            InterfaceResources(interface.type_name, interface.take_claims()) for interface in (main_interface, *others)
        ]
        return tuple(claim for claim in claims if claim.resources or claim is claims[0])

    def unload_controller(self, name: str) -> None:
        """Unloads a controller that is not running.

        Raises:
            ControllerError: The controller is not loaded or is running.
        """
        with self._services:
            entry = next((entry for entry in self._loaded if entry.name == name), None)
            if entry is None:
                raise ControllerError(f"cannot unload controller '{name}': not loaded; loaded: {self._names()}")
            if entry.running:
                raise ControllerError(f"cannot unload controller '{name}': it is running; stop it first")
            self._loaded = tuple(other for other in self._loaded if other is not entry)
            self._detach.pop(name)()

    def switch_controller(
        self,
        start: Sequence[str],
        stop: Sequence[str],
        strictness: int = Strictness.STRICT,
        start_asap: bool = False,
        timeout_s: float = 0.0,
    ) -> None:
        """Stops and starts controllers in one control cycle, and returns when the switch is done.

        Args:
            start: Names of controllers to start.
            stop: Names of controllers to stop.
            strictness: BEST_EFFORT (1) skips impossible items, STRICT (2) refuses the switch; 0 means BEST_EFFORT.
            start_asap: Whether each controller starts as soon as the hardware is ready for it.
            timeout_s: Maximum time for the hardware to get ready [s of loop time]; 0 for no limit.

        Raises:
            ControllerError: The switch is refused by the rules or by the hardware, controllers conflict over a joint, a
                controller failed to start, or the control loop is not running.
        """
        with self._services:
            plan = plan_switch({entry.name: entry for entry in self._loaded}, start, stop, Strictness.of(strictness))
            if not plan.start and not plan.stop:
                return
            request = SwitchRequest(plan, start_asap, timeout_s)
            self._prepare(request)
            self._hand_over(request)
            if request.errors:
                raise ControllerError("; ".join(request.errors))

    def _prepare(self, request: SwitchRequest) -> None:
        """Asks the hardware whether the switch is possible."""
        try:
            conflict = self._robot_hw.check_for_conflict(request.plan.resulting)
            prepared = not conflict and self._robot_hw.prepare_switch(*request.hardware_lists)
        except Exception as error:  # a user's hardware may raise anything
            raise ControllerError(
                "cannot switch controllers: check_for_conflict() or prepare_switch() of the hardware "
                f"raised {type(error).__name__}: {error}"
            ) from error
        if conflict:
            raise ControllerError(f"cannot switch controllers: {conflict}")
        if not prepared:
            raise ControllerError("cannot switch controllers: the hardware refused to prepare for it")

    def _hand_over(self, request: SwitchRequest) -> None:
        """Passes a request to the control loop and waits until it is done, as long as the loop runs."""
        with self._slot_lock:
            if self._ended:
                raise ControllerError("cannot switch controllers: the control loop has ended; start its node again")
            self._pending = request
        last_cycles = -1
        while last_cycles != request.cycles:
            last_cycles = request.cycles
            if request.done.wait(self._update_wait_s):
                return
        with self._slot_lock:
            self._pending = None
            request.abort_waiting(self._last_time_s)
        if not request.done.is_set():
            raise ControllerError(
                f"the control loop did not carry out the switch: no cycle ran within "
                f"{self._update_wait_s:.1f} s; is the loop stopped or paused?"
            )

    def list_controllers(self) -> list[ControllerReport]:
        """Returns a report per loaded controller, in the order of loading."""
        return [
            ControllerReport(entry.info, entry.state, entry.failure, entry.statistics.snapshot())
            for entry in self._loaded
        ]

    def get_controller_by_name(self, name: str) -> Controller | None:
        """Returns a loaded controller, or None."""
        return next((entry.controller for entry in self._loaded if entry.name == name), None)

    def list_controller_types(self) -> list[tuple[str, str]]:
        """Returns known type names with their reported base class."""
        return [(name, BASE_CLASS) for name in self.types.names]

    def reload_controller_libraries(self, force_kill: bool = False) -> None:
        """Searches for controller classes again; with `force_kill`, stops and unloads all controllers first.

        Raises:
            ControllerError: Controllers are loaded, and `force_kill` is False.
        """
        with self._services:
            names = [entry.name for entry in self._loaded]
            if names and not force_kill:
                raise ControllerError(
                    f"cannot reload controller libraries: loaded controllers: {self._names()}; "
                    "unload them or set force_kill"
                )
            self.switch_controller([], names, Strictness.BEST_EFFORT)
            for name in reversed(names):
                self.unload_controller(name)
            self.types.reload()

    def stop_all(self) -> None:
        """Stops all running controllers, and refuses pending and later switches.

        The control loop must have ended. May be called twice.
        """
        with self._slot_lock:
            self._ended = True
            request, self._pending = self._pending, None
            if request is not None:
                request.errors.append("the switch was not carried out: the control loop has ended")
                request.abort_waiting(self._last_time_s)
                request.done.set()
        for entry in self._loaded:
            if entry.running:
                entry.stop(self._last_time_s)

    def close(self) -> None:
        """Stops and removes all controllers; the control loop must have ended. May be called twice."""
        with self._services:
            self.stop_all()
            self._loaded = ()
            while self._detach:
                self._detach.popitem()[1]()

    def _names(self) -> str:
        return ", ".join(entry.name for entry in self._loaded) or "none"


def _close(name: str, controller: Controller, detach: Detach) -> None:
    detach()
    try:
        controller.close()
    except Exception as error:  # a user's controller may raise anything; it is unloaded anyway
        LOGGER.exception("controller '%s': close() raised %s: %s", name, type(error).__name__, error)


def _warn_of_unread_parameters(info: ControllerInfo, controller_nh: NodeHandle) -> None:
    """Logs the parameters that a controller does not read; as in ros_control, the controller runs nevertheless."""
    try:
        faults = parameter_faults(info.type, controller_nh.get_param("") or {})
    except DeclarationError as error:
        faults = [str(error)]
    for fault in faults:
        LOGGER.warning("controller '%s' of type %s: %s; it is ignored", info.name, info.type, fault)
