# SPDX-License-Identifier: BSD-3-Clause
"""Provides an EZGripper to several threads without locks.

One thread communicates with the servos: it connects, calibrates and follows goals; after a fault, it reports the cause
and reconnects. Other threads read the last state and write the next request. State and request are single attributes,
so the control loop never waits for a lock.
"""

from __future__ import annotations

import itertools
import logging
import math
import threading
import time
from dataclasses import dataclass, replace

from modular_framework_drivers.ezgripper.dynamixel_bus import BusError, DynamixelBus
from modular_framework_drivers.ezgripper.grip import Drive, Goal, Grip, Motion
from modular_framework_drivers.ezgripper.gripper_servos import (
    CLOSED_POSITION,
    GripperError,
    GripperReading,
    GripperServos,
    describe_errors,
    limit_set_point_distance,
)
from modular_framework_drivers.ezgripper.gripper_settings import GripperSettings
from modular_framework_drivers.ezgripper.mx64 import (
    MOTOR_FAULTS,
    SUSTAINED_TORQUE,
    TORQUE_MAX,
    WARNING_TEMPERATURE,
    ServoErrors,
)

LOGGER = logging.getLogger("rosout.ezgripper")
MAX_STATE_AGE_S = 1.0
"""Maximum age of the state, besides the timeout of a response, before the connection counts as lost [s]."""


SET_POINT_PERIODS = 2.0
"""Number of periods that a set point must last: until the next set point, and one period for its delay."""


@dataclass(frozen=True, slots=True)
class GripperState:
    """Holds the state of the gripper at its last response.

    Attributes:
        stamp_s: Time of the response on the monotonic clock [s]; minus infinity before the calibration.
        reading: Measurements of the gripper.
        motion: State of the fingers.
        goal: Current goal.
        ready: Whether the gripper is calibrated and has reached its start position.
        fault: Current fault; "" if there is none.
        faults: Number of faults so far, which reveals a short fault between two reads.
        last_fault: Latest fault; "" before the first fault.
    """

    stamp_s: float
    reading: GripperReading
    motion: Motion
    goal: Goal
    ready: bool
    fault: str
    faults: int = 0
    last_fault: str = ""


@dataclass(frozen=True, slots=True)
class _Request:
    """Holds the last request of another thread.

    Attributes:
        goal: Goal to follow; None for a stop.
        faults: Number of faults at the time of the request; a later fault cancels the request.
    """

    goal: Goal | None
    faults: int


class _DeviceClosed(Exception):
    """Raised on the gripper's thread after a call of `close`."""


