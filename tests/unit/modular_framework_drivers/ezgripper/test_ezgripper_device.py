# SPDX-License-Identifier: BSD-3-Clause
"""The gripper device against emulated servos: calibration, holding, and every fault, seen in time and survived."""

from __future__ import annotations

import logging
import re
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import pytest

from modular_framework_drivers.ezgripper import mx64
from modular_framework_drivers.ezgripper.ezgripper_device import EzGripper, GripperState
from modular_framework_drivers.ezgripper.grip import Motion
from modular_framework_drivers.ezgripper.gripper_servos import joint_from_ticks
from modular_framework_drivers.ezgripper.gripper_settings import GripperSettings
from modular_framework_drivers.ezgripper.mx64 import ServoErrors
from modular_framework_testing.emulators.dynamixel_finger import Finger, FingerModel
from modular_framework_testing.emulators.dynamixel_line import DynamixelLine
from modular_framework_testing.emulators.dynamixel_servo import DynamixelServo

MakeLine = Callable[..., DynamixelLine]
MakeGripper = Callable[..., tuple[DynamixelLine, EzGripper]]
TOLERANCE = 0.03
LINK_TIMEOUT_S = 0.4  # the emulator has to share a busy machine
PERIOD_S = GripperSettings("").poll_period_s
OBJECT_POSITION = 1.24


def until(condition: Callable[[], bool], timeout_s: float = 5.0) -> float:
    """Waits; returns how long it took [s]."""
    start_s = time.monotonic()
    while not condition():
        assert time.monotonic() - start_s < timeout_s, f"waited {timeout_s} s in vain"
        time.sleep(0.005)
    return time.monotonic() - start_s


class Bench:
    """One emulated line and the gripper on it, used by all tests."""

    def __init__(self, folder: Path) -> None:
        finger = Finger(DynamixelServo(), FingerModel(top_speed=12000.0, time_constant_s=0.015), opening=200.0)
        self.line = DynamixelLine([finger], folder / "gripper")
        self.line.connect()
        self.strongest_while_calibrating = 0.0
        self.gripper = EzGripper(
            GripperSettings(str(self.line.link), fault_pause_s=0.3, start_position=1.7, link_timeout_s=LINK_TIMEOUT_S)
        )
        self.gripper.start()
        while not self.gripper.state().ready:
            servo = self.line.fingers[0].servo
            if servo.get(mx64.TORQUE_CONTROL_MODE):
                load = abs(mx64.from_direction_word(servo.get(mx64.PRESENT_LOAD)))
                self.strongest_while_calibrating = max(self.strongest_while_calibrating, load)
            time.sleep(0.005)

    def reset(self) -> None:
        """Everything is well, and the fingers stand at 1.2 rad."""
        line = self.line
        line.plug()
        line.clear()
        line.remove_object()
        line.fingers[0].servo.set(mx64.SERVO_ID, 1)
        line.heat(30)
        until(lambda: not self.gripper.state().fault)
        assert arrive(self.gripper, 1.2, 600).motion is Motion.REACHED


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    made = Bench(tmp_path_factory.mktemp("line"))
    yield made
    made.gripper.close()
    made.line.close()


@pytest.fixture
def line(bench: Bench) -> DynamixelLine:
    bench.reset()
    return bench.line


@pytest.fixture
def gripper(bench: Bench, line: DynamixelLine) -> EzGripper:
    return bench.gripper


@pytest.fixture
def make_gripper(make_line: MakeLine) -> Iterator[Callable[..., tuple[DynamixelLine, EzGripper]]]:
    """Makes a gripper on a line of its own."""
    made: list[EzGripper] = []

    def make(*servo_ids: int, **changes: object) -> tuple[DynamixelLine, EzGripper]:
        line = make_line(*servo_ids, opening=200.0)
        settings = GripperSettings(
            str(line.link), servo_ids=servo_ids or (1,), start_position=1.7, link_timeout_s=LINK_TIMEOUT_S
        )
        made.append(EzGripper(replace(settings, **changes)))
        return line, made[-1]

    yield make
    for gripper in made:
        gripper.close()
        gripper.close()


