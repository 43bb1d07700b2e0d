# SPDX-License-Identifier: BSD-3-Clause
"""The pace of the control loop: fixed times, missed cycles are counted, and memory use is constant."""

from __future__ import annotations

import ctypes
import gc
import os
import subprocess
import sys
import threading
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from modular_framework_control.realtime import scheduling
from modular_framework_control.realtime.cycle_pacer import RESOLUTION_S, CyclePacer, LoopStatistics
from modular_framework_control.trajectory.joint_trajectory import JointTrajectory, TrajectoryPoint
from modular_framework_control.trajectory.trajectory_goal import TrajectoryGoal


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
def test_cycles_begin_at_multiples_of_the_period_and_what_is_left_out_is_counted(
    work_s: list[float], oversleep_s: float
) -> None:
    clock = Clock()
    clock.oversleep_s = oversleep_s
    begun: list[tuple[float, float, int]] = []

    def cycle(late_s: float, missed: int) -> bool:
        begun.append((clock.now_s, late_s, missed))
        clock.now_s += work_s[len(begun) - 1]
        return len(begun) < len(work_s)

    CyclePacer(0.01, clock, clock.sleep).run(cycle)
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

    CyclePacer(0.01, clock, clock.sleep).run(cycle)
    assert begun == [(0.0, 0), (0.0, 0), (4.0, 0), (0.0, 0), (25.0, 2), (0.0, 0)]


def test_what_a_cycle_raises_ends_the_loop_and_is_raised_by_run() -> None:
    clock = Clock()
    begun: list[float] = []

    def cycle(late_s: float, missed: int) -> bool:
        del missed
        begun.append(late_s)
        if len(begun) > 10:
            raise RuntimeError("the arm is on fire")
        return True

    with pytest.raises(RuntimeError, match="on fire"):
        CyclePacer(0.01, clock, clock.sleep).run(cycle)
    assert len(begun) == 11


def test_a_late_start_after_sleep_counts_as_no_processor_and_one_after_long_work_does_not() -> None:
    clock = Clock()
    statistics = LoopStatistics(0.01)
    pacer = CyclePacer(0.01, clock, clock.sleep)
    cycles = 0

    def cycle(late_s: float, missed: int) -> bool:
        nonlocal cycles
        cycles += 1
        work_s = 0.014 if cycles == 2 else 0.002
        clock.now_s += work_s
        clock.oversleep_s = {4: 0.0005, 5: 0.025}.get(cycles, 0.0)
        statistics.add(late_s, missed, work_s, pacer.woken_late_s)
        return cycles < 8

    pacer.run(cycle)
    figures = statistics.figures()
    assert (figures.overruns, figures.missed) == (1, 2)
    assert figures.no_processor_s == figures.no_processor_max_s == pytest.approx(0.025)
    statistics.reset()
    assert statistics.figures().no_processor_max_s == 0.0


def test_a_request_that_processors_stay_awake_is_held_and_a_refusal_is_said(
    tmp_path: Path,
) -> None:
    device = tmp_path / "latency"
    assert "No such file" in scheduling.keep_processors_awake(str(device))[0]
    device.touch()
    assert scheduling.keep_processors_awake(str(device)) == []
    held = [link for link in Path("/proc/self/fd").iterdir() if os.path.realpath(link) == str(device)]
    assert device.read_bytes() == bytes(4) and len(held) == 1
    os.close(int(held[0].name))


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
    monkeypatch.setattr(scheduling.resource, "getrlimit", lambda which: (65536, 65536))
    refused = scheduling.run_in_real_time()
    assert [text.split(" (")[0] for text in refused] == ["real-time scheduling", "locking of memory"]
    assert "rtprio" in refused[0] and "64 kB" in refused[1] and "memlock" in refused[1]


def permit_locking(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lets the C library say that the memory is locked, whatever the system permits."""
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: SimpleNamespace(mlockall=lambda flags: 0))


def test_a_thread_that_ends_meanwhile_does_not_keep_the_loop_from_real_time(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[int, int] = {}

    def schedule(thread: int, policy: int, parameters: os.sched_param) -> None:
        if thread == 12:
            raise ProcessLookupError(3, "No such process")
        given[thread] = parameters.sched_priority

    monkeypatch.setattr(os, "listdir", lambda folder: ["11", "12", "13", str(threading.get_native_id())])
    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    permit_locking(monkeypatch)
    assert scheduling.run_in_real_time(60, 50) == []
    assert given == {11: 50, 13: 50, threading.get_native_id(): 60}


def test_where_the_loop_itself_may_not_be_urgent_nothing_else_is(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[int, int] = {}

    def schedule(thread: int, policy: int, parameters: os.sched_param) -> None:
        if parameters.sched_priority > 75:
            raise PermissionError(1, "Operation not permitted")
        given[thread] = parameters.sched_priority

    monkeypatch.setattr(os, "sched_setscheduler", schedule)
    permit_locking(monkeypatch)
    assert len(scheduling.run_in_real_time()) == 1 and given == {}


LEAVES_REAL_TIME = """
import os, threading
from modular_framework_control.realtime.scheduling import leave_real_time, run_in_real_time
end = threading.Event()
threading.Thread(target=end.wait).start()
def policies():
    return sorted({os.sched_getscheduler(int(thread)) for thread in os.listdir("/proc/self/task")})
run_in_real_time()
print(*policies())
leave_real_time()
print(*policies())
end.set()
"""


def test_a_process_that_ends_leaves_real_time_with_all_its_threads() -> None:
    printed = subprocess.run([sys.executable, "-c", LEAVES_REAL_TIME], stdout=subprocess.PIPE, text=True, check=True)
    before, after = printed.stdout.splitlines()
    if before != str(os.SCHED_FIFO):
        pytest.skip("the system does not permit real-time scheduling")
    assert after == str(os.SCHED_OTHER)


def test_ten_thousand_cycles_with_moving_controllers_use_up_no_memory(make_loop: Callable[..., Any]) -> None:
    names = [f"j{i}" for i in range(12)]
    loop = make_loop(
        {
            "hw": {"joints": names},
            "one": {"type": "position_controllers/JointTrajectoryController", "joints": names[:6]},
            "two": {"type": "position_controllers/JointTrajectoryController", "joints": names[6:]},
            "states": {"type": "joint_state_controller/JointStateController"},
        }
    )
    loop.spawn("one", "two", "states")
    for part, controller in (("j0", "one"), ("j6", "two")):
        joints = tuple(names[int(part[1:]) : int(part[1:]) + 6])
        points = tuple(TrajectoryPoint(float(i), (0.1 * (i % 2),) * 6, (0.0,) * 6) for i in range(1, 400))
        loop.controllers[controller].submit(TrajectoryGoal(JointTrajectory.of_points(joints, points)))
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
