# SPDX-License-Identifier: BSD-3-Clause
"""The unmodified dynamixel-sdk, and our bus on top of it, against the emulated serial line and its faults."""

from __future__ import annotations

import os
import time
import tty
from collections.abc import Callable
from pathlib import Path

import pytest
from dynamixel_sdk import COMM_RX_TIMEOUT, COMM_SUCCESS, GroupSyncWrite, PacketHandler, PortHandler, port_handler

from modular_framework_drivers.ezgripper import dynamixel_bus, mx64
from modular_framework_drivers.ezgripper.dynamixel_bus import (
    DynamixelBus,
    NoResponseError,
    PortLostError,
    RefusedError,
)
from modular_framework_drivers.ezgripper.mx64 import ServoErrors
from modular_framework_testing.emulators import dynamixel_line
from modular_framework_testing.emulators.dynamixel_line import DynamixelLine

MakeLine = Callable[..., DynamixelLine]


@pytest.fixture
def patient_sdk(monkeypatch: pytest.MonkeyPatch) -> None:
    """The SDK waits 34 ms for an answer by default, less than a busy computer may take."""
    monkeypatch.setattr(port_handler, "LATENCY_TIMER", 150)


def sdk_port(line: DynamixelLine, baudrate: int = 57600) -> PortHandler:
    port = PortHandler(str(line.link))
    port.baudrate = baudrate
    assert port.openPort()
    return port


@pytest.fixture
def line(make_line: MakeLine) -> DynamixelLine:
    return make_line()


@pytest.fixture
def bus(line: DynamixelLine) -> DynamixelBus:
    made = DynamixelBus(str(line.link), 57600)
    made.open()
    return made


@pytest.mark.usefixtures("patient_sdk")
def test_the_sdk_pings_reads_and_writes(line: DynamixelLine) -> None:
    port, packets = sdk_port(line), PacketHandler(1.0)
    assert packets.ping(port, 1) == (310, COMM_SUCCESS, 0)
    assert packets.write2ByteTxRx(port, 1, 34, 500) == (COMM_SUCCESS, 0)
    assert packets.read2ByteTxRx(port, 1, 34) == (500, COMM_SUCCESS, 0)
    assert packets.write2ByteTxRx(port, 1, 34, 1024) == (COMM_SUCCESS, int(ServoErrors.RANGE))
    assert packets.ping(port, 2)[1] == COMM_RX_TIMEOUT
    port.closePort()


@pytest.mark.usefixtures("patient_sdk")
def test_the_sdk_talks_to_two_servos_at_once(make_line: MakeLine) -> None:
    port, packets = sdk_port(make_line(1, 2)), PacketHandler(1.0)
    together = GroupSyncWrite(port, packets, 34, 2)
    together.addParam(1, [100, 0])
    together.addParam(2, [200, 0])
    assert together.txPacket() == COMM_SUCCESS
    assert packets.bulkReadTx(port, [2, 1, 34, 2, 2, 34], 6) == COMM_SUCCESS
    assert [packets.read2ByteRx(port, servo_id) for servo_id in (1, 2)] == [
        (100, COMM_SUCCESS, 0),
        (200, COMM_SUCCESS, 0),
    ]
    port.closePort()


def test_the_sdk_at_another_baud_rate_hears_nothing(line: DynamixelLine) -> None:
    port = sdk_port(line, 115200)
    assert PacketHandler(1.0).ping(port, 1)[1] == COMM_RX_TIMEOUT
    port.closePort()


def test_words_are_written_and_read_back(bus: DynamixelBus) -> None:
    assert bus.model_number(1) == mx64.MODEL_NUMBER_MX64
    for register, value in ((mx64.TORQUE_LIMIT, 700), (mx64.MULTI_TURN_OFFSET, -300)):
        assert bus.write(1, register, value) is ServoErrors.NONE
        data, _ = bus.read(1, register)
        assert mx64.from_signed_word(mx64.from_bytes(data)) == value
    reading = mx64.parse_reading(*bus.read(1, mx64.READING))
    assert (reading.position, reading.voltage, reading.temperature) == (250, 12.0, 30.0)


def test_waiting_for_an_answer_leaves_the_processor_alone(line: DynamixelLine, bus: DynamixelBus) -> None:
    line.power_off()
    before_s, start_s = time.thread_time(), time.monotonic()
    for _ in range(5):
        with pytest.raises(NoResponseError):
            bus.read(1, mx64.READING)
    assert time.thread_time() - before_s < 0.2 * (time.monotonic() - start_s)


@pytest.mark.parametrize("fault", ["garbage", "lose", "corrupt"])
def test_a_damaged_line_is_endured(line: DynamixelLine, fault: str) -> None:
    bus = DynamixelBus(str(line.link), 57600, timeout_s=0.3)  # a busy computer is no damage
    bus.open()
    {"garbage": lambda: line.garbage(12), "lose": lambda: line.lose(3), "corrupt": lambda: line.corrupt(3)}[fault]()
    for value in range(30):
        bus.write(1, mx64.TORQUE_LIMIT, value)
        assert bus.read(1, mx64.TORQUE_LIMIT) == (bytes([value, 0]), ServoErrors.NONE)
    assert bus.retries > 0 or fault == "garbage"
    bus.close()