def arrive(gripper: EzGripper, position: float, torque: int = 400) -> GripperState:
    """Gives a goal and waits until it is reached or something is held."""
    number = gripper.command(position, torque)
    until(lambda: gripper.state().goal.number == number and gripper.state().motion is not Motion.MOVING)
    return gripper.state()


def test_it_calibrates_at_its_closed_stop_with_little_torque(bench: Bench) -> None:
    bench.reset()
    assert 0 < bench.strongest_while_calibrating <= 110
    assert bench.line.fingers[0].opening == pytest.approx(2500 * (1 - 1.2 / 1.94), abs=40)


@pytest.mark.parametrize("position", [0.2, 0.7, 1.94])
def test_positions_are_reached(line: DynamixelLine, gripper: EzGripper, position: float) -> None:
    state = arrive(gripper, position)
    assert state.motion is Motion.REACHED
    assert state.reading.position == pytest.approx(position, abs=TOLERANCE)
    assert line.fingers[0].opening == pytest.approx(2500 * (1 - position / 1.94), abs=60)


def test_velocity_and_load_have_the_sign_of_closing(gripper: EzGripper) -> None:
    gripper.command(1.9, 600)
    until(lambda: gripper.state().reading.velocity > 0.5)
    assert gripper.state().reading.load > 0.0
    gripper.command(0.1, 600)
    until(lambda: gripper.state().reading.velocity < -0.5)
    assert gripper.state().reading.load < 0.0


def test_an_object_is_held_with_the_torque_asked_for_and_let_go(line: DynamixelLine, gripper: EzGripper) -> None:
    line.place_object(OBJECT_POSITION)
    state = arrive(gripper, 1.94, 300)
    assert state.motion is Motion.HOLDING
    assert state.reading.position == pytest.approx(OBJECT_POSITION, abs=0.05)
    until(lambda: gripper.state().reading.load == pytest.approx(300 / 1023, abs=0.01))
    time.sleep(0.3)
    assert gripper.state().motion is Motion.HOLDING
    assert arrive(gripper, 0.3).motion is Motion.REACHED


def test_holding_never_overloads_the_motor(line: DynamixelLine, gripper: EzGripper) -> None:
    line.place_object(OBJECT_POSITION)
    arrive(gripper, 1.94, 1023)
    time.sleep(2.5)  # the emulated motor endures an overload for 2 s
    assert gripper.state().fault == ""
    assert gripper.state().reading.load == pytest.approx(400 / 1023, abs=0.01)


def test_fingers_whose_object_is_taken_close_on_and_say_so(line: DynamixelLine, gripper: EzGripper) -> None:
    line.place_object(OBJECT_POSITION)
    arrive(gripper, 1.5, 300)
    line.remove_object()
    until(lambda: gripper.state().motion is Motion.REACHED)
    assert gripper.state().reading.position == pytest.approx(1.5, abs=TOLERANCE)


def test_a_stop_stops_the_fingers(line: DynamixelLine, gripper: EzGripper) -> None:
    gripper.command(0.0, 300)
    until(lambda: gripper.state().reading.velocity < -0.5)
    gripper.stop()
    until(lambda: abs(line.fingers[0].speed) < 20.0, 0.5)
    there = gripper.state().reading.position
    assert there > 0.2
    time.sleep(0.3)
    assert gripper.state().reading.position == pytest.approx(there, abs=0.05)


def test_a_stop_keeps_hold_of_what_is_held(line: DynamixelLine, gripper: EzGripper) -> None:
    line.place_object(OBJECT_POSITION)
    arrive(gripper, 1.94, 300)
    gripper.stop()
    time.sleep(0.3)
    assert gripper.state().motion is Motion.HOLDING
    assert gripper.state().reading.load == pytest.approx(300 / 1023, abs=0.02)


