# SPDX-License-Identifier: BSD-3-Clause
"""The driver of UR arms against the emulated controller: it follows, says what is wrong, and comes back."""

from __future__ import annotations

import contextlib
import itertools
import logging
import math
import os
import re
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from modular_framework_control.hardware_interface.handles import JointHandle
from modular_framework_control.hardware_interface.interfaces import (
    ForceTorqueSensorInterface,
    PositionJointInterface,
    SpeedScalingInterface,
)
from modular_framework_drivers.ur.ur_arm_robot_hw import UrArmHardware
from modular_framework_ros.node_handle import MappingNodeHandle
from modular_framework_testing.emulators.ur_emulator_process import EmulatedArm

PERIOD_S = 0.008
LINK_TIMEOUT_S = 2.0  # a busy host may take a processor away for a second
PATIENCE_S = 60.0  # longer than an upload that hangs and the next one


class Rig:
    """A driver, its emulated arm and a control loop."""

    def __init__(self, arm: EmulatedArm, **parameters: Any) -> None:
        self.arm = arm
        self.hw = UrArmHardware()
        values = {"robot_ip_address": arm.address, "link_timeout": LINK_TIMEOUT_S, **parameters}
        assert self.hw.init(MappingNodeHandle({}), MappingNodeHandle(values, "/arm_hw"))
        self._next_s = time.monotonic()

    @property
    def handles(self) -> list[JointHandle]:
        return self.hw.get(PositionJointInterface).handles

    @property
    def positions(self) -> list[float]:
        return [handle.position for handle in self.handles]

    def cycle(self, commands: Sequence[float] | None = None) -> None:
        self.hw.read(self._next_s, PERIOD_S)
        for handle, command in zip(self.handles, commands or (), strict=commands is not None):
            handle.command = command
        self.hw.write(self._next_s, PERIOD_S)
        self._next_s = max(self._next_s + PERIOD_S, time.monotonic() - 0.1)
        time.sleep(max(0.0, self._next_s - time.monotonic()))

    def run(self, duration_s: float, commands: Sequence[float] | None = None) -> None:
        for _ in range(round(duration_s / PERIOD_S)):
            self.cycle(commands)

    def until(self, condition: Callable[[], bool]) -> None:
        deadline_s = time.monotonic() + PATIENCE_S
        while not condition():
            assert time.monotonic() < deadline_s, self.hw.fault()
            self.cycle()

    def resume(self) -> str:
        answer: list[str] = []
        caller = threading.Thread(target=lambda: answer.append(self.hw.resume(PATIENCE_S)))
        caller.start()
        self.until(lambda: not caller.is_alive())
        return answer[0]


@pytest.fixture(scope="module")
def arm() -> Iterator[EmulatedArm]:
    emulated = EmulatedArm()
    yield emulated
    emulated.close()


@pytest.fixture
def make_rig(arm: EmulatedArm) -> Iterator[Callable[..., Rig]]:
    rigs: list[Rig] = []

    def make(ready: bool = True, **parameters: Any) -> Rig:
        rigs.append(Rig(arm, **parameters))
        if ready:
            rigs[-1].until(lambda: rigs[-1].hw.ready)
        return rigs[-1]

    yield make
    for rig in rigs:
        rig.hw.close()
    arm.command("restore")
    arm.command("release_emergency_stop")
    arm.command("unlock")
    arm.command("power_on")
    arm.command("slider", value=1.0)


