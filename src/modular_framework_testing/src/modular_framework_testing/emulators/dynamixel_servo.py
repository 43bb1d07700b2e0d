# SPDX-License-Identifier: BSD-3-Clause
"""Emulates a Dynamixel MX-64 on a serial line: protocol 1.0 packets and the control table.

The motor model (`dynamixel_finger`) reads the goals from the registers, and writes the measured values to registers.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from modular_framework_drivers.ezgripper import mx64
from modular_framework_drivers.ezgripper.mx64 import Register, ServoErrors, from_bytes

PING, READ, WRITE, REG_WRITE, ACTION, FACTORY_RESET, SYNC_WRITE, BULK_READ = 1, 2, 3, 4, 5, 6, 0x83, 0x92
BROADCAST = 0xFE
HEADER = b"\xff\xff"
CONTROL_TABLE_SIZE = 74
MULTI_TURN_RANGE = 28672
FACTORY_VALUES = {
    mx64.MODEL_NUMBER: mx64.MODEL_NUMBER_MX64,
    mx64.FIRMWARE_VERSION: 41,
    mx64.SERVO_ID: 1,
    mx64.BAUD_RATE: 34,
    mx64.RETURN_DELAY_TIME: 250,
    mx64.CCW_ANGLE_LIMIT: 4095,
    mx64.TEMPERATURE_LIMIT: 80,
    mx64.MIN_VOLTAGE_LIMIT: 60,
    mx64.MAX_VOLTAGE_LIMIT: 240,
    mx64.MAX_TORQUE: 1023,
    mx64.STATUS_RETURN_LEVEL: 2,
    mx64.ALARM_LED: 36,
    mx64.SHUTDOWN: 36,
    mx64.RESOLUTION_DIVIDER: 1,
    mx64.P_GAIN: 32,
    mx64.TORQUE_LIMIT: 1023,
    mx64.PRESENT_VOLTAGE: 120,
    mx64.PRESENT_TEMPERATURE: 30,
    mx64.CURRENT: 2048,
}
EEPROM_END = 24
READ_ONLY = {0, 1, 2, *range(36, 47), 50, 51}
MAX_VALUES = {
    mx64.SERVO_ID: 252,
    mx64.BAUD_RATE: 252,
    mx64.RETURN_DELAY_TIME: 254,
    mx64.CW_ANGLE_LIMIT: 4095,
    mx64.CCW_ANGLE_LIMIT: 4095,
    mx64.MAX_TORQUE: 1023,
    mx64.STATUS_RETURN_LEVEL: 2,
    mx64.ALARM_LED: 127,
    mx64.SHUTDOWN: 127,
    mx64.RESOLUTION_DIVIDER: 4,
    mx64.TORQUE_ENABLE: 1,
    mx64.P_GAIN: 254,
    mx64.MOVING_SPEED: 2047,
    mx64.TORQUE_LIMIT: 1023,
    mx64.LOCK: 1,
    mx64.TORQUE_CONTROL_MODE: 1,
    mx64.GOAL_TORQUE: 2047,
    mx64.GOAL_ACCELERATION: 254,
}


def checksum(body: bytes | Iterable[int]) -> int:
    """Returns the checksum of a packet: the inverted sum of the bytes between header and checksum."""
    return ~sum(body) & 0xFF


def packet(servo_id: int, kind: int, parameters: bytes = b"") -> bytes:
    """Returns a packet of Dynamixel protocol 1.0.

    Args:
        servo_id: Address of the servo.
        kind: Instruction, or the error byte of a status packet.
        parameters: Bytes between `kind` and the checksum.
    """
    body = bytes([servo_id, len(parameters) + 2, kind]) + parameters
    return HEADER + body + bytes([checksum(body)])


@dataclass(frozen=True, slots=True)
class Instruction:
    """Received instruction packet.

    Attributes:
        servo_id: Address of the servo, or `BROADCAST`.
        kind: Instruction, such as `READ`.
        parameters: Bytes between `kind` and the checksum.
        checksum_valid: Whether the checksum is correct.
    """

    servo_id: int
    kind: int
    parameters: bytes
    checksum_valid: bool


class PacketReader:
    """Finds packets in a stream of bytes."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def clear(self) -> None:
        """Discards the bytes received so far."""
        self._buffer.clear()

    def feed(self, data: bytes) -> Iterator[Instruction]:
        """Adds received bytes; yields the complete packets."""
        self._buffer += data
        while True:
            start = self._buffer.find(HEADER)
            if start < 0:
                del self._buffer[: max(0, len(self._buffer) - 1)]
                return
            del self._buffer[:start]
            if len(self._buffer) < 4:
                return
            servo_id, length = self._buffer[2], self._buffer[3]
            if servo_id == 0xFF or length < 2:
                del self._buffer[0]
                continue
            if len(self._buffer) < length + 4:
                return
            body, check = bytes(self._buffer[2 : length + 3]), self._buffer[length + 3]
            del self._buffer[: length + 4]
            yield Instruction(servo_id, body[2], body[3:], checksum(body) == check)