FAULTS = [
    ("unplugged", lambda line: line.unplug(), lambda line: line.plug(), "is lost|cannot be opened", 2.0),
    ("servo without power", lambda line: line.power_off(), lambda line: line.power_on(), "does not respond", 2.0),
    ("overload", lambda line: line.overload(), lambda line: None, "overloaded", 2.0),
    ("overheating", lambda line: line.heat(85), lambda line: line.heat(40), "too hot .8[45] degrees C.", 2.0),
    ("every answer lost", lambda line: line.lose(1), lambda line: line.clear(), "does not respond", 2.0),
    ("every answer damaged", lambda line: line.corrupt(1), lambda line: line.clear(), "damaged packets", 2.0),
    ("late answers", lambda line: line.delay(1.0), lambda line: line.clear(), "does not respond", 2.0),
    ("another id", lambda line: line.change_id(9), lambda line: line.change_id(1), "servo 1 on", 2.0),
]


@pytest.mark.parametrize(
    ("fault", "mend", "text", "within_s"), [case[1:] for case in FAULTS], ids=[case[0] for case in FAULTS]
)
def test_a_fault_is_reported_in_time_and_survived(
    line: DynamixelLine,
    gripper: EzGripper,
    text: str,
    within_s: float,
    fault: Callable[[DynamixelLine], None],
    mend: Callable[[DynamixelLine], None],
) -> None:
    arrive(gripper, 1.2)
    fault(line)
    assert until(lambda: bool(gripper.state().fault)) < within_s
    assert re.search(text, gripper.state().fault), gripper.state().fault
    assert gripper.state().fault.startswith("EzGripper: ")
    mend(line)
    until(lambda: not gripper.state().fault)
    assert gripper.state().reading.position == pytest.approx(1.2, abs=0.05)
    time.sleep(0.2)
    assert gripper.state().reading.position == pytest.approx(1.2, abs=0.05), "it moved by itself"
    assert arrive(gripper, 0.6).motion is Motion.REACHED
    assert line.fingers[0].opening == pytest.approx(2500 * (1 - 0.6 / 1.94), abs=60)


@pytest.mark.parametrize(
    "fault",
    [
        lambda line: line.garbage(12),
        lambda line: line.lose(4),
        lambda line: line.corrupt(4),
        lambda line: line.delay(0.01),
    ],
    ids=["garbage", "some lost", "some damaged", "a bit late"],
)
def test_a_bad_line_is_endured_without_a_fault(
    line: DynamixelLine, gripper: EzGripper, fault: Callable[[DynamixelLine], None]
) -> None:
    fault(line)
    assert arrive(gripper, 0.5).motion is Motion.REACHED
    assert arrive(gripper, 1.5).motion is Motion.REACHED
    assert gripper.state().fault == ""


def test_what_is_held_stays_held_while_the_cable_is_out(line: DynamixelLine, gripper: EzGripper) -> None:
    line.place_object(OBJECT_POSITION)
    arrive(gripper, 1.94, 300)
    line.unplug()
    until(lambda: bool(gripper.state().fault))
    line.plug()
    until(lambda: not gripper.state().fault)
    assert gripper.state().motion is Motion.HOLDING
    assert gripper.state().reading.load == pytest.approx(300 / 1023, abs=0.02)


def test_fingers_under_way_when_the_cable_is_pulled_stop_when_it_is_back(
    line: DynamixelLine, gripper: EzGripper
) -> None:
    gripper.command(0.0, 80)
    until(lambda: gripper.state().reading.position < 1.1)
    line.unplug()
    until(lambda: bool(gripper.state().fault))
    line.plug()
    until(lambda: not gripper.state().fault)
    there = gripper.state().reading.position
    assert there > 0.1
    time.sleep(0.3)
    assert gripper.state().reading.position == pytest.approx(there, abs=0.05)


@pytest.mark.parametrize(("torque", "farthest"), [(100, 0.06), (400, 0.2)])
def test_fingers_under_way_do_not_go_on_to_their_goal_without_the_cable(
    line: DynamixelLine, gripper: EzGripper, torque: int, farthest: float
) -> None:
    stamps = [gripper.state().stamp_s]

    def is_under_way() -> bool:
        state = gripper.state()
        if state.stamp_s != stamps[-1]:
            stamps.append(state.stamp_s)
        return state.reading.position > 0.5

    arrive(gripper, 0.2)
    gripper.command(1.9, torque)
    until(is_under_way)
    line.unplug()
    stamps.append(time.monotonic())  # the end of a cycle that was not published
    there = joint_from_ticks(line.fingers[0].opening)
    longest_s = max(second - first for first, second in pairwise(stamps[-3:]))
    slowness = max(1.0, longest_s / PERIOD_S)  # on a slow computer, a set point must last longer
    time.sleep(0.2)
    until(lambda: abs(line.fingers[0].speed) < 1.0)
    assert 0.0 < joint_from_ticks(line.fingers[0].opening) - there < farthest * slowness


