# SPDX-License-Identifier: BSD-3-Clause
"""Emulates a serial line with servos: a pseudo-terminal with a fixed path, and injected faults."""

from __future__ import annotations

import heapq
import os
import random
import select
import termios
import threading
import time
import tty
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from modular_framework_drivers.ezgripper import mx64
from modular_framework_drivers.ezgripper.gripper_servos import ticks_from_joint
from modular_framework_drivers.ezgripper.mx64 import ServoErrors
from modular_framework_testing.emulators.command_port import Command
from modular_framework_testing.emulators.dynamixel_finger import Finger
from modular_framework_testing.emulators.dynamixel_servo import BROADCAST, Instruction, PacketReader, bus_response

BAUDRATE_MARGIN = 0.03
"""Maximum relative difference of the baud rates of client and servo."""
IDLE_S = 0.01
BAUD_RATES = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}


@dataclass(slots=True)
class LineFaults:
    """Injected faults of the line.

    Attributes:
        delay_s: Delay of each status packet [s].
        garbage: Number of random bytes before each status packet.
        lose_every: n, if every n-th status packet is lost; 0 for no losses.
        corrupt_every: n, if every n-th status packet has a flipped bit; 0 for no flipped bits.
    """

    delay_s: float = 0.0
    garbage: int = 0
    lose_every: int = 0
    corrupt_every: int = 0

    def loses(self, number: int) -> bool:
        """Returns whether the status packet of a number, counted from 1, is lost."""
        return bool(self.lose_every) and number % self.lose_every == 0

    def corrupts(self, number: int) -> bool:
        """Returns whether the status packet of a number, counted from 1, has a flipped bit."""
        return bool(self.corrupt_every) and number % self.corrupt_every == 0


