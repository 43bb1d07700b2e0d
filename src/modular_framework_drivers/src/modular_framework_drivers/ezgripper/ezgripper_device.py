# SPDX-License-Identifier: BSD-3-Clause
"""An EZGripper that any thread can use without ever having to wait.

One thread communicates with the servos: it connects, calibrates and follows goals; after a fault it reports the reason
and connects again by itself. Other threads read the last state and write the next request. Each of the two is a single
attribute, so there is no lock that the control loop might have to wait for.
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
    with_set_point_near,
)
from modular_framework_drivers.ezgripper.gripper_settings import GripperSettings
from modular_framework_drivers.ezgripper.mx64 import MOTOR_FAULTS, TORQUE_MAX, UNWATCHED_TORQUE, WARM, ServoErrors

LOGGER = logging.getLogger("rosout.ezgripper")
SILENT_S = 1.0
"""A state older than this, plus the time a servo has for its answer, counts as lost [s]."""


SET_POINT_PERIODS = 2.0
"""Periods that a set point must last: until the next one is due, and as long again if that comes late."""


@dataclass(frozen=True, slots=True)
class GripperState:
    """State of the gripper at its last answer.

    Attributes:
        stamp_s: time of the answer on the monotonic clock [s]; minus infinity before it is calibrated.
        reading: what was measured.
        motion: state of the fingers.
        goal: the one that is followed.
        ready: whether it is calibrated and has been at its start position.
        fault: why it cannot be used at the moment; "" if it can.
        faults: number of faults so far, so that one that came and went between two reads is not missed.
        last_fault: the latest of them; "" before the first.
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
    """The last request of another thread.

    Attributes:
        goal: to follow; None to stop.
        faults: number of faults at that time; a fault that comes later cancels the request.
    """

    goal: Goal | None
    faults: int


class _Ended(Exception):
    """`close` was called."""


