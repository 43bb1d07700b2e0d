# SPDX-License-Identifier: BSD-3-Clause
"""The beat of the control loop: fixed times, cycles left out are counted, and no memory is used up."""
from __future__ import annotations

import gc
import os
import threading
import time
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_control import real_time
from modular_framework_control.cycle_pacer import RESOLUTION_S, CyclePacer, LoopStatistics
from modular_framework_control.trajectory import JointTrajectory, TrajectoryPoint
from modular_framework_control.trajectory_goal import TrajectoryGoal


class Clock:
    """Time that passes only when somebody sleeps or works, and oversleeps by a given time."""

    def __init__(self) -> None:
        self.now_s = 5.0
        self.oversleep_s = 0.0

    def __call__(self) -> float:
        return self.now_s

    def sleep(self, duration_s: float) -> None:
        assert duration_s > 0.0
        self.now_s += duration_s + self.oversleep_s


@given(st.lists(st.floats(0.0, 0.05), min_size=1, max_size=50), st.floats(0.0, 0.003))
def test_cycles_begin_at_multiples_of_the_period_and_what_is_left_out_is_counted(work_s: list[float],
                                                                                oversleep_s: float) -> None:
    clock = Clock()
    clock.oversleep_s = oversleep_s
    begun: list[tuple[float, float, int]] = []

    def cycle(late_s: float, missed: int) -> bool:
        begun.append((clock.now_s, late_s, missed))
        clock.now_s += work_s[len(begun) - 1]
        return len(begun) < len(work_s)

    CyclePacer(0.01, None, clock, clock.sleep).run(cycle)
    assert len(begun) == len(work_s) and begun[0] == (5.0, 0.0, 0)
    beats = 0
    for begun_s, late_s, missed in begun:
        assert late_s >= -1e-9
        assert begun_s - (5.0 + 0.01 * beats) == pytest.approx(late_s, abs=1e-9)
        assert missed == pytest.approx(late_s / 0.01, abs=1.0 + 1e-6) and missed >= 0
        beats += 1 + missed


def test_a_cycle_that_takes_longer_is_made_up_for_when_the_next_ones_are_short() -> None:
    clock = Clock()
    work_s = [0.002, 0.014, 0.002, 0.035, 0.002, 0.0]
    begun: list[tuple[float, int]] = []

    def cycle(late_s: float, missed: int) -> bool:
        begun.append((round(late_s * 1e3, 6), missed))
        clock.now_s += work_s[len(begun) - 1]
        return len(begun) < len(work_s)

    CyclePacer(0.01, None, clock, clock.sleep).run(cycle)
    assert begun == [(0.0, 0), (0.0, 0), (4.0, 0), (0.0, 0), (25.0, 2), (0.0, 0)]


PROCESSORS = (max(os.sched_getaffinity(0)),) * 2
"""The loop's and the stand-in's; they are told apart by their threads, so these tests run on one processor too."""


class Loop:
    """A loop of 5 ms with its stand-in; who is asleep when `taken_away` is set sleeps on until `given_back`."""

    def __init__(self, cycles: int) -> None:
        self.begun: list[tuple[str, float, int]] = []
        self.in_cycle = 0
        self.overlapped = False
        self.taken_away = {"loop": threading.Event(), "stand_in": threading.Event()}
        self.given_back = threading.Event()
        self._cycles = cycles
        self.pacer = CyclePacer(0.005, PROCESSORS, sleep=self._sleep)

    @staticmethod
    def who() -> str:
        return "stand_in" if threading.current_thread().name == "stand_in" else "loop"

    def _sleep(self, duration_s: float) -> None:
        time.sleep(duration_s)
        if self.taken_away[self.who()].is_set():
            assert self.given_back.wait(10.0)

    def cycle(self, late_s: float, missed: int) -> bool:
        self.in_cycle += 1
        self.overlapped |= self.in_cycle > 1
        self.begun.append((self.who(), late_s, missed))
        time.sleep(0.0005)
        self.in_cycle -= 1
        return len(self.begun) < self._cycles


