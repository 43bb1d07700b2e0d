# SPDX-License-Identifier: BSD-3-Clause
"""Reads and writes the registers of Dynamixel servos over a serial line, through the maker's dynamixel-sdk.

What the SDK leaves open is closed here: it waits without burning the processor, a lost or damaged packet is tried
again, an answer of the wrong length is no answer, and every failure is an exception that says what to look at.
"""
from __future__ import annotations

import errno
import os
import select
import termios
import time
from typing import Any

import serial
from dynamixel_sdk import COMM_RX_CORRUPT, COMM_RX_TIMEOUT, COMM_SUCCESS, PacketHandler, PortHandler

from modular_framework_drivers.ezgripper.mx64 import MODEL_NUMBER, Register, ServoErrors, from_bytes

READ, WRITE = 2, 3
WRITE_TIMEOUT_S = 0.5
LATE_S = 0.1
"""An answer that comes later than this does not come [s]."""
LEAST_TRIES = 3
BAUDRATES = (9600, 19200, 57600, 115200, 500000, 1000000, 2000000, 3000000)
BUS_ERRORS = ServoErrors.CHECKSUM | ServoErrors.INSTRUCTION | ServoErrors.RANGE | ServoErrors.ANGLE_LIMIT


class BusError(Exception):
    """The servos cannot be talked to; the text names port, servo and what to look at."""


class PortLostError(BusError):
    """The serial port is not there (any more), or belongs to somebody else."""


class NoAnswerError(BusError):
    """A servo does not answer, or not in words that can be understood."""


class RefusedError(BusError):
    """A servo answers that it does not accept an instruction."""


class _Port(PortHandler):  # type: ignore[misc]
    """The SDK's port, but it sleeps while it waits for bytes, on a clock that nobody sets."""

    def setupPort(self, cflag_baud: int) -> bool:  # noqa: N802 (the SDK's name)
        self.ser = serial.Serial(self.port_name, cflag_baud, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True)
        self.is_open = True
        self.tx_time_per_byte = 1000.0 / cflag_baud * 10.0
        return True

    def getCurrentTime(self) -> float:  # noqa: N802
        return time.monotonic() * 1e3

    def readPort(self, length: int) -> bytes:  # noqa: N802
        left_s = (self.packet_timeout - self.getTimeSinceStart()) / 1e3
        if left_s > 0.0 and not self.ser.in_waiting:
            select.select([self.ser.fileno()], [], [], left_s)
        return bytes(self.ser.read(length))


class DynamixelBus:
    """Servos on one serial line. Not for several threads at once.

    Args:
        port_name: serial port, for example /dev/ttyUSB0.
        baudrate: [bit/s].
        timeout_s: a servo that has not answered for so long, and not to three tries, counts as silent [s].
    """

    def __init__(self, port_name: str, baudrate: int, timeout_s: float = 0.1) -> None:
        if baudrate not in BAUDRATES:
            raise ValueError(f"baudrate: got {baudrate}; expected one of {', '.join(map(str, BAUDRATES))}")
        self._name, self._baudrate, self._timeout_s = port_name, baudrate, timeout_s
        self._packets: Any = PacketHandler(1.0)
        self._port: _Port | None = None
        self.retries = 0

    def open(self) -> None:
        """Open the port.

        Raises:
            PortLostError: it is not there, not allowed, or taken.
        """
        self.close()
        port = _Port(self._name)
        try:
            port.setBaudRate(self._baudrate)
        except (OSError, termios.error) as error:
            raise PortLostError(f"port {self._name} cannot be opened: {_reason(error)}; check the cable, the name and "
                                "the right to use it, and that no other program has it") from error
        self._port = port

    def close(self) -> None:
        """Close the port. May be called twice."""
        port, self._port = self._port, None
        if port is not None:
            port.closePort()

    def model_number(self, servo_id: int) -> int:
        """The model of a servo; the way to find out whether it is there."""
        return from_bytes(self.read(servo_id, MODEL_NUMBER)[0])

    def read(self, servo_id: int, register: Register) -> tuple[bytes, ServoErrors]:
        """Read a register.

        Returns:
            Its bytes, and the error bits that came with them.

        Raises:
            BusError: port gone, no answer, or refused.
        """
        return self._transact(servo_id, READ, [register.address, register.size], register.size, register.name)

    def write(self, servo_id: int, register: Register, value: int) -> ServoErrors:
        """Write a word to a register.

        Args:
            servo_id: which servo.
            register: where.
            value: what; negative words of two bytes are two's complement.

        Returns:
            The error bits of the answer.

        Raises:
            BusError: port gone, no answer, or refused.
        """
        data = (value % (1 << 8 * register.size)).to_bytes(register.size, "little")
        what = f"{register.name} := {value}"
        return self._transact(servo_id, WRITE, [register.address, *data], 0, what)[1]

    def _transact(self, servo_id: int, instruction: int, parameters: list[int], size: int,
                  what: str) -> tuple[bytes, ServoErrors]:
        """Send one instruction until it is answered; the answer has `size` bytes."""
        if self._port is None:
            raise PortLostError(f"port {self._name} is not open")
        damaged, silent, errors = False, 0, ServoErrors.NONE
        tries, begun_s = 0, time.monotonic()
        while tries < LEAST_TRIES or time.monotonic() - begun_s < self._timeout_s:
            self.retries += tries > 0
            tries += 1
            packet = [0, 0, servo_id, len(parameters) + 2, instruction, *parameters, 0]
            try:
                sent_s = time.monotonic()
                answer, result, bits = self._packets.txRxPacket(self._port, packet)
                silent += result == COMM_RX_TIMEOUT
                if silent and result == COMM_SUCCESS:
                    self._let_pass(self._port, silent * (size + 6), sent_s + LATE_S)
            except (OSError, termios.error) as error:
                self.close()
                raise PortLostError(f"port {self._name} is gone: {_reason(error)}; check the cable") from error
            errors = ServoErrors(bits)
            if result == COMM_SUCCESS and len(answer) == size + 6 and not errors & ServoErrors.CHECKSUM:
                self._check(servo_id, errors, what)
                return bytes(answer[5:5 + size]), errors
            damaged |= result in (COMM_RX_CORRUPT, COMM_SUCCESS)
        raise NoAnswerError(self._silence(servo_id, damaged, tries))

    @staticmethod
    def _let_pass(port: _Port, late_bytes: int, end_s: float) -> None:
        """Let late answers to earlier tries go by, which do not say whose they are."""
        while late_bytes > 0 and select.select([port.ser.fileno()], [], [], max(0.0, end_s - time.monotonic()))[0]:
            late_bytes -= len(port.ser.read(late_bytes))

    def _check(self, servo_id: int, errors: ServoErrors, what: str) -> None:
        if errors & BUS_ERRORS:
            raise RefusedError(f"servo {servo_id} on {self._name} refused '{what}': {(errors & BUS_ERRORS)!r}; "
                               "check that it is an MX-64 with protocol 1.0")

    def _silence(self, servo_id: int, damaged: bool, tries: int) -> str:
        how = "answers with damaged packets" if damaged else "does not answer"
        where = ("the wiring and its termination, and that no two servos have one id" if damaged
                 else "its power, its cable, its id and the baud rate")
        return (f"servo {servo_id} on {self._name} at {self._baudrate} baud {how} ({tries} tries); "
                f"check {where}")


def _reason(error: OSError | termios.error) -> str:
    """What is wrong with a port, in the words of the operating system where there are any."""
    number = error.errno if isinstance(error, OSError) else error.args[0]
    if number == errno.EAGAIN:
        return "another program has it"
    return os.strerror(number) if number else str(error)
