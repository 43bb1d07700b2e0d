# SPDX-License-Identifier: BSD-3-Clause
"""The instructions to the servos of a gripper, word for word, and their assumed state when an answer is lost."""

from __future__ import annotations

import pytest

from modular_framework_drivers.ezgripper import mx64
from modular_framework_drivers.ezgripper.dynamixel_bus import READ, WRITE, DynamixelBus, NoResponseError
from modular_framework_drivers.ezgripper.grip import Drive
from modular_framework_drivers.ezgripper.gripper_servos import GripperError, GripperServos
from modular_framework_drivers.ezgripper.mx64 import Register, ServoErrors
from modular_framework_testing.emulators.dynamixel_servo import DynamixelServo, Instruction

CLOSED = -150


class DirectBus(DynamixelBus):
    """Reaches an emulated servo without a line; notes what is written, and may lose the answer to a register."""

    def __init__(self) -> None:
        super().__init__("/nowhere", 57600)
        self.servo = DynamixelServo()
        self.written: list[tuple[Register, int]] = []
        self.loses: Register | None = None

    def read(self, servo_id: int, register: Register) -> tuple[bytes, ServoErrors]:
        answer = self.servo.handle(Instruction(servo_id, READ, bytes([register.address, register.size]), True))
        return answer[5:-1], ServoErrors(answer[4])

    def write(self, servo_id: int, register: Register, value: int) -> ServoErrors:
        self.written.append((register, value))
        data = (value % (1 << 8 * register.size)).to_bytes(register.size, "little")
        answer = self.servo.handle(Instruction(servo_id, WRITE, bytes([register.address]) + data, True))
        if register is self.loses:
            raise NoResponseError("silent")
        return ServoErrors(answer[4])

    def new_words(self) -> list[tuple[Register, int]]:
        """What was written since asked last."""
        words, self.written = self.written, []
        return words


@pytest.fixture
def bus() -> DirectBus:
    bus = DirectBus()
    bus.servo.set(mx64.PRESENT_POSITION, CLOSED)
    return bus


@pytest.fixture
def servos(bus: DirectBus) -> GripperServos:
    """Calibrated, and driven to the middle of their travel."""
    servos = GripperServos(bus, [1], lambda _: None)
    servos.set_up()
    bus.servo.set(mx64.PRESENT_POSITION, CLOSED)
    servos.calibrate()
    servos.drive(Drive(0.97, 300))
    bus.servo.set(mx64.PRESENT_POSITION, CLOSED + 1250)
    bus.new_words()
    return servos


def test_a_motor_that_gets_its_torque_back_has_its_new_goal_before(bus: DirectBus, servos: GripperServos) -> None:
    servos.clear_written()
    servos.drive(Drive(1.94, 300))
    assert bus.new_words() == [
        (mx64.GOAL_POSITION, CLOSED),
        (mx64.TORQUE_CONTROL_MODE, 0),
        (mx64.TORQUE_LIMIT, 300),
        (mx64.TORQUE_ENABLE, 1),
    ]


def test_less_torque_is_sent_before_the_goal_it_is_for(bus: DirectBus, servos: GripperServos) -> None:
    servos.drive(Drive(1.94, 100))
    assert bus.new_words() == [(mx64.TORQUE_LIMIT, 100), (mx64.GOAL_POSITION, CLOSED)]


def test_a_torque_is_bounded_before_it_is_applied(bus: DirectBus, servos: GripperServos) -> None:
    servos.drive(Drive(None, 200, -1))
    assert bus.new_words() == [(mx64.TORQUE_LIMIT, 200), (mx64.GOAL_TORQUE, 200), (mx64.TORQUE_CONTROL_MODE, 1)]


@pytest.mark.parametrize("drive", [Drive(0.97, 300), Drive(None, 300)], ids=["position", "torque"])
def test_staying_leaves_a_motor_off_that_has_shut_down(bus: DirectBus, servos: GripperServos, drive: Drive) -> None:
    servos.drive(drive)
    bus.servo.set(mx64.PRESENT_POSITION, CLOSED + 1000)
    bus.servo.shut_down(ServoErrors.OVERLOAD)
    servos.hold_position()
    assert mx64.from_signed_word(bus.servo.get(mx64.GOAL_POSITION)) == CLOSED + 1000
    assert (bus.servo.get(mx64.TORQUE_CONTROL_MODE), bus.servo.get(mx64.TORQUE_LIMIT)) == (0, 0)
    assert bus.servo.errors == ServoErrors.OVERLOAD


@pytest.mark.parametrize("lost", [mx64.GOAL_TORQUE, mx64.TORQUE_CONTROL_MODE])
def test_a_servo_that_followed_a_command_whose_answer_was_lost_had_power(
    bus: DirectBus, servos: GripperServos, lost: Register
) -> None:
    servos.drive(Drive(None, 200))
    servos.drive(Drive(0.97, 200))
    bus.loses = lost
    with pytest.raises(NoResponseError):
        servos.drive(Drive(None, 200, -1))
    bus.loses = None
    assert servos.restore_zeros()
    servos.drive(Drive(None, 200, -1))
    assert (bus.servo.get(mx64.GOAL_TORQUE), bus.servo.get(mx64.TORQUE_CONTROL_MODE)) == (200, 1)


def test_a_servo_of_which_only_the_place_is_known_is_not_taken_for_faithful(
    bus: DirectBus, servos: GripperServos
) -> None:
    servos.clear_written()
    servos.hold_position()
    bus.servo.power_cycle()
    bus.servo.set(mx64.GOAL_POSITION, CLOSED + 1250)
    bus.servo.set(mx64.PRESENT_POSITION, CLOSED + 1250 + 4096)
    assert not servos.restore_zeros()
    assert servos.read().position == pytest.approx(0.97)


def test_a_shaft_where_the_fingers_cannot_be_is_a_fault_until_it_is_back_and_nothing_is_sent_to_it(
    bus: DirectBus, servos: GripperServos
) -> None:
    bus.servo.power_cycle()
    bus.servo.set(mx64.PRESENT_POSITION, CLOSED + 3300)
    for _ in range(2):
        with pytest.raises(GripperError, match="servo 1: its shaft is outside the travel"):
            servos.restore_zeros()
        assert servos.is_calibrated
    bus.servo.set(mx64.PRESENT_POSITION, CLOSED + 1250 - 4096)
    assert not servos.restore_zeros()
    assert bus.new_words() == []
    assert servos.read().position == pytest.approx(0.97)
