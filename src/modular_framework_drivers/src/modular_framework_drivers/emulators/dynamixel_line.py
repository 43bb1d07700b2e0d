# SPDX-License-Identifier: BSD-3-Clause
"""A serial line with emulated servos: a pseudo-terminal with a fixed path, and faults on command."""

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

from modular_framework_drivers.emulators.command_port import Command
from modular_framework_drivers.emulators.dynamixel_finger import Finger
from modular_framework_drivers.emulators.dynamixel_servo import BROADCAST, Instruction, PacketReader, answer_bus
from modular_framework_drivers.ezgripper import mx64
from modular_framework_drivers.ezgripper.gripper_servos import ticks_from_joint
from modular_framework_drivers.ezgripper.mx64 import ServoErrors

BAUDRATE_MARGIN = 0.03
"""Relative difference of the baud rates of the two ends up to which they can communicate."""
IDLE_S = 0.01
SPEED_NAMES = {getattr(termios, name): int(name[1:]) for name in dir(termios) if name[0] == "B" and name[1:].isdigit()}


@dataclass(slots=True)
class LineFaults:
    """Faults of the line.

    Attributes:
        delay_s: delay of each answer [s].
        garbage: random bytes before each answer.
        lose_every: every n-th answer is lost; 0 for none.
        corrupt_every: every n-th answer has a flipped bit; 0 for none.
    """

    delay_s: float = 0.0
    garbage: int = 0
    lose_every: int = 0
    corrupt_every: int = 0

    def loses(self, number: int) -> bool:
        """Whether the answer of a number, counted from 1, is lost."""
        return bool(self.lose_every) and number % self.lose_every == 0

    def corrupts(self, number: int) -> bool:
        """Whether it has a flipped bit."""
        return bool(self.corrupt_every) and number % self.corrupt_every == 0