@pytest.fixture
def single_processor() -> Iterator[None]:
    """Restricts this process and the processes that it starts to one processor."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    yield
    os.sched_setaffinity(0, allowed)


@pytest.fixture(scope="module")
def running() -> Iterator[Rig]:
    """A driver with an emulated arm of its own; it outlives faults, so tests share it."""
    emulated = EmulatedArm()
    shared = Rig(emulated)
    shared.until(lambda: shared.hw.ready)
    yield shared
    shared.hw.close()
    emulated.close()


@pytest.fixture
def rig(running: Rig) -> Rig:
    """The shared driver, following an arm that is well."""
    for command in ("restore", "release_emergency_stop", "unlock", "power_on"):
        running.arm.command(command)
    running.arm.command("slider", value=1.0)
    running.cycle()
    running.until(lambda: running.resume() == "")  # what was ordered is known to the driver a little later
    running.until(lambda: running.hw.ready)
    running.run(0.1, running.positions)
    return running


def test_it_starts_says_what_it_does_and_leaves_the_arm_where_it_is(
    make_rig: Callable[..., Rig], caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO, "rosout.ur_arm")
    rig = make_rig(
        payload_mass_kg=0.4,
        payload_center_of_mass_m=[0.0, 0.0, 0.05],
        speed_scale=0.5,
        control_pc_ip_address="192.168.56.1",
        robot_program_path="",
    )
    before = rig.positions
    rig.run(0.3)
    assert rig.positions == pytest.approx(before, abs=1e-6)
    assert rig.arm.positions() == pytest.approx(before, abs=1e-6)
    assert rig.arm.state()["payload_kg"] == "0.4"
    assert rig.arm.state()["slider"] == "0.5"
    assert rig.hw.get(SpeedScalingInterface).handles[0].factor == pytest.approx(0.5)
    assert rig.hw.get(ForceTorqueSensorInterface).get_handle("wrench").frame_id == "base"  # a link of the description
    unused = [record.getMessage() for record in caplog.records if "not used" in record.getMessage()]
    assert len(unused) == 1 and "control_pc_ip_address" in unused[0] and "robot_program_path" not in unused[0]


def test_it_follows_a_motion(rig: Rig) -> None:
    start, worst = rig.positions, 0.0
    for step in range(200):
        goal = list(start)
        goal[0] += 0.2 * (1.0 - math.cos(2.0 * math.pi * step / 199.0))
        rig.cycle(goal)
        worst = max(worst, abs(rig.positions[0] - goal[0]))
        assert rig.hw.fault() == ""
    rig.run(0.3, start)
    assert worst < 0.15  # what a lookahead of 0.03 s and a busy machine explain, at 0.79 rad/s
    assert rig.positions == pytest.approx(start, abs=1e-3)


def test_the_wrench_at_the_tool_is_a_sensor(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig(robot_id="left")
    rig.arm.command("wrench", fx=1.0, fz=-9.5, ty=0.25)
    sensor = rig.hw.get(ForceTorqueSensorInterface).get_handle("left_wrench")
    rig.until(lambda: sensor.force == (1.0, 0.0, -9.5))
    assert sensor.torque == (0.0, 0.25, 0.0) and sensor.frame_id == "left_base"
    assert rig.handles[0].name == "left_shoulder_pan_joint"
    rig.arm.command("wrench")


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        ("protective_stop", "protective stop of the arm"),
        ("emergency_stop", "emergency stop of the arm"),
        ("stop_program", "the program on the arm was stopped"),
        ("cut", "connection to the arm"),
        ("freeze", "connection to the arm"),
    ],
)
def test_a_fault_is_reported_the_arm_holds_and_comes_back_on_resume(rig: Rig, command: str, reason: str) -> None:
    start = rig.positions
    commands = ([position + 0.001 * step for position in start] for step in itertools.count())
    for _ in range(40):
        rig.cycle(next(commands))
    rig.arm.command(command)
    deadline_s = time.monotonic() + PATIENCE_S
    while rig.hw.fault() == "":
        assert time.monotonic() < deadline_s
        rig.cycle(next(commands))
    assert reason in rig.hw.fault()
    position_at_report = rig.arm.positions()
    rig.run(0.2)
    rest_position = rig.arm.positions()
    assert rest_position == pytest.approx(position_at_report, abs=0.02)  # its way to rest, from 0.125 rad/s
    rig.run(0.2)
    assert rig.hw.fault() != "" and rig.arm.positions() == pytest.approx(rest_position, abs=1e-4)
    for remedy in ("restore", "unlock", "release_emergency_stop", "power_on"):
        rig.arm.command(remedy)
    rig.until(lambda: "accepts no commands" in rig.hw.fault() and "call resume" in rig.hw.fault())
    rig.run(0.2)
    assert "resume" in rig.hw.fault(), "it must not go on by itself"
    assert rig.arm.positions() == pytest.approx(rest_position, abs=1e-4)
    assert [handle.command for handle in rig.handles] == pytest.approx(rest_position, abs=1e-4)
    assert rig.resume() == "" and rig.hw.fault() == ""
    rig.run(0.3)
    assert rig.arm.positions() == pytest.approx(rest_position, abs=1e-4)
    rig.cycle(start)
    rig.until(lambda: rig.positions == pytest.approx(start, abs=1e-3))


def test_random_bytes_are_a_named_fault_or_endured_by_an_arm_that_follows(rig: Rig) -> None:
    """The library behind the driver ends the connection, connects again, or waits for the rest of a long package.

    In the last case, commands still reach the arm until the timeout of the link.
    """
    start, sent_at = rig.positions, 40
    for step in range(sent_at + round((LINK_TIMEOUT_S + 1.0) / PERIOD_S)):
        if step == sent_at:
            rig.arm.command("garbage")
        goal = [position + 0.001 * step for position in start]
        rig.cycle(goal)
        if rig.hw.fault():
            assert "connection to the arm" in rig.hw.fault()
            return
    rig.run(0.3, goal)
    assert rig.arm.positions() == pytest.approx(goal, abs=1e-3)
    rig.cycle(start)
    rig.until(lambda: rig.positions == pytest.approx(start, abs=1e-3))


def test_resume_says_what_is_to_be_done_first(rig: Rig) -> None:
    rig.arm.command("protective_stop")
    rig.until(lambda: rig.hw.fault() != "")
    assert "unlock_protective_stop" in rig.resume()
    rig.arm.command("unlock")
    rig.arm.command("emergency_stop")
    rig.until(lambda: "emergency" in rig.hw.fault())
    assert "power_on" in rig.resume()


def test_resume_does_not_raise_a_slider_that_was_lowered_but_lowers_one_that_was_raised(
    make_rig: Callable[..., Rig],
) -> None:
    rig = make_rig(speed_scale=0.5)
    scaling = rig.hw.get(SpeedScalingInterface).handles[0]
    for value, expected in ((0.1, 0.1), (1.0, 0.5)):
        rig.arm.command("slider", value=value)
        rig.until(lambda value=value: scaling.factor == pytest.approx(value))
        rig.arm.command("protective_stop")
        rig.until(lambda: rig.hw.fault() != "")
        rig.arm.command("unlock")
        rig.until(lambda: rig.resume() == "")
        assert float(rig.arm.state()["slider"]) == pytest.approx(expected)


def test_an_arm_that_is_switched_on_later_is_waited_for(make_rig: Callable[..., Rig], arm: EmulatedArm) -> None:
    arm.command("emergency_stop")
    arm.command("release_emergency_stop")
    rig = make_rig(ready=False)
    rig.until(lambda: "has no power" in rig.hw.fault())
    arm.command("power_on")
    rig.until(lambda: rig.hw.ready)


def test_an_arm_that_cannot_be_reached_is_named_and_waited_for(make_rig: Callable[..., Rig], arm: EmulatedArm) -> None:
    arm.command("cut")
    rig = make_rig(ready=False)
    rig.until(lambda: "Could not connect" in rig.hw.fault())
    assert arm.address in rig.hw.fault()
    arm.command("restore")
    rig.until(lambda: rig.hw.ready)


def test_a_pause_is_no_fault_but_stops_the_clock(rig: Rig) -> None:
    scaling = rig.hw.get(SpeedScalingInterface).handles[0]
    assert scaling.factor == 1.0 and scaling.joints == tuple(handle.name for handle in rig.handles)
    rig.arm.command("slider", value=0.1)
    rig.until(lambda: scaling.factor == pytest.approx(0.1))
    rig.arm.command("pause")
    rig.until(lambda: scaling.factor == 0.0)
    assert rig.hw.fault() == ""
    rig.arm.command("play")
    rig.until(lambda: scaling.factor == pytest.approx(0.1))
    start = rig.positions
    rig.run(1.0, [position + 0.05 for position in start])
    assert rig.positions == pytest.approx([position + 0.05 for position in start], abs=1e-3)


def test_a_pause_in_the_midst_of_commands_is_none_either(rig: Rig) -> None:
    start = rig.positions
    for step in range(300):
        if step % 30 == 10:
            rig.arm.command("pause")
        elif step % 30 == 20:
            rig.arm.command("play")
        rig.cycle([position + 0.0003 * step for position in start])
        assert rig.hw.fault() == ""
    rig.run(0.5, [position + 0.09 for position in start])
    assert rig.positions == pytest.approx([position + 0.09 for position in start], abs=1e-3)


def processes(rig: Rig) -> dict[str, Path]:
    """Folders in /proc of the emulator and of the driver's two processes, by role."""
    modules = {"modular_framework_testing.emulators.ur_emulator", "modular_framework_drivers.ur.rtde_process"}
    found = {}
    for entry in Path("/proc").iterdir():
        with contextlib.suppress(OSError):
            line = (entry / "cmdline").read_bytes().decode().split("\0") if entry.name.isdigit() else []
            if modules & set(line) and rig.arm.address in line:
                found[line[3] if line[3] in ("state", "control") else "emulator"] = entry
    return found


