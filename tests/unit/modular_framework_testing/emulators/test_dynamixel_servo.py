# SPDX-License-Identifier: BSD-3-Clause
"""The emulated servo against the worked examples of the public documentation of protocol 1.0 and of the MX-64."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_drivers.ezgripper import mx64
from modular_framework_drivers.ezgripper.mx64 import ServoErrors
from modular_framework_testing.emulators.dynamixel_servo import (
    BROADCAST,
    DynamixelServo,
    Instruction,
    PacketReader,
    bus_response,
    checksum,
    packet,
)


def talk(servos: list[DynamixelServo], sent: str) -> str:
    """What the servos answer to bytes, both in hexadecimal as the manual writes them."""
    return (
        b"".join(bus_response(servos, instruction) for instruction in PacketReader().feed(bytes.fromhex(sent)))
        .hex(" ")
        .upper()
    )


def test_the_checksums_are_those_of_the_manual() -> None:
    assert checksum(bytes.fromhex("01 05 03 0C 64 AA")) == 0xDC
    assert packet(1, int(ServoErrors.OVERLOAD | ServoErrors.OVERHEATING)).hex(" ").upper() == "FF FF 01 02 24 D8"


@pytest.mark.parametrize(
    ("servo_id", "sent", "answer"),
    [
        (1, "FF FF 01 02 01 FB", "FF FF 01 02 00 FC"),  # ping
        (1, "FF FF 01 04 02 2B 01 CC", "FF FF 01 03 00 20 DB"),  # read the temperature: 32 degrees
        (1, "FF FF 01 05 04 1E F4 01 E2", "FF FF 01 02 00 FC"),  # reg write 500 to the goal position
        (0, "FF FF 00 02 06 F7", "FF FF 01 02 00 FC"),  # factory reset: the id is 1 again
        (1, "FF FF FE 04 03 03 01 F6", ""),  # nobody answers a broadcast write
        (1, "FF FF FE 02 05 FA", ""),
        (2, "FF FF 01 02 01 FB", ""),  # somebody else is asked
    ],
)
def test_examples_of_the_manual_are_answered_as_printed(servo_id: int, sent: str, answer: str) -> None:
    servo = DynamixelServo(servo_id)
    servo.set(mx64.PRESENT_TEMPERATURE, 32)
    assert talk([servo], sent) == answer


def test_reg_write_waits_for_action() -> None:
    servo = DynamixelServo(1)
    talk([servo], "FF FF 01 05 04 1E F4 01 E2")
    assert (servo.get(mx64.GOAL_POSITION), servo.get(mx64.REGISTERED)) == (0, 1)
    talk([servo], "FF FF FE 02 05 FA")
    assert (servo.get(mx64.GOAL_POSITION), servo.get(mx64.REGISTERED)) == (500, 0)


def test_the_sync_write_of_the_manual_reaches_both_servos() -> None:
    servos = [DynamixelServo(0), DynamixelServo(1)]
    assert talk(servos, "FF FF FE 0E 83 1E 04 00 10 00 50 01 01 20 02 60 03 67") == ""
    assert [(servo.get(mx64.GOAL_POSITION), servo.get(mx64.MOVING_SPEED)) for servo in servos] == [
        (0x010, 0x150),
        (0x220, 0x360),
    ]


def test_the_bulk_read_of_the_manual_is_answered_in_order() -> None:
    first, second = DynamixelServo(1), DynamixelServo(2)
    first.set(mx64.GOAL_POSITION, 0x8000)
    second.set(mx64.PRESENT_POSITION, 0x8000)
    assert talk([second, first], "FF FF FE 09 92 00 02 01 1E 02 02 24 1D") == (
        "FF FF 01 04 00 00 80 7A FF FF 02 04 00 00 80 79"
    )


@pytest.mark.parametrize(
    ("instruction", "errors"),
    [
        (Instruction(1, 2, b"\x24\x02", checksum_valid=False), ServoErrors.CHECKSUM),
        (Instruction(1, 9, b"", checksum_valid=True), ServoErrors.INSTRUCTION),
        (Instruction(1, 5, b"", checksum_valid=True), ServoErrors.INSTRUCTION),  # action without reg write
        (Instruction(1, 2, b"\x48\x09", checksum_valid=True), ServoErrors.RANGE),  # beyond the table
        (Instruction(1, 3, b"\x24\x00\x00", checksum_valid=True), ServoErrors.RANGE),  # present position is read only
        (Instruction(1, 3, b"\x22\x00\x04", checksum_valid=True), ServoErrors.RANGE),  # torque limit 1024
        (Instruction(1, 3, b"\x1e\x00\x10", checksum_valid=True), ServoErrors.ANGLE_LIMIT),  # goal 4096 in joint mode
    ],
)
def test_what_is_not_allowed_is_refused_with_its_bit(instruction: Instruction, errors: ServoErrors) -> None:
    servo = DynamixelServo(1)
    before = servo.get(mx64.TORQUE_LIMIT), servo.get(mx64.GOAL_POSITION)
    assert servo.handle(instruction)[4] == int(errors)
    assert before == (servo.get(mx64.TORQUE_LIMIT), servo.get(mx64.GOAL_POSITION))


def test_multi_turn_takes_negative_goals() -> None:
    servo = DynamixelServo(1)
    for register in (mx64.CW_ANGLE_LIMIT, mx64.CCW_ANGLE_LIMIT):
        servo.set(register, mx64.MULTI_TURN_LIMIT)
    goal = (-300 % 65536).to_bytes(2, "little")
    assert servo.handle(Instruction(1, 3, b"\x1e" + goal, True))[4] == 0
    assert mx64.from_signed_word(servo.get(mx64.GOAL_POSITION)) == -300


def test_a_shutdown_takes_the_torque_until_it_is_given_again() -> None:
    servo = DynamixelServo(1)
    servo.shut_down(ServoErrors.OVERLOAD)
    assert servo.get(mx64.TORQUE_LIMIT) == 0
    assert servo.handle(Instruction(1, 1, b"", True))[4] == int(ServoErrors.OVERLOAD)
    assert servo.handle(Instruction(1, 3, b"\x22\xf4\x01", True))[4] == 0
    assert servo.get(mx64.TORQUE_LIMIT) == 500


@pytest.mark.parametrize(("torque_mode", "enabled"), [(0, 1), (1, 0)])
@pytest.mark.parametrize(
    "words", [b"\x1e\xf4\x01", b"\x1e\xf4\x01\x00\x00\x64\x00"], ids=["goal", "goal, speed and limit at once"]
)
def test_a_goal_position_switches_the_torque_on_unless_a_torque_is_controlled(
    words: bytes, torque_mode: int, enabled: int
) -> None:
    servo = DynamixelServo(1)
    servo.set(mx64.TORQUE_CONTROL_MODE, torque_mode)
    assert servo.handle(Instruction(1, 3, words, True))[4] == 0
    assert (servo.get(mx64.GOAL_POSITION), servo.get(mx64.TORQUE_ENABLE)) == (500, enabled)


def test_without_power_only_the_eeprom_is_remembered() -> None:
    servo = DynamixelServo(7)
    servo.set(mx64.MAX_TORQUE, 800)
    servo.set(mx64.GOAL_TORQUE, 100)
    servo.power_cycle()
    assert (servo.servo_id, servo.get(mx64.TORQUE_LIMIT), servo.get(mx64.GOAL_TORQUE)) == (7, 800, 0)


@pytest.mark.parametrize("level", [0, 1, 2])
def test_the_status_return_level_says_what_is_answered(level: int) -> None:
    servo = DynamixelServo(1)
    servo.set(mx64.STATUS_RETURN_LEVEL, level)
    ping, read, write = (
        Instruction(1, 1, b"", True),
        Instruction(1, 2, b"\x24\x02", True),
        Instruction(1, 3, b"\x19\x01", True),
    )
    assert [bool(servo.handle(one)) for one in (ping, read, write)] == [True, level > 0, level > 1]


@pytest.mark.parametrize(("word", "baudrate"), [(1, 1e6), (34, 57142.86), (16, 117647.06), (252, 3e6)])
def test_baud_rates_are_those_of_the_manual(word: int, baudrate: float) -> None:
    assert DynamixelServo(1, word).baudrate == pytest.approx(baudrate, rel=1e-6)


@given(
    st.binary(max_size=30).filter(lambda data: b"\xff" not in data),
    st.integers(0, 252),
    st.binary(max_size=20),
    st.data(),
)
def test_packets_are_found_among_garbage_however_they_are_cut(
    noise: bytes, servo_id: int, parameters: bytes, data: st.DataObject
) -> None:
    stream = noise + packet(servo_id, 3, parameters) + noise + packet(servo_id, 1)
    cut = data.draw(st.integers(0, len(stream)))
    reader = PacketReader()
    found = [*reader.feed(stream[:cut]), *reader.feed(stream[cut:])]
    assert found == [Instruction(servo_id, 3, parameters, True), Instruction(servo_id, 1, b"", True)]


@given(st.binary(max_size=200))
def test_no_bytes_whatever_upset_the_servos(noise: bytes) -> None:
    servos = [DynamixelServo(0), DynamixelServo(1)]
    for instruction in PacketReader().feed(noise):
        assert isinstance(bus_response(servos, instruction), bytes)
        assert instruction.servo_id <= BROADCAST


@pytest.mark.parametrize(("word", "value"), [(0, 0), (1024, 0), (300, 300), (1024 + 300, -300), (1023, 1023)])
def test_direction_bits_are_read_and_written(word: int, value: int) -> None:
    assert mx64.from_direction_word(word) == value
    if word != 1024:
        assert mx64.direction_word(value) == word


def test_a_speed_of_300_is_34_turns_a_minute() -> None:
    turns_a_minute = 300 * mx64.SPEED_UNIT_TICKS_S / 4096 * 60
    assert turns_a_minute == pytest.approx(34.2)