class DynamixelLine:
    """Servos behind a pseudo-terminal; answers, and lets time pass for the fingers, on a thread of its own.

    Args:
        fingers: the servos and what they move.
        link: path that leads to the pseudo-terminal while the line is plugged in.
        seed: of the faults' random numbers.
    """

    def __init__(self, fingers: Sequence[Finger], link: Path, seed: int = 1) -> None:
        self.fingers, self.link, self.faults = list(fingers), link, LineFaults()
        self._random = random.Random(seed)
        self._reader = PacketReader()
        self._lock = threading.RLock()
        self._master = self._slave = -1
        self._powered = True
        self._answers: list[tuple[float, int, bytes]] = []
        self._answered = 0
        self._ended = threading.Event()
        self._thread: threading.Thread | None = None
        self.instructions = 0

    def connect(self) -> None:
        """Plug the line in and start to answer.

        Raises:
            OSError: the link cannot be made; its text names the path.
        """
        self.plug()
        self._thread = threading.Thread(target=self._run, name="dynamixel_line", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop, and take the link away. May be called twice."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join(2.0)
        self.unplug()

    @property
    def commands(self) -> Mapping[str, Command]:
        """The commands of the command port."""
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
                raise OSError(f"{self.link} exists and is no link; choose another path for the emulated port")
            self._master, self._slave = os.openpty()
            tty.setraw(self._slave)
            os.set_blocking(self._master, False)
            self.link.unlink(missing_ok=True)
            self.link.symlink_to(os.ttyname(self._slave))

    def unplug(self) -> None:
        """Pulls the plug of the serial adapter: the port is gone; the servos keep their power."""
        with self._lock:
            if self._master < 0:
                return
            self.link.unlink(missing_ok=True)
            os.close(self._master)
            os.close(self._slave)
            self._master = self._slave = -1
            self._answers.clear()
            self._reader.clear()

    def power_off(self) -> None:
        """Takes the servos' power: they are silent and limp."""
        with self._lock:
            self._powered = False
            for finger in self.fingers:
                finger.servo.set(mx64.TORQUE_ENABLE, 0)

    def power_on(self) -> None:
        """Gives the servos their power again."""
        with self._lock:
            for finger in self.fingers:
                finger.power_cycle()
            self._powered = True

    def overload(self) -> None:
        """Makes the servos shut down with an overload error."""
        self._shut_down(ServoErrors.OVERLOAD)

    def heat(self, celsius: float) -> None:
        """Sets the temperature of the motors."""
        with self._lock:
            for finger in self.fingers:
                finger.temperature = float(celsius)

    def garbage(self, count: int = 8) -> None:
        """Puts so many random bytes before each answer."""
        self.faults.garbage = int(_at_least_0("count", count))

    def delay(self, seconds: float) -> None:
        """Makes answers late."""
        self.faults.delay_s = float(_at_least_0("seconds", seconds))

    def lose(self, every: int = 1) -> None:
        """Loses each so manieth answer."""
        self.faults.lose_every = int(_at_least_0("every", every))

    def corrupt(self, every: int = 1) -> None:
        """Flips a bit in each so manieth answer."""
        self.faults.corrupt_every = int(_at_least_0("every", every))

    def change_id(self, new: int) -> None:
        """Gives the first servo another id."""
        with self._lock:
            self.fingers[0].servo.set(mx64.SERVO_ID, int(new))

    def place_object(self, position: float) -> None:
        """Puts an object between the fingers that they meet at a position of the knuckle joint [rad]."""
        with self._lock:
            for finger in self.fingers:
                finger.object_opening = ticks_from_joint(position)

    def offer_object(self, position: float) -> None:
        """Puts an object between the fingers as soon as they have been shut once, and are open."""
        with self._lock:
            for finger in self.fingers:
                finger.offered_opening = ticks_from_joint(position)

    def remove_object(self) -> None:
        """Takes the object away."""
        with self._lock:
            for finger in self.fingers:
                finger.object_opening = finger.offered_opening = None

    def clear(self) -> None:
        """Ends the faults of the line."""
        self.faults = LineFaults()

    def state(self) -> str:
        """State of the servos."""
        with self._lock:
            return "; ".join(_describe(finger) for finger in self.fingers)

    def _shut_down(self, errors: ServoErrors) -> None:
        with self._lock:
            for finger in self.fingers:
                finger.servo.shut_down(errors)

    # ---- the line ----

    def _run(self) -> None:
        last_s = time.monotonic()
        while not self._ended.is_set():
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
            due_s = self._answers[0][0] - time.monotonic() if self._answers else IDLE_S
            watched = [self._master] if self._master >= 0 else []
        with suppress(OSError, ValueError):  # unplugged meanwhile
            select.select(watched, [], [], min(IDLE_S, max(0.0, due_s)))

    def _receive(self, data: bytes) -> None:
        if not self._powered or not self._same_speed():
            return
        for instruction in self._reader.feed(data):
            self.instructions += 1
            answer = answer_bus([finger.servo for finger in self.fingers], instruction)
            if answer:
                self._schedule(instruction, answer)

    def _same_speed(self) -> bool:
        speed = SPEED_NAMES.get(termios.tcgetattr(self._slave)[5], 0)
        return all(
            abs(speed - finger.servo.baudrate) <= BAUDRATE_MARGIN * finger.servo.baudrate for finger in self.fingers
        )

    def _schedule(self, instruction: Instruction, answer: bytes) -> None:
        """Put an answer on the line, with its faults and after the time it takes on the wire."""
        self._answered += 1
        faults = self.faults
        if faults.loses(self._answered):
            return
        if faults.corrupts(self._answered):
            index = self._random.randrange(2, len(answer))
            answer = answer[:index] + bytes([answer[index] ^ 1 << self._random.randrange(7)]) + answer[index + 1 :]
        answer = self._random.randbytes(faults.garbage) + answer
        servo = next(
            finger.servo for finger in self.fingers if instruction.servo_id in (finger.servo.servo_id, BROADCAST)
        )
        wire_s = 10.0 * (len(instruction.parameters) + 6 + len(answer)) / servo.baudrate
        due_s = time.monotonic() + wire_s + servo.get(mx64.RETURN_DELAY_TIME) * 2e-6 + faults.delay_s
        heapq.heappush(self._answers, (due_s, self._answered, answer))

    def _send(self, now_s: float) -> None:
        while self._answers and self._answers[0][0] <= now_s:
            with suppress(BlockingIOError):  # without a reader the bytes are lost, as on a wire
                os.write(self._master, heapq.heappop(self._answers)[2])


def _at_least_0(name: str, value: float) -> float:
    if not value >= 0:
        raise ValueError(f"{name}={value}: expected a number of at least 0")
    return value


def _describe(finger: Finger) -> str:
    servo = finger.servo
    return (
        f"id={servo.servo_id} opening={finger.opening:.0f} speed={finger.speed:.0f} "
        f"torque_limit={servo.get(mx64.TORQUE_LIMIT)} torque_enable={servo.get(mx64.TORQUE_ENABLE)} "
        f"torque_mode={servo.get(mx64.TORQUE_CONTROL_MODE)} "
        f"goal_torque={mx64.from_direction_word(servo.get(mx64.GOAL_TORQUE))} "
        f"temperature={finger.temperature:.1f} errors={int(servo.errors)}"
    )