def scheduling(rig: Rig) -> dict[str, list[tuple[int, int]]]:
    """Policy and priority of all threads of these processes, the main thread first."""
    return {
        role: [
            (os.sched_getscheduler(thread), os.sched_getparam(thread).sched_priority)
            for thread in map(int, sorted((task.name for task in (entry / "task").iterdir()), key=entry.name.__ne__))
        ]
        for role, entry in processes(rig).items()
    }


def test_the_processes_that_hold_the_link_run_in_real_time_where_that_is_permitted_and_wanted(
    make_rig: Callable[..., Rig], real_time_permitted: bool
) -> None:
    def check(**priorities: tuple[int, int]) -> None:
        found = scheduling(rig)
        assert set(found) == set(priorities)
        for role, (main, *others) in found.items():
            assert others, role  # ur-rtde and the command port have threads
            for thread, wanted in zip((main, max(others)), priorities[role], strict=True):
                wanted *= real_time_permitted
                assert thread == (os.SCHED_FIFO if wanted else os.SCHED_OTHER, wanted), role

    rig = make_rig()
    check(state=(50, 60), control=(50, 60), emulator=(65, 55))
    rig.arm.command("cut")
    rig.until(lambda: rig.hw.fault() != "")
    rig.arm.command("restore")
    rig.until(lambda: rig.resume() == "")
    check(state=(50, 60), control=(50, 60), emulator=(65, 55))
    rig.hw.close()
    rig = make_rig(real_time=False)
    check(state=(0, 0), control=(0, 0), emulator=(65, 55))