class DynamixelServo:
    """Emulates the registers of a servo and its responses to instructions.

    Args:
        servo_id: Address of the servo.
        baudrate_word: Value of the baud rate register.

    Attributes:
        errors: Errors in each status packet.
    """

    def __init__(self, servo_id: int = 1, baudrate_word: int = 34) -> None:
        self._table = bytearray(CONTROL_TABLE_SIZE)
        self._registered_write: bytes | None = None
        self.errors = ServoErrors.NONE
        self._reset()
        self.set(mx64.SERVO_ID, servo_id)
        self.set(mx64.BAUD_RATE, baudrate_word)

    def _reset(self) -> None:
        self._table[:] = bytes(CONTROL_TABLE_SIZE)
        for register, value in FACTORY_VALUES.items():
            self.set(register, value)

    @property
    def servo_id(self) -> int:
        """Returns the address of the servo."""
        return self.get(mx64.SERVO_ID)

    @property
    def baudrate(self) -> float:
        """Returns the baud rate [bit/s], by the formula in the manual."""
        word = self.get(mx64.BAUD_RATE)
        return {250: 2.25e6, 251: 2.5e6, 252: 3e6}.get(word, 2e6 / (word + 1))

    @property
    def multi_turn(self) -> bool:
        """Returns whether the servo is in multi-turn mode."""
        return self.get(mx64.CW_ANGLE_LIMIT) == self.get(mx64.CCW_ANGLE_LIMIT) == mx64.MULTI_TURN_LIMIT

    def get(self, register: Register) -> int:
        """Returns the unsigned value of a register."""
        return from_bytes(self._table[register.address : register.address + register.size])

    def set(self, register: Register, value: int) -> None:
        """Sets a register without the checks of a WRITE instruction."""
        data = (value % (1 << 8 * register.size)).to_bytes(register.size, "little")
        self._table[register.address : register.address + register.size] = data

    def power_cycle(self) -> None:
        """Resets the registers outside the EEPROM, as after a loss of power."""
        eeprom = bytes(self._table[:EEPROM_END])
        self._reset()
        self._table[:EEPROM_END] = eeprom
        self.set(mx64.TORQUE_LIMIT, self.get(mx64.MAX_TORQUE))
        self.errors, self._registered_write = ServoErrors.NONE, None

    def shut_down(self, errors: ServoErrors) -> None:
        """Adds error flags; a flag that is enabled in the shutdown register also sets the torque limit to 0."""
        self.errors |= errors
        if errors & self.get(mx64.SHUTDOWN):
            self.set(mx64.TORQUE_LIMIT, 0)

    def handle(self, instruction: Instruction) -> bytes:
        """Executes an instruction to this servo or to all servos; returns the status packet, b"" without a response."""
        if not instruction.checksum_valid:
            return self._status(ServoErrors.CHECKSUM)
        data, errors = self._execute(instruction.kind, instruction.parameters)
        if instruction.servo_id == BROADCAST or not self._returns_status(instruction.kind):
            return b""
        return self._status(errors, data)

    def _execute(self, kind: int, data: bytes) -> tuple[bytes, ServoErrors]:
        if kind == PING:
            return b"", ServoErrors.NONE
        if kind == READ:
            if len(data) != 2 or sum(data) > CONTROL_TABLE_SIZE:
                return b"", ServoErrors.RANGE
            return bytes(self._table[data[0] : data[0] + data[1]]), ServoErrors.NONE
        if kind == WRITE:
            return b"", self._write(data) if len(data) > 1 else ServoErrors.RANGE
        if kind == REG_WRITE:
            self._registered_write = data
            self.set(mx64.REGISTERED, 1)
            return b"", ServoErrors.NONE
        if kind == ACTION and self._registered_write is not None:
            data, self._registered_write = self._registered_write, None
            self.set(mx64.REGISTERED, 0)
            return b"", self._write(data) if len(data) > 1 else ServoErrors.RANGE
        if kind == FACTORY_RESET:
            self._reset()
            return b"", ServoErrors.NONE
        return b"", ServoErrors.INSTRUCTION

    def sync_write(self, parameters: bytes) -> None:
        """Writes the data for this servo in the parameters of a SYNC WRITE."""
        address, size = parameters[0], parameters[1]
        for start in range(2, len(parameters) - size, size + 1):
            if parameters[start] == self.servo_id:
                self._write(bytes([address]) + parameters[start + 1 : start + 1 + size])

    def _returns_status(self, kind: int) -> bool:
        level = self.get(mx64.STATUS_RETURN_LEVEL)
        return kind == PING or level == 2 or (level == 1 and kind == READ)

    def _status(self, errors: ServoErrors, data: bytes = b"") -> bytes:
        return packet(self.servo_id, int(errors | self.errors), data)

    def _write(self, parameters: bytes) -> ServoErrors:
        """Writes data at the address in parameters[0]; on an error, no register changes."""
        address, data = parameters[0], parameters[1:]
        addresses = range(address, address + len(data))
        if addresses.stop > CONTROL_TABLE_SIZE or READ_ONLY & set(addresses):
            return ServoErrors.RANGE
        if addresses.start < EEPROM_END and self.get(mx64.LOCK):
            return ServoErrors.RANGE
        before = bytes(self._table)
        self._table[addresses.start : addresses.stop] = data
        errors = self._value_errors(frozenset(addresses))
        if errors:
            self._table[:] = before
            return errors
        if mx64.TORQUE_LIMIT.address in addresses and self.get(mx64.TORQUE_LIMIT):
            self.errors &= ~ServoErrors.OVERLOAD
        if mx64.GOAL_POSITION.address in addresses and not self.get(mx64.TORQUE_CONTROL_MODE):
            self.set(mx64.TORQUE_ENABLE, 1)
        return errors

    def _value_errors(self, addresses: frozenset[int]) -> ServoErrors:
        """Returns the errors of the values written at `addresses`."""
        errors = ServoErrors.NONE
        for register, max_value in MAX_VALUES.items():
            if register.address in addresses and self.get(register) > max_value:
                errors |= ServoErrors.RANGE
        if mx64.GOAL_POSITION.address in addresses and not self._is_goal_allowed():
            errors |= ServoErrors.ANGLE_LIMIT
        return errors

    def _is_goal_allowed(self) -> bool:
        goal = self.get(mx64.GOAL_POSITION)
        if self.multi_turn:
            return abs(mx64.from_signed_word(goal)) <= MULTI_TURN_RANGE
        low, high = self.get(mx64.CW_ANGLE_LIMIT), self.get(mx64.CCW_ANGLE_LIMIT)
        return low <= goal <= high or low == high == 0


def bus_response(servos: Iterable[DynamixelServo], instruction: Instruction) -> bytes:
    """Returns the status packets of all addressed servos on the bus, in the order of `servos`."""
    all_servos = list(servos)
    if instruction.kind == SYNC_WRITE and instruction.servo_id == BROADCAST:
        if instruction.checksum_valid and len(instruction.parameters) > 2:
            for servo in all_servos:
                servo.sync_write(instruction.parameters)
        return b""
    if instruction.kind == BULK_READ and instruction.servo_id == BROADCAST:
        return b"".join(_bulk_read_responses(all_servos, instruction))
    addressed = [servo for servo in all_servos if instruction.servo_id in (servo.servo_id, BROADCAST)]
    return b"".join([servo.handle(instruction) for servo in addressed])


def _bulk_read_responses(servos: list[DynamixelServo], instruction: Instruction) -> Iterator[bytes]:
    requests = instruction.parameters[1:]
    for start in range(0, len(requests) - 2, 3):
        size, servo_id, address = requests[start : start + 3]
        for servo in servos:
            if servo.servo_id == servo_id:
                yield servo.handle(Instruction(servo_id, READ, bytes([address, size]), instruction.checksum_valid))
