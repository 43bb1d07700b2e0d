# SPDX-License-Identifier: BSD-3-Clause
"""Reads and writes the registers of Dynamixel servos over a serial line, through the maker's dynamixel-sdk.

It adds to the SDK: waits that do not use the processor, retries of lost or damaged packets, a check of the length of
answers, and exceptions that say what to check.
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
"""An answer that comes later than this counts as lost [s]."""
LEAST_TRIES = 3
BAUDRATES = (9600, 19200, 57600, 115200, 500000, 1000000, 2000000, 3000000)
BUS_ERRORS = ServoErrors.CHECKSUM | ServoErrors.INSTRUCTION | ServoErrors.RANGE | ServoErrors.ANGLE_LIMIT


class BusError(Exception):
    """Communication with the servos failed; the text names port, servo and what to check."""


class PortLostError(BusError):
    """The serial port does not exist (any more), or another program uses it."""


class NoAnswerError(BusError):
    """A servo does not answer, or with damaged packets."""


class RefusedError(BusError):
    """A servo refused an instruction."""


class _Port(PortHandler):  # type: ignore[misc]
    """The SDK's port, which sleeps while it waits for bytes and uses the monotonic clock."""

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
    """Servos on one serial line; to be used by one thread.

    Args:
        port_name: serial port, for example /dev/ttyUSB0.
        baudrate: [bit/s].
        timeout_s: a servo counts as silent after this time and three tries without an answer [s].
    """

    def __init__(self, port_name: str, baudrate: int, timeout_s: float = 0.1) -> None:
        if baudrate not in BAUDRATES:
            raise ValueError(f"baudrate: got {baudrate}; expected one of {', '.join(map(str, BAUDRATES))}")
        self._name, self._baudrate, self._timeout_s = port_name, baudrate, timeout_s
        self._packets: Any = PacketHandler(1.0)
        self._port: _Port | None = None
        self.retries = 0

    def open(self) -> None:
        """Opens the port.

        Raises:
            PortLostError: it is not there, not allowed, or taken.
        """
        self.close()
        port = _Port(self._name)
        try:
            port.setBaudRate(self._baudrate)
        except (OSError, termios.error) as error:
            raise PortLostError(
                f"port {self._name} cannot be opened: {_reason(error)}; check the cable, the name and "
                "the right to use it, and that no other program has it"
            ) from error
        self._port = port

    def close(self) -> None:
        """Closes the port. May be called twice."""
        port, self._port = self._port, None
        if port is not None:
            port.closePort()

    def model_number(self, servo_id: int) -> int:
        """Reads the model of a servo; also shows whether it answers."""
        return from_bytes(self.read(servo_id, MODEL_NUMBER)[0])

    def read(self, servo_id: int, register: Register) -> tuple[bytes, ServoErrors]:
        """Reads a register.

        Returns:
            Its bytes, and the error bits that came with them.

        Raises:
            BusError: port gone, no answer, or refused.
        """
        return self._transact(servo_id, READ, [register.address, register.size], register.size, register.name)

    def write(self, servo_id: int, register: Register, value: int) -> ServoErrors:
        """Writes a word to a register.

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

    def _transact(
        self, servo_id: int, instruction: int, parameters: list[int], size: int, what: str
    ) -> tuple[bytes, ServoErrors]:
        """Sends an instruction until it is answered; the answer has `size` bytes."""
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
                    self._discard_late(self._port, silent * (size + 6), sent_s + LATE_S)
            except serial.SerialTimeoutException as error:
                self.close()
                raise PortLostError(
                    f"port {self._name} took no bytes for {WRITE_TIMEOUT_S:g} s; check the adapter, and what else "
                    "this computer does"
                ) from error
            except (OSError, termios.error) as error:
                self.close()
                raise PortLostError(f"port {self._name} is gone: {_reason(error)}; check the cable") from error
            errors = ServoErrors(bits)
            if result == COMM_SUCCESS and len(answer) == size + 6 and not errors & ServoErrors.CHECKSUM:
                self._check(servo_id, errors, what)
                return bytes(answer[5 : 5 + size]), errors
            # an intact answer of another size is a late answer to an earlier instruction
            damaged |= result == COMM_RX_CORRUPT or bool(errors & ServoErrors.CHECKSUM)
        raise NoAnswerError(self._silence(servo_id, damaged, tries))

    @staticmethod
    def _discard_late(port: _Port, late_bytes: int, end_s: float) -> None:
        """Discards late answers to earlier tries, which cannot be distinguished from the answer to the last one."""
        while late_bytes > 0 and select.select([port.ser.fileno()], [], [], max(0.0, end_s - time.monotonic()))[0]:
            late_bytes -= len(port.ser.read(late_bytes))

    def _check(self, servo_id: int, errors: ServoErrors, what: str) -> None:
        if errors & BUS_ERRORS:
            raise RefusedError(
                f"servo {servo_id} on {self._name} refused '{what}': {(errors & BUS_ERRORS)!r}; "
                "check that it is an MX-64 with protocol 1.0"
            )

    def _silence(self, servo_id: int, damaged: bool, tries: int) -> str:
        how = "answers with damaged packets" if damaged else "does not answer"
        where = (
            "the wiring and its termination, and that no two servos have one id"
            if damaged
            else "its power, its cable, its id and the baud rate"
        )
        return f"servo {servo_id} on {self._name} at {self._baudrate} baud {how} ({tries} tries); check {where}"


def _reason(error: OSError | termios.error) -> str:
    """Describes an error of a port, with the text of the operating system if there is one."""
    number = error.errno if isinstance(error, OSError) else error.args[0]
    if number == errno.EAGAIN:
        return "another program has it"
    return os.strerror(number) if number else str(error)
