# SPDX-License-Identifier: BSD-3-Clause
"""What the driver of UR arms sends, and how it treats its helper processes, without any arm."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest

from modular_framework_control.hardware_interface.interfaces import PositionJointInterface
from modular_framework_drivers.ur import rtde_link, ur_arm_robot_hw
from modular_framework_drivers.ur.arm_messages import ACCEPTED, READY, ArmState
from modular_framework_drivers.ur.rtde_link import LinkSettings, RtdeLink
from modular_framework_drivers.ur.rtde_process import command_line
from modular_framework_drivers.ur.ur_arm_robot_hw import UrArmHardware
from modular_framework_ros.node_handle import MappingNodeHandle

PERIOD_S = 0.008
RUNNING, NORMAL, STOPPED, PLAYING, PAUSED = 7, 1, 1, 2, 4
ZEROS = (0.0,) * 6


class FakeLink:
    """A link to an arm that is, in each cycle, where it was sent."""

    made: FakeLink

    def __init__(self, settings: LinkSettings) -> None:
        del settings
        FakeLink.made = self
        self.lost = self.program_failure = ""
        self.program_failed_s = self.program_ready_s = 0.0
        self.start_step = ""
        self.commanding = True
        self.positions: Sequence[float] = ZEROS
        self.velocities: tuple[float, ...] = ZEROS
        self.runtime_state = PLAYING
        self.sent: list[list[float]] = []

    @property
    def state(self) -> ArmState:
        return ArmState(
            received_s=time.monotonic(),
            timestamp_s=0.0,
            positions=tuple(self.positions),
            velocities=self.velocities,
            currents=ZEROS,
            wrench=ZEROS,
            speed_fraction=1.0,
            speed_scaling=1.0,
            robot_mode=RUNNING,
            safety_mode=NORMAL,
            runtime_state=self.runtime_state,
        )

    def servo(self, positions: Sequence[float], time_s: float) -> bool:
        self.sent.append(list(positions))
        self.positions = list(positions)
        return True

    def connect(self) -> None: ...

    def request_program(self) -> None: ...

    def drop_program(self, reason: str) -> None:
        self.commanding, self.program_failure = False, reason

    def poll(self) -> None: ...

    def close(self) -> None: ...


@pytest.fixture
def hw(monkeypatch: pytest.MonkeyPatch) -> UrArmHardware:
    monkeypatch.setattr(ur_arm_robot_hw, "RtdeLink", FakeLink)
    made = UrArmHardware()
    assert made.init(MappingNodeHandle({}), MappingNodeHandle({"robot_ip_address": "nowhere"}, "/arm_hw"))
    return made


def run(hw: UrArmHardware, cycles: int, command: Callable[[int], float]) -> None:
    for cycle in range(cycles):
        hw.read(0.0, PERIOD_S)
        for handle in hw.get(PositionJointInterface).handles:
            handle.command = command(cycle)
        hw.write(0.0, PERIOD_S)


def test_what_a_paused_arm_was_commanded_meanwhile_is_not_caught_up_with_in_a_jump(hw: UrArmHardware) -> None:
    link = FakeLink.made
    run(hw, 10, lambda cycle: 0.0)
    link.runtime_state = PAUSED
    before = len(link.sent)
    run(hw, 300, lambda cycle: 0.001 * cycle)
    assert len(link.sent) == before
    link.runtime_state = PLAYING
    run(hw, 300, lambda cycle: 0.3)
    way = np.array([ZEROS, *link.sent[before:]])
    speeds = np.diff(way, axis=0) / PERIOD_S
    assert np.abs(speeds).max() <= np.pi * 1.001
    assert np.abs(np.diff(speeds, axis=0, prepend=0.0)).max() <= 40.0 * PERIOD_S * 1.001
    assert way[-1] == pytest.approx([0.3] * 6)


def test_joints_that_are_held_in_a_motion_brake_and_do_not_come_back(hw: UrArmHardware) -> None:
    link, handles = FakeLink.made, hw.get(PositionJointInterface).handles
    run(hw, 30, lambda cycle: 0.008 * cycle)
    link.velocities = (1.0,) * 6
    hw.read(0.0, PERIOD_S)
    for handle in handles:
        handle.hold(handle.position - 0.02)  # measured late
    first = len(link.sent)
    for _ in range(100):
        hw.write(0.0, PERIOD_S)
        hw.read(0.0, PERIOD_S)
        link.velocities = ZEROS
    way = np.array(link.sent[first - 1 :])[:, 0]
    assert (np.diff(way) >= -1e-9).all()
    assert 0.0 < way[-1] - way[0] < 0.05 + 1.0 / (2.0 * 0.9 * 40.0)
    assert handles[0].command == pytest.approx(way[-1])


@pytest.mark.parametrize("pause_s", [0.1, 0.45, 3600.0])
def test_a_cycle_that_comes_late_is_caught_up_with_as_fast_as_the_arm_may(hw: UrArmHardware, pause_s: float) -> None:
    link = FakeLink.made
    run(hw, 10, lambda cycle: 0.0)
    link.sent.clear()
    hw.read(0.0, pause_s)
    for handle in hw.get(PositionJointInterface).handles:
        handle.command = 0.45
    hw.write(0.0, pause_s)
    assert max(link.sent[0]) <= 40.0 * 0.05 * 0.05 * 1.001, "no more than the arm may do in a twentieth of a second"
    run(hw, 100, lambda cycle: 0.45)
    way = np.array(link.sent)
    assert np.abs(np.diff(way, axis=0)).max() <= np.pi * PERIOD_S * 1.001
    assert way.max() <= 0.45 + 1e-3 and way[-1] == pytest.approx([0.45] * 6)


def test_a_program_that_ends_before_the_arm_follows_is_reported(hw: UrArmHardware) -> None:
    link = FakeLink.made
    link.runtime_state, link.program_ready_s = STOPPED, time.monotonic()
    hw.read(0.0, PERIOD_S)
    assert link.commanding, "the state may be older than the program"
    link.program_ready_s -= 2.0
    hw.read(0.0, PERIOD_S)
    assert not link.commanding
    assert hw.fault() == "the arm at nowhere accepts no commands: the program on the arm was stopped; call resume"


class FakeProcess:
    """A helper process that is ready at once, or cannot be started."""

    started: list[FakeProcess]
    refused: OSError | None
    mute: str  # role of the one that says nothing; of the one that reads, after its first message

    def __init__(self, module: str, arguments: Sequence[str]) -> None:
        if FakeProcess.refused is not None:
            raise FakeProcess.refused
        FakeProcess.started.append(self)
        self.role, self.arguments = arguments[0], arguments
        self.ended = False
        self._said = self._taken = False

    def messages(self) -> Iterator[bytes]:
        if self.role == FakeProcess.mute and (self._said or self.role == "control"):
            return
        if self.role == "state":
            self._said = True
            yield ArmState(
                received_s=time.monotonic(),
                timestamp_s=0.0,
                positions=ZEROS,
                velocities=ZEROS,
                currents=ZEROS,
                wrench=ZEROS,
                speed_fraction=1.0,
                speed_scaling=1.0,
                robot_mode=RUNNING,
                safety_mode=NORMAL,
                runtime_state=PLAYING,
            ).to_bytes()
        elif not self._said:
            self._said = True
            yield READY
        elif self._taken:
            self._taken = False
            yield ACCEPTED

    def send(self, message: bytes) -> bool:
        self._taken = True
        return True

    def end(self, patience_s: float = 0.0) -> None:
        self.ended = True


@pytest.fixture
def link(monkeypatch: pytest.MonkeyPatch) -> Iterator[RtdeLink]:
    FakeProcess.started, FakeProcess.refused, FakeProcess.mute = [], None, ""
    monkeypatch.setattr(rtde_link, "ChildProcess", FakeProcess)
    made = RtdeLink(LinkSettings("nowhere", timeout_s=0.12, retry_s=0.05))
    yield made
    made.close()


def until(link: RtdeLink, condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 10.0
    while not condition():
        assert time.monotonic() < deadline_s, link.lost
        link.poll()
        time.sleep(0.002)


def test_a_process_that_cannot_be_started_is_reported_and_tried_again(link: RtdeLink) -> None:
    FakeProcess.refused = OSError(24, "Too many open files")
    link.connect()
    link.request_program()
    until(link, lambda: "cannot be started: [Errno 24] Too many open files" in link.lost)
    FakeProcess.refused = None
    until(link, lambda: link.commanding)
    assert link.lost == ""


def test_a_program_asked_for_at_once_after_it_was_given_up_is_a_new_one(link: RtdeLink) -> None:
    link.connect()
    link.request_program()
    until(link, lambda: link.commanding)
    link.drop_program("the program on the arm was stopped")
    link.request_program()
    until(link, lambda: link.commanding)
    controls = [process for process in FakeProcess.started if process.role == "control"]
    assert [process.ended for process in controls] == [True, False]


def test_a_program_asked_for_while_one_is_ready_is_a_new_one(link: RtdeLink) -> None:
    link.connect()
    link.request_program()
    until(link, lambda: link.commanding)
    link.request_program()  # as resume does when the arm stopped before it followed
    assert not link.commanding
    until(link, lambda: link.commanding)
    controls = [process for process in FakeProcess.started if process.role == "control"]
    assert [process.ended for process in controls] == [True, False] and link.program_failure == ""


def test_small_and_negative_numbers_reach_the_process_that_commands_the_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    FakeProcess.started, FakeProcess.refused, FakeProcess.mute = [], None, ""
    monkeypatch.setattr(rtde_link, "ChildProcess", FakeProcess)
    settings = LinkSettings(
        "nowhere", timeout_s=5.0, speed_scale=0.00005, payload_kg=0.00002, payload_centre_m=(-0.00005, 0.0, -0.01)
    )
    link = RtdeLink(settings)
    link.request_program()
    link.connect()
    try:
        until(link, lambda: link.commanding)
    finally:
        link.close()
    control = next(process for process in FakeProcess.started if process.role == "control")
    options = command_line().parse_args([control.role, "7", *control.arguments[1:]])
    assert (options.speed_scale, options.payload) == (0.00005, 0.00002)
    assert options.payload_centre == [-0.00005, 0.0, -0.01]
    assert (options.lookahead, options.gain) == (0.03, 2000.0)


def test_a_control_loop_that_comes_late_does_not_take_the_link_for_lost(link: RtdeLink) -> None:
    link.connect()
    link.request_program()
    until(link, lambda: link.commanding)
    FakeProcess.mute = "state"
    for _ in range(3):
        time.sleep(0.4)
        link.poll()
        assert link.lost == "" and link.commanding


@pytest.mark.parametrize(
    ("role", "said"),
    [("state", "reads the arm's state has been silent"), ("control", "commands the arm has accepted no command")],
)
def test_a_process_that_hangs_is_reported_and_replaced(link: RtdeLink, role: str, said: str) -> None:
    link.connect()
    link.request_program()
    until(link, lambda: link.commanding)
    begun_s = time.monotonic()
    FakeProcess.mute = role
    while said not in (reason := link.lost + link.program_failure):
        assert time.monotonic() < begun_s + 10.0, reason
        link.servo(ZEROS, PERIOD_S)
        link.poll()
        time.sleep(0.005)
    assert time.monotonic() - begun_s > 0.4 and not link.commanding
    FakeProcess.mute = ""
    link.request_program()
    until(link, lambda: link.commanding)
    assert [process.ended for process in FakeProcess.started if process.role == role] == [True, False]


def test_a_link_that_is_lost_before_the_arm_ever_followed_needs_nobody_to_resume(link: RtdeLink) -> None:
    FakeProcess.mute = "control"
    link.connect()
    link.request_program()
    until(link, lambda: len(FakeProcess.started) == 2)
    FakeProcess.started[0].ended = True
    until(link, lambda: "ended" in link.lost)
    FakeProcess.mute = ""
    until(link, lambda: link.commanding)
    assert link.program_failure == ""


def test_an_upload_that_hangs_before_the_arm_ever_followed_is_tried_again(
    link: RtdeLink, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rtde_link, "START_TIMEOUT_S", 0.2)
    FakeProcess.mute = "control"
    link.connect()
    link.request_program()
    until(link, lambda: len(FakeProcess.started) == 3)
    assert [process.ended for process in FakeProcess.started] == [False, True, False] and link.program_failure == ""
    FakeProcess.mute = ""
    until(link, lambda: link.commanding)


def test_a_link_that_is_lost_afterwards_does(link: RtdeLink) -> None:
    link.connect()
    link.request_program()
    until(link, lambda: link.commanding)
    FakeProcess.started[0].ended = True
    until(link, lambda: "ended" in link.lost)
    until(link, lambda: link.lost == "")
    time.sleep(0.1)
    link.poll()
    assert not link.commanding and "ended with the lost connection" in link.program_failure
