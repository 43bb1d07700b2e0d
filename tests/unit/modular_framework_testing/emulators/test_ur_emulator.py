# SPDX-License-Identifier: BSD-3-Clause
"""The emulated controller as the unmodified ur-rtde client sees it.

The client runs in a process of its own: it stops the whole interpreter while it connects.
"""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from modular_framework_drivers.ur.dashboard import DashboardError, request_dashboard
from modular_framework_testing.emulators.command_port import CommandError
from modular_framework_testing.emulators.ur_emulator_process import EmulatedArm

HOME = [0.0, -1.5707963267948966, 0.0, -1.5707963267948966, 0.0, 0.0]


@pytest.fixture(scope="module")
def arm() -> Iterator[EmulatedArm]:
    emulated = EmulatedArm("UR5e")
    yield emulated
    emulated.close()


UNTIL = """
def until(condition):
    end = time.monotonic() + 20.0
    while not condition():
        assert time.monotonic() < end, "the condition did not hold within 20 s"
        time.sleep(0.01)
"""
"""A function for client code: the client sees a change some packages later."""


def client(arm: EmulatedArm, code: str) -> Any:
    """Run client code that ends with a value in `answer`; returns the value."""
    head = (
        "import json, math, time\nfrom rtde_control import RTDEControlInterface\n"
        "from rtde_receive import RTDEReceiveInterface\nfrom rtde_io import RTDEIOInterface\n"
        f"from dashboard_client import DashboardClient\naddress = {arm.address!r}\n"
        f"{UNTIL}"
    )
    tail = "\nprint('answer', json.dumps(answer), flush=True)\n"
    done = subprocess.run(
        [sys.executable, "-c", head + textwrap.dedent(code) + tail],
        capture_output=True,
        text=True,
        timeout=40.0,
        check=False,
    )
    lines = [line for line in done.stdout.splitlines() if line.startswith("answer ")]
    assert lines, done.stdout + done.stderr
    return json.loads(lines[-1][7:])


@pytest.mark.parametrize("model", ["UR5", "UR5e"])
def test_the_client_reads_every_variable_it_asks_for_by_default(model: str) -> None:
    arm = EmulatedArm(model)
    answer = client(
        arm,
        """
        arm = RTDEReceiveInterface(address)
        first = arm.getTimestamp()
        time.sleep(0.5)
        answer = [arm.getActualQ(), arm.getActualQd(), arm.getRobotMode(), arm.getSafetyMode(), arm.getRuntimeState(),
                  arm.getSpeedScaling(), arm.getTimestamp() - first, arm.getActualTCPPose()[:3]]
        """,
    )
    arm.close()
    positions, velocities, robot_mode, safety_mode, runtime_state, scaling, passed_s, flange = answer
    assert positions == pytest.approx(HOME) and velocities == [0.0] * 6
    assert (robot_mode, safety_mode, runtime_state, scaling) == (7, 1, 1, 1.0)
    assert 0.3 < passed_s < 3.0
    assert flange == pytest.approx([0.0, -0.19145, 1.001059])


def test_the_client_uploads_its_program_streams_and_is_stopped(arm: EmulatedArm, tmp_path: Path) -> None:
    log = tmp_path / "path.csv"
    arm.command("log", path=log)
    before, moved, after, stopped, running = client(
        arm,
        """
        arm, control = RTDEReceiveInterface(address), RTDEControlInterface(address)
        before = control.isProgramRunning()
        start = arm.getActualQ()
        for step in range(100):
            begun = control.initPeriod()
            target = list(start)
            target[5] += 0.4 * (1.0 - math.cos(math.pi * step / 99.0)) / 2.0
            assert control.servoJ(target, 0.0, 0.0, 0.008, 0.03, 2000)
            control.waitPeriod(begun)
        until(lambda: abs(arm.getActualQ()[5] - start[5] - 0.4) < 1e-3)
        moved = arm.getActualQ()[5] - start[5]
        stopped = control.servoStop(10.0)
        after = arm.getActualQd()
        control.moveJ(start, 2.0, 5.0)
        control.stopScript()
        answer = [before, moved, after, stopped, control.isProgramRunning()]
        """,
    )
    arm.command("end_log")
    assert before is True and stopped is True and running is False
    assert moved == pytest.approx(0.4, abs=1e-3)
    assert max(map(abs, after)) < 1e-3
    assert arm.positions() == pytest.approx(HOME, abs=1e-4)
    head, *lines = log.read_text().splitlines()
    assert head.startswith("wall_s,controller_s,command_0")
    commanded = [float(line.split(",")[7]) for line in lines]
    assert commanded[0] == pytest.approx(0.0, abs=1e-2) and commanded[-1] == pytest.approx(0.4)
    assert commanded == sorted(commanded)


def test_the_log_has_every_cycle_when_asked_to_and_else_streamed_positions(arm: EmulatedArm, tmp_path: Path) -> None:
    def lines(**arguments: object) -> list[str]:
        arm.command("log", path=tmp_path / "log.csv", **arguments)
        time.sleep(0.3)
        arm.command("end_log")
        return (tmp_path / "log.csv").read_text().splitlines()[1:]

    assert lines() == []
    clock_s = [float(line.split(",")[1]) for line in lines(always=True)]
    assert len(clock_s) > 20
    steps_s = [after - before for before, after in itertools.pairwise(clock_s)]
    assert steps_s == pytest.approx([0.002] * len(steps_s))


def test_a_second_program_replaces_the_first(arm: EmulatedArm) -> None:
    assert client(
        arm,
        """
        first = RTDEControlInterface(address)
        first.disconnect()
        second = RTDEControlInterface(address)
        answer = [second.isProgramRunning(), second.setPayload(1.5, [0.0, 0.0, 0.1])]
        second.stopScript()
        """,
    ) == [True, True]
    assert arm.state()["payload_kg"] == "1.5"


