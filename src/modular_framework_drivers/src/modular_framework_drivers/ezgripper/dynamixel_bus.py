# SPDX-License-Identifier: BSD-3-Clause
"""Reads and writes the registers of Dynamixel servos over a serial line, using the manufacturer's dynamixel-sdk.

This module adds waits without busy loops, retries of lost or damaged packets, a check of the length of responses, and
exceptions that name possible causes.
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
MAX_RESPONSE_DELAY_S = 0.1
"""Maximum delay of a late response [s]."""
MIN_ATTEMPTS = 3
BAUDRATES = (9600, 19200, 57600, 115200, 500000, 1000000, 2000000, 3000000)
BUS_ERRORS = ServoErrors.CHECKSUM | ServoErrors.INSTRUCTION | ServoErrors.RANGE | ServoErrors.ANGLE_LIMIT


class BusError(Exception):
    """Raised if communication with the servos failed; the text names the port, the servo and possible causes."""


class PortLostError(BusError):
    """Raised if the serial port is missing or in use by another program."""


class NoResponseError(BusError):
    """Raised if a servo does not respond or sends only damaged packets."""


class RefusedError(BusError):
    """Raised if a servo refused an instruction."""


class _Port(PortHandler):  # type: ignore[misc]
    """A port of the SDK that sleeps while it waits for bytes and uses the monotonic clock."""

    def setupPort(self, cflag_baud: int) -> bool:  # noqa: N802 (the SDK's name)
        self.ser = serial.Serial(self.port_name, cflag_baud, timeout=0, write_timeout=WRITE_TIMEOUT_S, exclusive=True)
        self.is_open = True
        self.tx_time_per_byte = 1000.0 / cflag_baud * 10.0
        return True

    def getCurrentTime(self) -> float:  # noqa: N802
        return time.monotonic() * 1e3

    def readPort(self, length: int) -> bytes:  # noqa: N802
        remaining_s = (self.packet_timeout - self.getTimeSinceStart()) / 1e3
        if remaining_s > 0.0 and not self.ser.in_waiting:
            select.select([self.ser.fileno()], [], [], remaining_s)
        return bytes(self.ser.read(length))


class DynamixelBus:
    """Accesses the servos on one serial line; must be used by a single thread.

    Args:
        port_name: Name of the serial port, such as /dev/ttyUSB0.
        baudrate: Baud rate [bit/s].
        timeout_s: Minimum time, besides three attempts, after which a servo counts as silent [s].
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
            PortLostError: If the port is missing, not permitted or in use.
        """
        self.close()
        port = _Port(self._name)
        try:
            port.setBaudRate(self._baudrate)
        except (OSError, termios.error) as error:
            raise PortLostError(
                f"port {self._name} cannot be opened: {_reason(error)}; check the cable, the name and "
                "the permission, and that no other program uses the port"
            ) from error
        self._port = port

    def close(self) -> None:
        """Closes the port; may be called twice."""
        port, self._port = self._port, None
        if port is not None:
            port.closePort()

    def model_number(self, servo_id: int) -> int:
        """Returns the model number of a servo."""
        return from_bytes(self.read(servo_id, MODEL_NUMBER)[0])

    def read(self, servo_id: int, register: Register) -> tuple[bytes, ServoErrors]:
        """Reads a register.

        Returns:
            The bytes of the register and the error bits of the response.

        Raises:
            BusError: If the port is lost, or the servo does not respond or refuses the instruction.
        """
        return self._transact(servo_id, READ, [register.address, register.size], register.size, register.name)

    def write(self, servo_id: int, register: Register, value: int) -> ServoErrors:
        """Writes a value to a register.

        Args:
            servo_id: Dynamixel identifier of the servo.
            register: Register to write.
            value: Value to write; negative values are encoded as two's complement.

        Returns:
            The error bits of the response.

        Raises:
            BusError: If the port is lost, or the servo does not respond or refuses the instruction.
        """
        data = (value % (1 << 8 * register.size)).to_bytes(register.size, "little")
        instruction_text = f"{register.name} := {value}"
        return self._transact(servo_id, WRITE, [register.address, *data], 0, instruction_text)[1]

    def _transact(
        self, servo_id: int, instruction: int, parameters: list[int], size: int, instruction_text: str
    ) -> tuple[bytes, ServoErrors]:
        """Sends an instruction until the servo responds with `size` bytes."""
        if self._port is None:
            raise PortLostError(f"port {self._name} is not open")
        damaged, timeout_count, errors = False, 0, ServoErrors.NONE
        attempts, begun_s = 0, time.monotonic()
        while attempts < MIN_ATTEMPTS or time.monotonic() - begun_s < self._timeout_s:
            self.retries += attempts > 0
            attempts += 1
            packet = [0, 0, servo_id, len(parameters) + 2, instruction, *parameters, 0]
            try:
                sent_s = time.monotonic()
                response, result, error_bits = self._packets.txRxPacket(self._port, packet)
                timeout_count += result == COMM_RX_TIMEOUT
                if timeout_count and result == COMM_SUCCESS:
                    self._discard_late(self._port, timeout_count * (size + 6), sent_s + MAX_RESPONSE_DELAY_S)
            except serial.SerialTimeoutException as error:
                self.close()
                raise PortLostError(
                    f"port {self._name} accepted no bytes for {WRITE_TIMEOUT_S:g} s; check the adapter and the load "
                    "of this computer"
                ) from error
            except (OSError, termios.error) as error:
                self.close()
                raise PortLostError(f"port {self._name} is lost: {_reason(error)}; check the cable") from error
            errors = ServoErrors(error_bits)
            if result == COMM_SUCCESS and len(response) == size + 6 and not errors & ServoErrors.CHECKSUM:
                self._check_errors(servo_id, errors, instruction_text)
                return bytes(response[5 : 5 + size]), errors
            # a valid response of another size is a late response to an earlier instruction
            damaged |= result == COMM_RX_CORRUPT or bool(errors & ServoErrors.CHECKSUM)
        raise NoResponseError(self._silence_message(servo_id, damaged, attempts))

    @staticmethod
    def _discard_late(port: _Port, late_bytes: int, end_s: float) -> None:
        """Discards late responses to earlier attempts, which look like the response to the last attempt."""
        while late_bytes > 0 and select.select([port.ser.fileno()], [], [], max(0.0, end_s - time.monotonic()))[0]:
            late_bytes -= len(port.ser.read(late_bytes))

    def _check_errors(self, servo_id: int, errors: ServoErrors, instruction_text: str) -> None:
        if errors & BUS_ERRORS:
            raise RefusedError(
                f"servo {servo_id} on {self._name} refused '{instruction_text}': {(errors & BUS_ERRORS)!r}; "
                "check that it is an MX-64 with protocol 1.0"
            )

    def _silence_message(self, servo_id: int, damaged: bool, attempts: int) -> str:
        symptom = "responds with damaged packets" if damaged else "does not respond"
        causes = (
            "the wiring and its termination, and that no two servos have the same id"
            if damaged
            else "its power, its cable, its id and the baud rate"
        )
        return (
            f"servo {servo_id} on {self._name} at {self._baudrate} baud {symptom} ({attempts} attempts); check {causes}"
        )


def _reason(error: OSError | termios.error) -> str:
    """Describes an error of a port, with the text of the operating system if available."""
    number = error.errno if isinstance(error, OSError) else error.args[0]
    if number == errno.EAGAIN:
        return "another program uses it"
    return os.strerror(number) if number else str(error)