def test_a_moment_without_power_that_the_line_endures_is_a_fault_and_no_grasp(
    line: DynamixelLine, gripper: EzGripper
) -> None:
    arrive(gripper, 0.2)
    faults = gripper.state().faults
    gripper.command(1.9, 100)
    until(lambda: gripper.state().reading.position > 0.5)
    line.power_off()
    time.sleep(0.75 * LINK_TIMEOUT_S)
    line.power_on()
    until(lambda: gripper.state().faults != faults)
    assert "lost power" in gripper.state().last_fault or "does not respond" in gripper.state().last_fault
    until(lambda: not gripper.state().fault)
    assert gripper.state().motion is not Motion.HOLDING


def test_turns_of_the_shaft_are_counted_anew_after_a_loss_of_power(line: DynamixelLine, gripper: EzGripper) -> None:
    before = line.fingers[0].servo.get(mx64.PRESENT_POSITION)
    arrive(gripper, 1.9)
    line.power_off()
    until(lambda: bool(gripper.state().fault))
    line.power_on()
    until(lambda: not gripper.state().fault)
    assert (
        abs(mx64.from_signed_word(line.fingers[0].servo.get(mx64.PRESENT_POSITION)) - mx64.from_signed_word(before))
        > 1000
    )
    assert gripper.state().reading.position == pytest.approx(1.9, abs=TOLERANCE)


def test_an_overload_while_the_cable_is_out_is_reported_before_the_motor_gets_its_torque_again(
    line: DynamixelLine, gripper: EzGripper
) -> None:
    line.unplug()
    until(lambda: bool(gripper.state().fault))
    line.overload()
    line.plug()
    until(lambda: "overloaded" in gripper.state().fault)
    assert line.fingers[0].servo.get(mx64.TORQUE_LIMIT) == 0
    until(lambda: not gripper.state().fault)
    assert line.fingers[0].servo.get(mx64.TORQUE_LIMIT) == 400
    assert gripper.state().reading.position == pytest.approx(1.2, abs=0.05)


def cut_supply(line: DynamixelLine) -> None:
    """The supply leaves its limits, which does not switch an MX-64 off."""
    for finger in line.fingers:
        finger.servo.shut_down(ServoErrors.VOLTAGE)


def test_fingers_commanded_to_hold_do_so_when_the_cable_was_out_until_the_motor_was_well(
    line: DynamixelLine, gripper: EzGripper
) -> None:
    line.place_object(OBJECT_POSITION)
    arrive(gripper, 1.94, 300)
    cut_supply(line)
    until(lambda: "supply" in gripper.state().fault)
    servo = line.fingers[0].servo
    until(lambda: not servo.get(mx64.TORQUE_CONTROL_MODE))
    line.unplug()
    until(lambda: "supply" not in gripper.state().fault)
    line.remove_object()
    servo.errors = ServoErrors.NONE
    line.plug()
    until(lambda: not gripper.state().fault)
    time.sleep(0.5)
    assert gripper.state().reading.position == pytest.approx(OBJECT_POSITION, abs=0.05)


@pytest.mark.parametrize(
    "fault",
    [cut_supply, lambda line: line.fingers[0].servo.shut_down(ServoErrors.OVERLOAD)],
    ids=["all out of voltage", "one of two overloaded"],
)
def test_no_finger_goes_on_once_a_fault_of_a_motor_is_reported(
    make_gripper: MakeGripper, fault: Callable[[DynamixelLine], None]
) -> None:
    line, gripper = make_gripper(1, 2)
    gripper.start()
    until(lambda: gripper.state().ready, 10.0)
    gripper.command(0.0, 100)
    until(lambda: gripper.state().reading.position < 1.6)
    fault(line)
    until(lambda: bool(gripper.state().fault))
    until(lambda: all(abs(finger.speed) < 20.0 for finger in line.fingers))  # [ticks/s]; within 0.2 s if not busy
    stood = [finger.opening for finger in line.fingers]
    time.sleep(0.5)
    assert gripper.state().fault
    assert [finger.opening for finger in line.fingers] == pytest.approx(stood, abs=20)