class EzGripper:
    """Controls one gripper: after `start`, any thread may call `state`, `command` and `stop`, until `close`.

    Args:
        settings: Settings of the gripper.
    """

    def __init__(self, settings: GripperSettings) -> None:
        self.settings = settings
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        initial_goal = Goal(0, settings.start_position, settings.start_torque)
        self._numbers = itertools.count(1)
        self._request = self._handled_request = _Request(initial_goal, 0)
        self._grip = Grip(settings.rules, initial_goal)
        self._bus = DynamixelBus(settings.port_name, settings.baudrate, settings.link_timeout_s)
        self._servos = GripperServos(self._bus, settings.servo_ids, self._wait)
        no_reading = GripperReading(CLOSED_POSITION, 0.0, 0.0, 0.0, 0.0, ServoErrors.NONE)
        self._state = GripperState(
            -math.inf, no_reading, Motion.MOVING, initial_goal, False, f"{settings.name}: not connected yet"
        )
        self._ready = False
        self._is_hot = False
        self._off_since_s: float | None = None

    # ---- any thread ----

    def start(self) -> None:
        """Starts the thread that connects to the gripper; `state` reports the result."""
        self._thread = threading.Thread(target=self._run, name=self.settings.name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stops the fingers, which keep holding with a low torque, and ends the thread; may be called twice."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(2.0)

    def state(self) -> GripperState:
        """Returns the latest state, with a fault if the state is too old."""
        state = self._state
        age_s = time.monotonic() - state.stamp_s
        if age_s > MAX_STATE_AGE_S + self.settings.link_timeout_s and not state.fault:
            return replace(state, fault=f"{self.settings.name}: no response of the servos for {age_s:.1f} s")
        return state

    def command(self, position: float, torque: int) -> int:
        """Requests a motion; the request is ignored during a fault, and cancelled by a fault before the motion starts.

        Therefore, a client that waits for its goal must also watch `state().faults`: after a change, the goal may never
        be followed.

        Args:
            position: Goal position of the knuckle joint [rad].
            torque: Maximum torque [servo units].

        Returns:
            The number of the goal, which `state().goal` has once the motion has started.

        Raises:
            ValueError: If the position or the torque is outside its limits.
        """
        if not 0.0 <= position <= CLOSED_POSITION:
            raise ValueError(f"{self.settings.name}: position {position} rad is outside [0, {CLOSED_POSITION}]")
        if not 0 <= torque <= TORQUE_MAX:
            raise ValueError(f"{self.settings.name}: torque {torque} is outside [0, {TORQUE_MAX}]")
        state, goal = self._state, Goal(next(self._numbers), position, torque)
        if not state.fault:
            self._request = _Request(goal, state.faults)
        return goal.number

    def stop(self) -> None:
        """Requests a stop at the current position; the fingers keep holding an object."""
        self._request = _Request(None, self._state.faults)

    @property
    def stale(self) -> bool:
        """Returns whether the latest state is too old to monitor a motion."""
        return time.monotonic() - self._state.stamp_s > self.settings.rules.stale_s

    # ---- the gripper's thread ----

    def _run(self) -> None:
        try:
            while True:
                try:
                    self._connect()
                    while True:
                        begun_s = time.monotonic()
                        self._cycle()
                        self._wait(max(0.0, self.settings.poll_period_s - (time.monotonic() - begun_s)))
                except (BusError, GripperError) as error:
                    self._report(str(error))
                    self._bus.close()
                    self._wait(self.settings.reconnect_period_s)
        except _DeviceClosed:
            self._hold_safely()
        except Exception:
            LOGGER.exception("%s: unexpected error; the gripper cannot be used", self.settings.name)
            self._report("internal error; see the log; the gripper cannot be used until the node is restarted")
        finally:
            self._bus.close()

    def _hold_safely(self) -> None:
        """Stops the fingers with a torque that the motor can sustain without supervision."""
        if not self._ready or self._state.fault:
            return
        try:
            position = self._servos.read().position
            self._grip.stop(position)
            drive = self._grip.update(position, time.monotonic())
            self._servos.drive(replace(drive, torque=min(drive.torque, SUSTAINED_TORQUE)))
        except BusError as error:
            LOGGER.warning("%s: %s", self.settings.name, error)

    def _wait(self, duration_s: float) -> None:
        if self._ended.wait(duration_s):
            raise _DeviceClosed

    def _connect(self) -> None:
        """Opens the serial line and initialises the servos; the next cycle handles a motor fault."""
        self._bus.open()
        self._servos.set_up()
        was_calibrated = self._servos.is_calibrated
        unchanged = was_calibrated and self._servos.restore_zeros()
        if not was_calibrated:
            self._report("calibrating", logging.INFO)
            self._servos.calibrate()
            self._restart_at(self.settings.start_position)
        reading, now_s = self._servos.read(), time.monotonic()
        was_off, self._off_since_s = self._off_since_s is not None, None
        if reading.errors & MOTOR_FAULTS:
            self._servos.clear_written()
            self._restart_at(reading.position)
            return
        if was_calibrated and (was_off or not unchanged):
            self._restart_at(reading.position)
        elif was_calibrated:
            self._grip.stop(reading.position)
        self._drive(reading.position, now_s)

    def _drive(self, position: float, now_s: float) -> None:
        period_s = min(max(now_s - self._state.stamp_s, self.settings.poll_period_s), self.settings.rules.stale_s)
        drive = self._grip.update(position, now_s)
        self._servos.drive(limit_set_point_distance(drive, position, SET_POINT_PERIODS * period_s))

    def _restart_at(self, position: float) -> None:
        """Restarts the state machine with the goal `position` [rad]."""
        position = min(max(position, 0.0), CLOSED_POSITION)
        self._grip = Grip(self.settings.rules, Goal(next(self._numbers), position, self.settings.start_torque))

    def _cycle(self) -> None:
        reading, now_s = self._servos.read(), time.monotonic()
        if reading.errors & MOTOR_FAULTS:
            self._handle_motor_fault(reading, now_s)
            return
        if self.stale and self._servos.lost_power():
            raise GripperError("the servos lost power for a moment; check the power supply and its cable")
        if self._off_since_s is not None:  # the motor is on again but has lost its torque limit
            self._off_since_s = None
            self._servos.clear_written()
            self._restart_at(reading.position)
        self._warn_if_hot(reading.temperature)
        self._handle_request(reading.position, now_s)
        self._drive(reading.position, now_s)
        self._ready |= self._grip.motion is not Motion.MOVING
        self._publish(reading, now_s, "")

    def _handle_request(self, position: float, time_s: float) -> None:
        request = self._request
        if request is self._handled_request or request.faults != self._state.faults:
            return
        self._handled_request, previous_goal = request, self._grip.goal
        if request.goal is None:
            self._grip.stop(position)
        elif (request.goal.position, request.goal.torque) == (previous_goal.position, previous_goal.torque):
            self._grip.goal = request.goal
        else:
            self._grip.retarget(request.goal, position, time_s)

    def _handle_motor_fault(self, reading: GripperReading, now_s: float) -> None:
        """Publishes the fault and stops the fingers, because not every fault switches off every motor.

        After a pause, the torque is enabled again at the current position.
        """
        text = f"{self.settings.name}: {describe_errors(reading.errors, reading.temperature, reading.voltage)}"
        since_s = self._off_since_s
        if since_s is None:
            self._off_since_s = now_s
            LOGGER.error("%s", text)
        self._publish(reading, now_s, text)
        if since_s is None:
            self._servos.hold_position()
        elif now_s - since_s >= self.settings.fault_pause_s:
            self._off_since_s = now_s
            self._servos.clear_written()
            self._servos.drive(Drive(reading.position, self.settings.start_torque))

    def _warn_if_hot(self, temperature: float) -> None:
        if temperature >= WARNING_TEMPERATURE and not self._is_hot:
            LOGGER.warning(
                "%s: the motor has %.0f degrees C and switches itself off at 80; hold with a lower torque",
                self.settings.name,
                temperature,
            )
        self._is_hot = temperature >= WARNING_TEMPERATURE

    def _publish(self, reading: GripperReading, now_s: float, fault: str) -> None:
        has_recovered = self._state.fault and not fault
        state = replace(
            self._state,
            stamp_s=now_s,
            reading=reading,
            motion=self._grip.motion,
            goal=self._grip.goal,
            ready=self._ready,
            fault="",
        )
        if fault:
            self._set_fault(state, fault)
        else:
            self._state = state
        if has_recovered:
            LOGGER.info("%s: fault cleared", self.settings.name)

    def _report(self, problem: str, level: int = logging.ERROR) -> None:
        """Publishes a fault, and logs a fault that differs from the last fault."""
        text = f"{self.settings.name}: {problem}"
        if text != self._state.fault:
            LOGGER.log(level, "%s", text)
        self._set_fault(self._state, text)

    def _set_fault(self, state: GripperState, fault: str) -> None:
        self._state = replace(state, fault=fault, faults=state.faults + 1, last_fault=fault)