def test_an_answer_too_late_is_not_taken_for_that_to_another_question(
    line: DynamixelLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        dynamixel_bus, "MAX_RESPONSE_DELAY_S", 2.0
    )  # a busy computer makes answers later than the line does
    bus = DynamixelBus(str(line.link), 57600, timeout_s=2.0)
    bus.open()
    line.delay(0.045)
    assert bus.model_number(1) == 310
    assert bus.retries > 0
    line.delay(0.0)
    assert bus.read(1, mx64.MAX_TORQUE) == (b"\xff\x03", ServoErrors.NONE)


def test_answers_that_never_come_are_not_waited_for_longer_than_late_ones_take(
    line: DynamixelLine, bus: DynamixelBus
) -> None:
    line.lose(2)
    begun_s = time.monotonic()
    assert [bus.model_number(1) for _ in range(4)] == [310] * 4
    assert bus.retries > 0
    assert time.monotonic() - begun_s < 2.0


@pytest.mark.parametrize(
    ("fault", "error", "hint"),
    [
        (lambda line: line.power_off(), NoResponseError, "does not respond"),
        (lambda line: line.change_id(5), NoResponseError, "servo 1 on"),
        (lambda line: line.corrupt(1), NoResponseError, "damaged packets"),
        (lambda line: line.unplug(), PortLostError, "is lost"),
    ],
)
def test_a_servo_out_of_reach_is_an_error_that_says_why(
    line: DynamixelLine, bus: DynamixelBus, fault: Callable[[DynamixelLine], None], error: type[Exception], hint: str
) -> None:
    fault(line)
    start_s = time.monotonic()
    with pytest.raises(error, match=hint):
        bus.read(1, mx64.READING)
    assert time.monotonic() - start_s < 1.5


def test_answers_to_earlier_instructions_are_no_damaged_packets(
    bus: DynamixelBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    answer_to_a_write = b"\xff\xff\x01\x02\x00\xfc"
    monkeypatch.setattr(dynamixel_line, "bus_response", lambda servos, instruction: answer_to_a_write)
    with pytest.raises(NoResponseError, match="does not respond"):
        bus.read(1, mx64.READING)


def test_a_port_that_takes_no_bytes_is_not_called_unplugged() -> None:
    reader, port = os.openpty()
    tty.setraw(port)
    os.set_blocking(port, False)
    with pytest.raises(BlockingIOError):
        while True:  # nobody reads: until the port is full
            os.write(port, b"\xff" * 1024)
    bus = DynamixelBus(os.ttyname(port), 57600)
    bus.open()
    with pytest.raises(PortLostError, match="accepted no bytes for 0.5 s"):
        bus.read(1, mx64.READING)
    os.close(port)
    os.close(reader)


def test_another_baud_rate_is_named(line: DynamixelLine) -> None:
    bus = DynamixelBus(str(line.link), 115200)
    bus.open()
    with pytest.raises(NoResponseError, match="at 115200 baud does not respond.*baud rate"):
        bus.model_number(1)


def test_a_refused_word_is_an_error(bus: DynamixelBus) -> None:
    with pytest.raises(RefusedError, match="Torque Limit := 1024"):
        bus.write(1, mx64.TORQUE_LIMIT, 1024)


def test_a_port_that_is_not_there_or_taken_is_named(line: DynamixelLine, bus: DynamixelBus, tmp_path: Path) -> None:
    with pytest.raises(PortLostError, match="nowhere cannot be opened: No such file"):
        DynamixelBus(str(tmp_path / "nowhere"), 57600).open()
    with pytest.raises(PortLostError, match="opened: another program uses it"):
        DynamixelBus(str(line.link), 57600).open()
    with pytest.raises(PortLostError, match="is not open"):
        DynamixelBus(str(line.link), 57600).read(1, mx64.READING)


def test_a_baud_rate_that_does_not_exist_is_refused() -> None:
    with pytest.raises(ValueError, match="got 57601; expected one of 9600"):
        DynamixelBus("/dev/null", 57601)


def test_the_line_comes_back_under_its_name(line: DynamixelLine, bus: DynamixelBus) -> None:
    before = os.readlink(line.link)
    line.unplug()
    assert not line.link.is_symlink()
    line.plug()
    bus.open()
    assert bus.model_number(1) == mx64.MODEL_NUMBER_MX64
    assert os.readlink(line.link).startswith(os.path.dirname(before))


def test_the_link_does_not_replace_a_file(make_line: MakeLine, tmp_path: Path) -> None:
    (tmp_path / "gripper0").write_text("mine")
    with pytest.raises(OSError, match="exists and is not a symbolic link"):
        make_line()


@pytest.mark.usefixtures("patient_sdk")
def test_a_line_that_nobody_reads_loses_what_it_cannot_hold_and_goes_on(line: DynamixelLine) -> None:
    port, packets = sdk_port(line), PacketHandler(1.0)
    line.garbage(3_000)
    for asked in range(1, 11):
        port.writePort(bytes((0xFF, 0xFF, 1, 2, 1, 0xFB)))
        until = time.monotonic() + 5.0
        while line.instructions < asked and time.monotonic() < until:
            time.sleep(0.002)
    time.sleep(3_000 * 10.0 / 57600 + 0.1)  # until the last answer was on the wire
    line.clear()
    port.clearPort()
    assert packets.ping(port, 1) == (310, COMM_SUCCESS, 0)
    port.closePort()


@pytest.mark.parametrize("fault", ["garbage", "lose", "corrupt", "delay"])
def test_a_fault_of_less_than_nothing_is_refused(line: DynamixelLine, fault: str) -> None:
    with pytest.raises(ValueError, match="=-1: expected a number of at least 0"):
        line.commands[fault](-1)