def test_a_shaft_that_was_turned_while_it_had_no_power_is_a_fault_and_nothing_moves(make_gripper: MakeGripper) -> None:
    line, gripper = make_gripper(start_position=0.1)
    gripper.start()
    until(lambda: gripper.state().ready, 10.0)
    finger = line.fingers[0]
    line.power_off()
    until(lambda: bool(gripper.state().fault))
    finger.model = replace(finger.model, travel_ticks=3600.0)
    finger.angle += 900
    there = finger.opening
    line.power_on()
    until(lambda: "its shaft is outside the travel" in gripper.state().fault)
    time.sleep(1.2)  # two more attempts
    assert "its shaft is outside the travel" in gripper.state().fault
    assert finger.opening == pytest.approx(there, abs=5)
    finger.angle -= 900
    until(lambda: not gripper.state().fault)
    assert gripper.state().reading.position == pytest.approx(0.1, abs=0.05)


def test_goals_are_ignored_while_there_is_a_fault(line: DynamixelLine, gripper: EzGripper) -> None:
    line.heat(85)
    until(lambda: bool(gripper.state().fault))
    number = gripper.command(0.0, 400)
    line.heat(40)
    until(lambda: not gripper.state().fault)
    time.sleep(0.1)
    assert gripper.state().goal.number != number or gripper.state().goal.position != 0.0
    assert gripper.state().reading.position == pytest.approx(1.2, abs=0.05)