class DynamixelLine:
    """Emulates servos on a pseudo-terminal, and simulates the fingers, on a separate thread.

    Args:
        fingers: Fingers with their servos.
        link: Path of the symbolic link to the pseudo-terminal while the line is plugged in.
        seed: Seed of the random faults.

    Attributes:
        instructions: Number of received instructions.
    """

    def __init__(self, fingers: Sequence[Finger], link: Path, seed: int = 1) -> None:
        self.fingers, self.link, self.faults = list(fingers), link, LineFaults()
        self._random = random.Random(seed)
        self._reader = PacketReader()
        self._lock = threading.RLock()
        self._master = self._slave = -1
        self._powered = True
        self._responses: list[tuple[float, int, bytes]] = []
        self._response_count = 0
        self._stop_requested = threading.Event()
        self._thread: threading.Thread | None = None
        self.instructions = 0

    def connect(self) -> None:
        """Plugs the line in and starts the thread.

        Raises:
            OSError: The link cannot be created; the text names the path.
        """
        self.plug()
        self._thread = threading.Thread(target=self._run, name="dynamixel_line", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stops the thread and removes the link; may be called twice."""
        self._stop_requested.set()
        if self._thread is not None:
            self._thread.join(2.0)
        self.unplug()

    @property
    def commands(self) -> Mapping[str, Command]:
        """Returns the commands of the command port, by name."""
        return {
            "plug": self.plug,
            "unplug": self.unplug,
            "power_on": self.power_on,
            "power_off": self.power_off,
            "overload": self.overload,
            "heat": self.heat,
            "garbage": self.garbage,
            "delay": self.delay,
            "lose": self.lose,
            "corrupt": self.corrupt,
            "id": self.change_id,
            "object": self.place_object,
            "offer_object": self.offer_object,
            "no_object": self.remove_object,
            "clear": self.clear,
            "state": self.state,
        }

    # ---- commands ----

    def plug(self) -> None:
        """Plugs the line in."""
        with self._lock:
            if self._master >= 0:
                return
            if self.link.exists() and not self.link.is_symlink():
                raise OSError(
                    f"{self.link} exists and is not a symbolic link; choose another path for the emulated port"
                )
            self._master, self._slave = os.openpty()
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.link.unlink(missing_ok=True)
            self.link.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        """Unplugs the serial adapter: the port disappears, and the servos keep their power."""
        with self._lock:
            if self._master < 0:
                return
            self.link.unlink(missing_ok=True)
            os.close(self._master)
            os.close(self._slave)
            self._master = self._slave = -1
            self._responses.clear()
            self._reader.clear()

    def power_off(self) -> None:
        """Cuts the power of the servos, which then send nothing and have no torque."""
        with self._lock:
            self._powered = False
            for finger in self.fingers:
                finger.servo.set(mx64.TORQUE_ENABLE, 0)

    def power_on(self) -> None:
        """Restores the power of the servos."""
        with self._lock:
            for finger in self.fingers:
                finger.power_cycle()
            self._powered = True

    def overload(self) -> None:
        """Shuts the servos down with an overload error."""
        self._shut_down(ServoErrors.OVERLOAD)

    def heat(self, celsius: float) -> None:
        """Sets the temperature of the motors [degrees Celsius]."""
        with self._lock:
            for finger in self.fingers:
                finger.temperature = float(celsius)

    def garbage(self, count: int = 8) -> None:
        """Sends `count` random bytes before each status packet."""
        self.faults.garbage = int(_at_least_0("count", count))

    def delay(self, seconds: float) -> None:
        """Delays status packets [s]."""
        self.faults.delay_s = float(_at_least_0("seconds", seconds))

    def lose(self, every: int = 1) -> None:
        """Loses every n-th status packet, with n = `every`."""
        self.faults.lose_every = int(_at_least_0("every", every))

    def corrupt(self, every: int = 1) -> None:
        """Flips a bit in every n-th status packet, with n = `every`."""
        self.faults.corrupt_every = int(_at_least_0("every", every))

    def change_id(self, new: int) -> None:
        """Changes the address of the first servo."""
        with self._lock:
            self.fingers[0].servo.set(mx64.SERVO_ID, int(new))

    def place_object(self, position: float) -> None:
        """Places an object that the fingers touch at a position of the knuckle joint [rad]."""
        with self._lock:
            for finger in self.fingers:
                finger.object_opening = ticks_from_joint(position)

    def offer_object(self, position: float) -> None:
        """Places an object, as `place_object`, once the fingers have been closed and opened again."""
        with self._lock:
            for finger in self.fingers:
                finger.offered_opening = ticks_from_joint(position)

    def remove_object(self) -> None:
        """Removes the object."""
        with self._lock:
            for finger in self.fingers:
                finger.object_opening = finger.offered_opening = None

    def clear(self) -> None:
        """Ends the faults of the line."""
        self.faults = LineFaults()

    def state(self) -> str:
        """Returns the state of the servos."""
        with self._lock:
            return "; ".join(_description(finger) for finger in self.fingers)

    def _shut_down(self, errors: ServoErrors) -> None:
        with self._lock:
            for finger in self.fingers:
                finger.servo.shut_down(errors)

    # ---- the line ----

    def _run(self) -> None:
        last_s = time.monotonic()
        while not self._stop_requested.is_set():
            self._wait()
            with self._lock:
                now_s = time.monotonic()
                for finger in self.fingers:
                    finger.advance(now_s - last_s)
                last_s = now_s
                if self._master >= 0:
                    with suppress(BlockingIOError):
                        self._receive(os.read(self._master, 4096))
                    self._send(now_s)

    def _wait(self) -> None:
        with self._lock:
            due_s = self._responses[0][0] - time.monotonic() if self._responses else IDLE_S
            watched = [self._master] if self._master >= 0 else []
        with suppress(OSError, ValueError):  # the line was unplugged meanwhile
            select.select(watched, [], [], min(IDLE_S, max(0.0, due_s)))

    def _receive(self, data: bytes) -> None:
        if not self._powered or not self._baud_rates_match():
            return
        for instruction in self._reader.feed(data):
            self.instructions += 1
            response = bus_response([finger.servo for finger in self.fingers], instruction)
            if response:
                self._schedule(instruction, response)

    def _baud_rates_match(self) -> bool:
        speed = BAUD_RATES.get(termios.tcgetattr(self._slave)[5], 0)
        return all(
            abs(speed - finger.servo.baudrate) <= BAUDRATE_MARGIN * finger.servo.baudrate for finger in self.fingers
        )

    def _schedule(self, instruction: Instruction, response: bytes) -> None:
        """Schedules a status packet with the faults of the line and the transmission time."""
        self._response_count += 1
        faults = self.faults
        if faults.loses(self._response_count):
            return
        if faults.corrupts(self._response_count):
            index = self._random.randrange(2, len(response))
            response = (
                response[:index] + bytes([response[index] ^ 1 << self._random.randrange(7)]) + response[index + 1 :]
            )
        response = self._random.randbytes(faults.garbage) + response
        servo = next(
            finger.servo for finger in self.fingers if instruction.servo_id in (finger.servo.servo_id, BROADCAST)
        )
        wire_s = 10.0 * (len(instruction.parameters) + 6 + len(response)) / servo.baudrate
        due_s = time.monotonic() + wire_s + servo.get(mx64.RETURN_DELAY_TIME) * 2e-6 + faults.delay_s
        heapq.heappush(self._responses, (due_s, self._response_count, response))

    def _send(self, now_s: float) -> None:
        while self._responses and self._responses[0][0] <= now_s:
            with suppress(BlockingIOError):  # without a reader, the bytes are lost, as on a cable
                os.write(self._master, heapq.heappop(self._responses)[2])


def _at_least_0(name: str, value: float) -> float:
    if not value >= 0:
        raise ValueError(f"{name}={value}: expected a number of at least 0")
    return value


def _description(finger: Finger) -> str:
    servo = finger.servo
    return (
        f"id={servo.servo_id} opening={finger.opening:.0f} speed={finger.speed:.0f} "
        f"torque_limit={servo.get(mx64.TORQUE_LIMIT)} torque_enable={servo.get(mx64.TORQUE_ENABLE)} "
        f"torque_mode={servo.get(mx64.TORQUE_CONTROL_MODE)} "
        f"goal_torque={mx64.from_direction_word(servo.get(mx64.GOAL_TORQUE))} "
        f"temperature={finger.temperature:.1f} errors={int(servo.errors)}"
    )