@pytest.mark.parametrize("command", [math.nan, 7.0, 1.0])
def test_a_command_that_cannot_be_meant_is_refused_and_the_arm_holds(rig: Rig, command: float) -> None:
    start = rig.positions
    bad = list(start)
    bad[2] = start[2] + command
    rig.run(0.2, bad)
    assert "joint 'elbow_joint'" in rig.hw.fault()
    assert rig.positions == pytest.approx(start, abs=1e-6)
    rig.run(0.1, start)
    assert rig.hw.fault() == ""


def test_packages_that_come_late_or_not_at_all_do_not_move_the_arm_elsewhere(rig: Rig) -> None:
    start = rig.positions
    rig.arm.command("lose", every=3)
    rig.arm.command("delay", seconds=0.05)
    for step in range(100):
        rig.cycle([position + 0.2 * step / 99.0 for position in start])
    rig.run(0.5, [position + 0.2 for position in start])
    assert rig.hw.fault() == ""
    assert rig.arm.positions() == pytest.approx([position + 0.2 for position in start], abs=1e-3)
    rig.arm.command("restore")
    rig.run(1.0, start)


def test_flipped_bits_are_endured_or_named_and_never_read_as_a_mode(rig: Rig) -> None:
    start = rig.positions
    rig.arm.command("corrupt", every=3)
    for _ in range(250):
        rig.cycle(start)
        assert rig.hw.fault() == ""
    rig.arm.command("corrupt", every=1)
    rig.until(lambda: rig.hw.fault() != "")
    assert "only damaged data from the arm" in rig.hw.fault() or "closed the connection" in rig.hw.fault()