def test_a_warm_motor_is_reported_before_it_gives_up(
    line: DynamixelLine, gripper: EzGripper, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        line.heat(72)
        until(lambda: "72 degrees C" in caplog.text)
    assert gripper.state().fault == ""


@pytest.fixture
def slow(make_gripper: MakeGripper) -> tuple[DynamixelLine, EzGripper]:
    """A gripper at 1.7 rad whose thread can be kept waiting for an answer for long without a fault."""
    line, gripper = make_gripper(link_timeout_s=3.0)
    gripper.start()
    until(lambda: gripper.state().ready, 10.0)
    return line, gripper


def keep_waiting(gripper: EzGripper) -> None:
    """Waits until the gripper's thread is amid a cycle that has no answer, and no fault yet."""
    until(lambda: time.monotonic() - gripper.state().stamp_s > 0.3)
    assert gripper.state().fault == ""


def test_a_control_loop_need_not_wait_for_the_thread_of_the_gripper(slow: tuple[DynamixelLine, EzGripper]) -> None:
    line, gripper = slow
    gripper.command(1.0, 300)
    line.delay(1.0)
    keep_waiting(gripper)
    with ThreadPoolExecutor() as threads:
        before = threads.submit(gripper.command, 1.1, 300).result(0.5)
        threads.submit(gripper.stop).result(0.5)
        number = threads.submit(gripper.command, 1.1, 300).result(0.5)
    line.clear()
    assert number > before
    until(lambda: gripper.state().goal.number == number)
    assert gripper.state().goal.position == 1.1
    until(lambda: gripper.state().motion is Motion.REACHED)
    assert gripper.state().reading.position == pytest.approx(1.1, abs=TOLERANCE)


def test_the_same_goal_in_every_cycle_begins_nothing_anew(gripper: EzGripper) -> None:
    arrive(gripper, 1.0, 300)
    for _ in range(20):
        number = gripper.command(1.0, 300)
        until(lambda number=number: gripper.state().goal.number == number)
        assert gripper.state().motion is Motion.REACHED


def test_a_goal_from_before_a_fault_is_void(slow: tuple[DynamixelLine, EzGripper]) -> None:
    line, gripper = slow
    before = gripper.state()
    line.lose(1)
    keep_waiting(gripper)
    gripper.command(1.0, 300)
    until(lambda: "does not respond" in gripper.state().fault, 10.0)
    assert gripper.state().faults > before.faults
    gripper.command(1.1, 300)
    line.clear()
    until(lambda: not gripper.state().fault, 10.0)
    assert "does not respond" in gripper.state().last_fault
    time.sleep(0.3)
    assert gripper.state().goal.position == pytest.approx(1.7, abs=TOLERANCE)
    assert gripper.state().reading.position == pytest.approx(1.7, abs=TOLERANCE)
    assert arrive(gripper, 1.2, 300).motion is Motion.REACHED
    assert gripper.state().reading.position == pytest.approx(1.2, abs=TOLERANCE)


def test_a_gripper_that_comes_late_is_used(make_gripper: MakeGripper) -> None:
    line, gripper = make_gripper()
    line.unplug()
    gripper.start()
    until(lambda: "cannot be opened" in gripper.state().fault)
    line.plug()
    until(lambda: gripper.state().ready)


def test_a_wrong_baud_rate_is_named(make_gripper: MakeGripper) -> None:
    _, gripper = make_gripper(baudrate=115200)
    gripper.start()
    until(lambda: "at 115200 baud does not respond" in gripper.state().fault)


def test_a_servo_of_another_model_is_not_used(make_gripper: MakeGripper) -> None:
    line, gripper = make_gripper()
    line.fingers[0].servo.set(mx64.MODEL_NUMBER, 12)
    gripper.start()
    until(lambda: "servo 1 is model 12; expected 310 (MX-64), 320 (MX-106)" in gripper.state().fault)
    assert line.fingers[0].servo.get(mx64.TORQUE_ENABLE) == 0


def test_two_servos_move_as_one_joint(make_gripper: MakeGripper) -> None:
    line, gripper = make_gripper(1, 2)
    gripper.start()
    until(lambda: gripper.state().ready)
    assert [finger.opening for finger in line.fingers] == pytest.approx([2500 * (1 - 1.7 / 1.94)] * 2, abs=40)


def test_fingers_that_do_not_come_to_a_stop_are_not_calibrated(
    make_gripper: MakeGripper, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("modular_framework_drivers.ezgripper.gripper_servos.CALIBRATION_TIMEOUT_S", 0.5)
    line, gripper = make_gripper()
    line.fingers[0].model = replace(line.fingers[0].model, closed_ticks=-1e6)
    gripper.start()
    until(lambda: "still moved after" in gripper.state().fault)
    assert not gripper.state().ready


def test_an_object_on_offer_does_not_spoil_the_calibration(make_gripper: MakeGripper) -> None:
    line, gripper = make_gripper(start_position=1.6)
    line.offer_object(1.77)
    gripper.start()
    until(lambda: gripper.state().ready)
    state = arrive(gripper, 1.94, 300)
    assert (state.motion, state.reading.position) == (Motion.HOLDING, pytest.approx(1.77, abs=0.05))


def test_closed_it_leaves_the_fingers_with_little_torque(make_gripper: MakeGripper) -> None:
    line, gripper = make_gripper()
    gripper.start()
    until(lambda: gripper.state().ready)
    line.place_object(1.77)
    assert arrive(gripper, 1.94, 300).motion is Motion.HOLDING
    gripper.close()
    assert line.fingers[0].servo.get(mx64.TORQUE_LIMIT) == 100
    time.sleep(0.1)
    assert line.fingers[0].opening == pytest.approx(2500 * (1 - 1.77 / 1.94), abs=30)


@pytest.mark.parametrize(
    ("position", "torque", "hint"),
    [
        (2.0, 400, r"position 2.0 rad is outside \[0, 1.94\]"),
        (float("nan"), 400, "position nan"),
        (1.0, 1024, r"torque 1024 is outside \[0, 1023\]"),
    ],
)
def test_goals_out_of_limits_are_refused(position: float, torque: int, hint: str) -> None:
    with pytest.raises(ValueError, match=hint):
        EzGripper(GripperSettings("/dev/null")).command(position, torque)