class EzGripper:
    """One gripper. `start`, then `state`, `command` and `stop` from any thread; `close` in the end.

    Args:
        settings: of its connection and its motions.
    """

    def __init__(self, settings: GripperSettings) -> None:
        self.settings = settings
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        first = Goal(0, settings.start_position, settings.start_torque)
        self._numbers = itertools.count(1)
        self._request = self._handled_request = _Request(first, 0)
        self._grip = Grip(settings.rules, first)
        self._bus = DynamixelBus(settings.port_name, settings.baudrate, settings.link_timeout_s)
        self._servos = GripperServos(self._bus, settings.servo_ids, self._wait)
        nothing = GripperReading(CLOSED_POSITION, 0.0, 0.0, 0.0, 0.0, ServoErrors.NONE)
        self._state = GripperState(
            -math.inf, nothing, Motion.MOVING, first, False, f"{settings.name}: not connected yet"
        )
        self._ready = False
        self._warm = False
        self._off_since_s: float | None = None

    # ---- any thread ----

    def start(self) -> None:
        """Begins to connect; returns at once. `state` has the result."""
        self._thread = threading.Thread(target=self._run, name=self.settings.name, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stops the fingers, which keep holding with little torque, and the thread; may be called twice."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(2.0)

    def state(self) -> GripperState:
        """Returns the latest state; if it is too old, it has a fault that says so."""
        state = self._state
        age_s = time.monotonic() - state.stamp_s
        if age_s > SILENT_S + self.settings.link_timeout_s and not state.fault:
            return replace(state, fault=f"{self.settings.name}: nothing heard of the servos for {age_s:.1f} s")
        return state

    def command(self, position: float, torque: int) -> int:
        """Requests a motion; ignored while there is a fault, and cancelled by a fault that comes before it is handled.

        A client that waits for its goal must therefore also watch `state().faults`: once that has changed, the goal may
        never be followed.

        Args:
            position: of the knuckle joint [rad].
            torque: largest torque [units of the servo].

        Returns:
            The number of the goal; `state().goal` has it once the goal is followed.

        Raises:
            ValueError: the position or the torque is out of its limits.
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
        """Requests a stop at the present position; an object that is held stays held."""
        self._request = _Request(None, self._state.faults)

    @property
    def stale(self) -> bool:
        """Whether the latest state is too old to judge a motion by."""
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
        except _Ended:
            self._hold_safely()
        except Exception:
            LOGGER.exception("%s: unexpected error; the gripper is out of use", self.settings.name)
            self._report("internal error, told in the log; the gripper is out of use until the node is started again")
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
            self._servos.drive(replace(drive, torque=min(drive.torque, UNWATCHED_TORQUE)))
        except BusError as error:
            LOGGER.warning("%s: %s", self.settings.name, error)

    def _wait(self, duration_s: float) -> None:
        if self._ended.wait(duration_s):
            raise _Ended

    def _connect(self) -> None:
        """Opens the serial line and brings the servos into a known state; the next cycle handles a fault of a motor."""
        self._bus.open()
        self._servos.set_up()
        known = self._servos.calibrated
        faithful = known and self._servos.find_again()
        if not known:
            self._report("calibrating", logging.INFO)
            self._servos.calibrate()
            self._follow_anew(self.settings.start_position)
        reading, now_s = self._servos.read(), time.monotonic()
        was_off, self._off_since_s = self._off_since_s is not None, None
        if reading.errors & MOTOR_FAULTS:
            self._servos.forget()
            self._follow_anew(reading.position)
            return
        if known and (was_off or not faithful):
            self._follow_anew(reading.position)
        elif known:
            self._grip.stop(reading.position)
        self._drive(reading.position, now_s)

    def _drive(self, position: float, now_s: float) -> None:
        period_s = min(max(now_s - self._state.stamp_s, self.settings.poll_period_s), self.settings.rules.stale_s)
        drive = self._grip.update(position, now_s)
        self._servos.drive(with_set_point_near(drive, position, SET_POINT_PERIODS * period_s))

    def _follow_anew(self, position: float) -> None:
        """Replaces the state machine and its goal; the new goal is `position` [rad]."""
        position = min(max(position, 0.0), CLOSED_POSITION)
        self._grip = Grip(self.settings.rules, Goal(next(self._numbers), position, self.settings.start_torque))

    def _cycle(self) -> None:
        reading, now_s = self._servos.read(), time.monotonic()
        if reading.errors & MOTOR_FAULTS:
            self._handle_motor_fault(reading, now_s)
            return
        if self.stale and self._servos.lost_power():
            raise GripperError("the servos were without power for a moment; check the power supply and its cable")
        if self._off_since_s is not None:  # the motor is on again, but has lost its torque limit
            self._off_since_s = None
            self._servos.forget()
            self._follow_anew(reading.position)
        self._warn_of_heat(reading.temperature)
        self._handle_request(reading.position, now_s)
        self._drive(reading.position, now_s)
        self._ready |= self._grip.motion is not Motion.MOVING
        self._publish(reading, now_s, "")

    def _handle_request(self, position: float, time_s: float) -> None:
        request = self._request
        if request is self._handled_request or request.faults != self._state.faults:
            return
        self._handled_request, before = request, self._grip.goal
        if request.goal is None:
            self._grip.stop(position)
        elif (request.goal.position, request.goal.torque) == (before.position, before.torque):
            self._grip.goal = request.goal
        else:
            self._grip.retarget(request.goal, position, time_s)

    def _handle_motor_fault(self, reading: GripperReading, now_s: float) -> None:
        """Publishes the fault and stops the fingers, because not every fault switches every motor off.

        After a pause it switches the torque on again, at the present position.
        """
        text = f"{self.settings.name}: {describe_errors(reading.errors, reading.temperature, reading.voltage)}"
        since_s = self._off_since_s
        if since_s is None:
            self._off_since_s = now_s
            LOGGER.error("%s", text)
        self._publish(reading, now_s, text)
        if since_s is None:
            self._servos.stay()
        elif now_s - since_s >= self.settings.fault_pause_s:
            self._off_since_s = now_s
            self._servos.forget()
            self._servos.drive(Drive(reading.position, self.settings.start_torque))

    def _warn_of_heat(self, temperature: float) -> None:
        if temperature >= WARM and not self._warm:
            LOGGER.warning(
                "%s: the motor is at %.0f degrees C, it switches itself off at 80; hold with less torque",
                self.settings.name,
                temperature,
            )
        self._warm = temperature >= WARM

    def _publish(self, reading: GripperReading, now_s: float, fault: str) -> None:
        recovered = self._state.fault and not fault
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
        if recovered:
            LOGGER.info("%s: in use", self.settings.name)

    def _report(self, problem: str, level: int = logging.ERROR) -> None:
        """Publishes a fault; logs it if it differs from the last one."""
        text = f"{self.settings.name}: {problem}"
        if text != self._state.fault:
            LOGGER.log(level, "%s", text)
        self._set_fault(self._state, text)

    def _set_fault(self, state: GripperState, fault: str) -> None:
        self._state = replace(state, fault=fault, faults=state.faults + 1, last_fault=fault)