def test_a_slow_link_is_a_warning_and_one_slower_than_the_timeout_is_lost(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig(link_timeout=1.0)
    rig.arm.command("delay", seconds=0.2)
    rig.until(lambda: re.search(r"states of the arm at \S+ come 0\.[23]\d s late", rig.hw.warning()) is not None)
    rig.arm.command("delay", seconds=1.2)
    rig.until(lambda: "connection to the arm" in rig.hw.fault())
    rig.until(lambda: "s late, longer than link_timeout (1 s)" in rig.hw.fault())


def test_closing_stops_the_arm_and_its_program(make_rig: Callable[..., Rig]) -> None:
    rig = make_rig()
    rig.hw.close()
    rig.hw.close()
    state = rig.arm.state()
    assert (state["runtime_state"], state["connections"]) == ("STOPPED", "0")


def test_closing_stops_the_program_on_a_single_processor(single_processor: None) -> None:
    del single_processor
    emulated = EmulatedArm()
    rig = Rig(emulated)
    try:
        rig.until(lambda: rig.hw.ready)
        rig.hw.close()
        assert emulated.state()["runtime_state"] == "STOPPED"
    finally:
        rig.hw.close()
        emulated.close()


def test_closing_reports_a_program_that_was_not_stopped(
    make_rig: Callable[..., Rig], caplog: pytest.LogCaptureFixture
) -> None:
    rig = make_rig()
    os.kill(int(processes(rig)["control"].name), signal.SIGSTOP)
    rig.hw.close()
    assert rig.arm.state()["runtime_state"] == "PLAYING"
    assert f"arm at {rig.arm.address}: the program was not stopped within 3 s" in caplog.text


def test_an_emulator_that_is_killed_is_a_lost_link(tmp_path: Any) -> None:
    other = EmulatedArm()
    rig = Rig(other)
    rig.until(lambda: rig.hw.ready)
    other.kill()
    rig.until(lambda: rig.hw.fault() != "")
    assert "connection to the arm" in rig.hw.fault()
    rig.hw.close()
    other.close()


@pytest.mark.parametrize(
    ("parameters", "said"),
    [
        ({}, "robot_ip_address"),
        ({"robot_ip_address": "x", "speed_scale": 2.0}, "speed_scale"),
        ({"robot_ip_address": "x", "payload_mass_kg": "heavy"}, "payload_mass_kg"),
        ({"robot_ip_address": "x", "payload_center_of_mass_m": [0.0]}, "payload_center_of_mass_m"),
        ({"robot_ip_address": "x", "robot_id": 7}, "robot_id"),
        ({"robot_ip_address": "x", "servoj_gain": 5}, "servoj_gain"),
    ],
)
def test_a_wrong_parameter_is_named(parameters: dict[str, Any], said: str, caplog: pytest.LogCaptureFixture) -> None:
    assert UrArmHardware().init(MappingNodeHandle({}), MappingNodeHandle(parameters, "/arm_hw")) is False
    assert f"/arm_hw/{said}" in caplog.text