def test_the_stand_in_runs_the_cycles_while_the_processor_of_the_loop_is_taken_away() -> None:
    loop = Loop(120)

    def cycle(late_s: float, missed: int) -> bool:
        goes_on = loop.cycle(late_s, missed)
        if len(loop.begun) == 20:
            loop.taken_away["loop"].set()
        if len(loop.begun) == 70:
            loop.taken_away["loop"].clear()
            loop.given_back.set()
        return goes_on

    allowed = os.sched_getaffinity(0)
    loop.pacer.run(cycle)
    assert {who for who, _, _ in loop.begun[25:70]} == {"stand_in"}
    assert any(who == "loop" for who, _, _ in loop.begun[75:]), "it takes over again"
    assert len(loop.begun) == 120 and not loop.overlapped
    assert os.sched_getaffinity(0) == allowed, "only the loop is bound to a processor"


def test_no_cycle_is_run_twice_or_beside_another() -> None:
    loop = Loop(200)
    begun_s = time.monotonic()
    loop.pacer.run(loop.cycle)
    beats = sum(1 + missed for _, _, missed in loop.begun)
    assert not loop.overlapped and len(loop.begun) == 200
    assert (beats - 1) * 0.005 <= time.monotonic() - begun_s


@pytest.mark.parametrize("who", ["loop", "stand_in"])
def test_what_a_cycle_raises_ends_both_and_is_raised_by_run(who: str) -> None:
    loop = Loop(1000)
    other = "stand_in" if who == "loop" else "loop"

    def cycle(late_s: float, missed: int) -> bool:
        loop.cycle(late_s, missed)
        if len(loop.begun) == 5:
            loop.taken_away[other].set()
        if len(loop.begun) > 10 and loop.who() == who:
            loop.given_back.set()
            raise RuntimeError("the arm is on fire")
        return True

    with pytest.raises(RuntimeError, match="on fire"):
        loop.pacer.run(cycle)
    assert not any(thread.name == "stand_in" for thread in threading.enumerate())


def test_a_loop_that_is_broken_off_ends_its_stand_in_after_the_cycle_under_way() -> None:
    begun: list[str] = []
    in_cycle = threading.Event()

    def sleep(duration_s: float) -> None:
        if Loop.who() == "loop" and len(begun) > 3:
            assert in_cycle.wait(10.0)
            raise KeyboardInterrupt
        time.sleep(duration_s)

    def cycle(late_s: float, missed: int) -> bool:
        begun.append(Loop.who())
        if len(begun) > 5:
            in_cycle.set()
            time.sleep(0.05)
        return len(begun) < 300

    with pytest.raises(KeyboardInterrupt):
        CyclePacer(0.005, PROCESSORS, sleep=sleep).run(cycle)
    assert len(begun) < 20
    assert not any(thread.name == "stand_in" for thread in threading.enumerate())


def test_a_wish_that_processors_stay_awake_is_held_and_a_refusal_is_said(tmp_path: Path,
                                                                         monkeypatch: pytest.MonkeyPatch) -> None:
    device = tmp_path / "latency"
    monkeypatch.setattr(real_time, "_LATENCY_DEVICE", str(device))
    assert "No such file" in real_time.keep_processors_awake()[0]
    device.touch()
    assert real_time.keep_processors_awake() == []
    held = [link for link in Path("/proc/self/fd").iterdir() if os.path.realpath(link) == str(device)]
    assert device.read_bytes() == bytes(4) and len(held) == 1
    os.close(int(held[0].name))


@pytest.mark.parametrize(("allowed", "policy", "chosen"), [
    ({3}, os.SCHED_FIFO, None), ({0, 1}, os.SCHED_FIFO, (1, 0)), ({0, 2, 5, 7}, os.SCHED_FIFO, (7, 5)),
    ({0, 2, 5, 7}, os.SCHED_OTHER, None)])
def test_an_urgent_loop_and_its_stand_in_take_the_last_processors_allowed(
        allowed: set[int], policy: int, chosen: tuple[int, int] | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: allowed)
    monkeypatch.setattr(os, "sched_getscheduler", lambda process: policy)
    assert real_time.processors_for_loop() == chosen