def test_the_speed_slider_is_set_and_read(arm: EmulatedArm) -> None:
    assert client(
        arm,
        """
        arm, panel = RTDEReceiveInterface(address), RTDEIOInterface(address)
        panel.setSpeedSlider(0.4)
        until(lambda: arm.getTargetSpeedFraction() < 1.0)
        answer = arm.getTargetSpeedFraction()
        panel.setSpeedSlider(1.0)
        """,
    ) == pytest.approx(0.4)


def test_a_protective_stop_ends_the_program_and_is_unlocked(arm: EmulatedArm) -> None:
    answer = client(
        arm,
        """
        arm, control, dashboard = RTDEReceiveInterface(address), RTDEControlInterface(address), DashboardClient(address)
        dashboard.connect()
        control.triggerProtectiveStop()
        until(lambda: arm.isProtectiveStopped() and not control.isProgramRunning())
        stopped = [arm.isProtectiveStopped(), arm.getSafetyMode(), control.isProgramRunning(), dashboard.safetymode()]
        refused = control.servoJ(arm.getActualQ(), 0.0, 0.0, 0.008, 0.03, 2000)
        dashboard.unlockProtectiveStop()
        until(lambda: not arm.isProtectiveStopped())
        control.reuploadScript()
        until(control.isProgramRunning)
        answer = [stopped, refused, arm.isProtectiveStopped(), control.isProgramRunning()]
        control.stopScript()
        """,
    )
    assert answer == [[True, 3, False, "Safetymode: PROTECTIVE_STOP"], False, False, True]


def test_after_an_emergency_stop_the_arm_is_powered_on_from_the_dashboard(arm: EmulatedArm) -> None:
    arm.command("emergency_stop")
    assert request_dashboard(arm.address, "safetymode") == "Safetymode: ROBOT_EMERGENCY_STOP"
    assert request_dashboard(arm.address, "brake release") == "Brake releasing"
    assert arm.state()["robot_mode"] == "POWER_OFF"
    arm.command("release_emergency_stop")
    request_dashboard(arm.address, "power on")
    assert arm.state()["robot_mode"] == "IDLE"
    request_dashboard(arm.address, "brake release")
    assert arm.state()["robot_mode"] == "RUNNING"


def test_a_pause_holds_the_arm_where_it_is_until_play(arm: EmulatedArm) -> None:
    paused, resumed = client(
        arm,
        """
        arm, control, dashboard = RTDEReceiveInterface(address), RTDEControlInterface(address), DashboardClient(address)
        dashboard.connect()
        start = arm.getActualQ()
        target = list(start)
        target[0] += 0.3
        control.servoJ(target, 0.0, 0.0, 0.008, 0.1, 300)
        time.sleep(0.05)
        dashboard.pause()
        until(lambda: arm.getRuntimeState() == 4 and max(map(abs, arm.getActualQd())) < 1e-6)
        before = arm.getActualQ()[0]
        time.sleep(0.3)
        paused = [arm.getRuntimeState(), arm.getSpeedScaling(), arm.getActualQ()[0] - before]
        dashboard.play()
        until(lambda: abs(arm.getActualQ()[0] - start[0] - 0.3) < 1e-3)
        answer = [paused, arm.getActualQ()[0] - start[0]]
        control.moveJ(start, 2.0, 5.0)
        control.stopScript()
        """,
    )
    assert paused == [4, 0.0, 0.0]
    assert resumed == pytest.approx(0.3, abs=1e-3)


def test_it_says_what_it_does_not_run(arm: EmulatedArm) -> None:
    assert client(
        arm,
        """
        control = RTDEControlInterface(address)
        answer = [control.moveL([0.1, -0.3, 0.5, 0.0, 3.1, 0.0], 0.25, 1.2), control.isProgramRunning()]
        """,
    ) == [False, False]


def test_a_lost_link_refuses_connections_until_it_is_restored(arm: EmulatedArm) -> None:
    arm.command("cut")
    with pytest.raises(DashboardError, match="got no answer"):
        request_dashboard(arm.address, "robotmode", 1.0)
    arm.command("restore")
    assert request_dashboard(arm.address, "robotmode") == "Robotmode: RUNNING"


def test_a_frozen_link_lets_nothing_through_though_connections_open(arm: EmulatedArm) -> None:
    arm.command("freeze")
    with pytest.raises(DashboardError, match="timed out"):
        request_dashboard(arm.address, "robotmode", 0.3)
    arm.command("restore")
    assert request_dashboard(arm.address, "robotmode") == "Robotmode: RUNNING"


def test_delayed_packages_come_late(arm: EmulatedArm) -> None:
    arm.command("delay", seconds=0.3)
    begun_s = time.monotonic()
    request_dashboard(arm.address, "robotmode")
    assert time.monotonic() - begun_s >= 0.6  # the greeting and the answer
    arm.command("restore")


@pytest.mark.parametrize(
    ("command", "arguments", "allowed"),
    [
        ("slider", {"value": 1.2}, "from 0 to 1"),
        ("delay", {"seconds": -1}, "at least 0"),
        ("lose", {"every": -1}, "at least 0"),
        ("explode", {}, "known: help"),
        ("slider", {}, "value"),
    ],
)
def test_an_order_that_cannot_be_carried_out_says_what_can(
    arm: EmulatedArm, command: str, arguments: dict[str, float], allowed: str
) -> None:
    with pytest.raises(CommandError, match=allowed):
        arm.command(command, **arguments)