@given(st.lists(st.floats(0.0, 0.019), min_size=1, max_size=300))
def test_percentiles_agree_with_numpy_up_to_the_resolution(late_s: list[float]) -> None:
    statistics = LoopStatistics(0.01)
    for value in late_s:
        statistics.add(value, 0, value)
    figures = statistics.figures()
    for share, seen in ((50, figures.late_p50_s), (99, figures.late_p99_s)):
        exact = float(np.percentile(late_s, share, method="inverted_cdf"))
        assert exact - 1e-12 <= seen <= exact + RESOLUTION_S + 1e-12
    assert figures.late_max_s == max(late_s)
    assert figures.overruns == sum(value > 0.01 for value in late_s)
    assert figures.work_mean_s == pytest.approx(sum(late_s) / len(late_s))


def test_figures_begin_anew() -> None:
    statistics = LoopStatistics(0.01)
    assert statistics.figures().cycles == 0
    statistics.add(9.0, 900, 9.0)
    assert (statistics.figures().missed, statistics.figures().late_p99_s) == (900, 9.0)
    statistics.reset()
    assert (statistics.figures().cycles, statistics.figures().work_max_s) == (0, 0.0)


def test_what_the_system_does_not_permit_is_said_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(real_time.resource, "getrlimit", lambda which: (65536, 65536))
    refused = real_time.run_in_real_time()
    assert [text.split(" (")[0] for text in refused] == ["real-time scheduling", "locking of memory"]
    assert "rtprio" in refused[0] and "64 kB" in refused[1] and "memlock" in refused[1]


def test_a_thread_that_ends_meanwhile_does_not_keep_the_loop_from_real_time(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[int, int] = {}

    def schedule(thread: int, policy: int, parameters: os.sched_param) -> None:
        if thread == 12:
            raise ProcessLookupError(3, "No such process")
        given[thread] = parameters.sched_priority

    monkeypatch.setattr(os, "listdir", lambda folder: ["11", "12", "13", str(threading.get_native_id())])
    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    monkeypatch.setattr(real_time, "_lock_memory", lambda: "")
    assert real_time.run_in_real_time(60) == []
    assert given == {11: 50, 13: 50, threading.get_native_id(): 60}


def test_where_the_loop_itself_may_not_be_urgent_nothing_else_is(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[int, int] = {}

    def schedule(thread: int, policy: int, parameters: os.sched_param) -> None:
        if parameters.sched_priority > 75:
            raise PermissionError(1, "Operation not permitted")
        given[thread] = parameters.sched_priority

    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    monkeypatch.setattr(real_time, "_lock_memory", lambda: "")
    assert len(real_time.run_in_real_time()) == 1 and given == {}


def test_ten_thousand_cycles_with_moving_controllers_use_up_no_memory(make_loop: Callable[..., Any]) -> None:
    names = [f"j{i}" for i in range(12)]
    loop = make_loop({"hw": {"joints": names},
                      "one": {"type": "position_controllers/JointTrajectoryController", "joints": names[:6]},
                      "two": {"type": "position_controllers/JointTrajectoryController", "joints": names[6:]},
                      "states": {"type": "joint_state_controller/JointStateController"}})
    loop.spawn("one", "two", "states")
    for part, controller in (("j0", "one"), ("j6", "two")):
        joints = tuple(names[int(part[1:]):int(part[1:]) + 6])
        points = tuple(TrajectoryPoint(float(i), (0.1 * (i % 2),) * 6, (0.0,) * 6) for i in range(1, 400))
        loop.controllers[controller].submit(TrajectoryGoal(JointTrajectory(joints, points)))
        loop.controllers[controller].on_state = lambda snapshot: None
    loop.controllers["states"].on_state = lambda snapshot: None
    loop.step(1000)
    gc.collect()
    tracemalloc.start()
    loop.step(100)
    gc.collect()
    before, _ = tracemalloc.get_traced_memory()
    loop.step(10000)
    gc.collect()
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert after - before < 4096, f"{after - before} bytes more after 10,000 cycles"
