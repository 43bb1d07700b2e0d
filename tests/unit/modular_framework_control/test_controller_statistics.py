# SPDX-License-Identifier: BSD-3-Clause
"""The update times of controllers are measured, and overruns are reported with their controller."""

from __future__ import annotations

import statistics
import threading
import time

import pytest

from modular_framework_control.controller_interface.controller import Controller
from modular_framework_control.controller_manager.controller_manager import ControllerManager, ControllerReport
from modular_framework_control.controller_manager.controller_statistics import UpdateStatistics
from modular_framework_control.controller_manager.controller_switch import ControllerState
from modular_framework_control.controller_manager.controller_types import ControllerTypes
from modular_framework_control.hardware_interface.interfaces import JointStateInterface
from modular_framework_control.hardware_interface.robot_hw import RobotHW
from modular_framework_ros.node_handle import MappingNodeHandle


class Clock:
    """A clock that advances only on request."""

    def __init__(self) -> None:
        self.now_s = 50.0

    def __call__(self) -> float:
        return self.now_s


class Slow(Controller):
    """A controller whose update takes a given time."""

    interface_class = JointStateInterface

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.takes_s = 0.0
        self.broken = False

    def update(self, time_s: float, period_s: float) -> None:
        self.clock.now_s += self.takes_s
        if self.broken:
            raise ValueError("broken")


class Bench:
    """Two running controllers under a clock."""

    def __init__(self) -> None:
        self.clock = Clock()
        self.made: list[Slow] = []
        types = ControllerTypes({})
        types.register("lab/Slow", self._make)
        hardware = RobotHW()
        hardware.register_interface(JointStateInterface())
        root = MappingNodeHandle({"one": {"type": "lab/Slow"}, "other": {"type": "lab/Slow"}})
        self.manager = ControllerManager(hardware, root, types, clock=self.clock)
        for name in ("one", "other"):
            self.manager.load_controller(name)
        self.start("one", "other")
        self.time_s = 0.0

    def _make(self) -> Slow:
        self.made.append(Slow(self.clock))
        return self.made[-1]

    def start(self, *names: str) -> None:
        """Starts controllers at the end of a cycle that none of them is updated in."""
        switch = threading.Thread(target=self.manager.switch_controller, args=(list(names), []))
        switch.start()
        while any(self.report(name).state is not ControllerState.RUNNING for name in names):
            self.manager.update(0.0, 0.0)
            time.sleep(0.001)
        switch.join()

    def cycle(self, one_s: float, other_s: float, period_s: float = 0.01) -> None:
        self.made[0].takes_s, self.made[1].takes_s = one_s, other_s
        self.time_s += 1.0
        self.manager.update(self.time_s, period_s)

    def report(self, name: str) -> ControllerReport:
        return next(report for report in self.manager.list_controllers() if report.info.name == name)


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_longest_mean_and_variance_are_those_of_the_updates() -> None:
    figures = UpdateStatistics()
    durations = [0.001, 0.004, 0.002, 0.0005]
    for cycle, duration_s in enumerate(durations):
        figures.add(float(cycle), duration_s, False)
    seen = figures.snapshot()
    assert (seen.max_s, seen.updated_at_s, seen.overruns) == (0.004, 3.0, 0)
    assert seen.mean_s == pytest.approx(statistics.fmean(durations))
    assert seen.variance_s2 == pytest.approx(statistics.pvariance(durations))


def test_each_controller_is_charged_with_its_own_time(bench: Bench) -> None:
    bench.cycle(0.002, 0.001)
    bench.cycle(0.004, 0.001)
    assert bench.report("one").statistics.mean_s == pytest.approx(0.003)
    assert bench.report("other").statistics.max_s == pytest.approx(0.001)
    assert bench.report("one").statistics.updated_at_s == 2.0


def test_an_overrun_is_counted_once_for_the_controller_in_which_the_time_ran_out(bench: Bench) -> None:
    bench.cycle(0.009, 0.002)
    bench.cycle(0.011, 0.002)
    bench.cycle(0.009, 0.0005)
    one, other = bench.report("one").statistics, bench.report("other").statistics
    assert (one.overruns, one.last_overrun_s) == (1, 2.0)
    assert (other.overruns, other.last_overrun_s) == (1, 1.0)


def test_a_cycle_without_a_period_is_no_overrun(bench: Bench) -> None:
    bench.cycle(5.0, 5.0, period_s=0.0)
    assert bench.report("one").statistics.overruns == bench.report("other").statistics.overruns == 0


def test_figures_begin_anew_with_a_start_and_include_the_update_that_raised(bench: Bench) -> None:
    bench.made[0].broken = True
    bench.cycle(0.02, 0.0)
    report = bench.report("one")
    assert (report.state.value, report.statistics.overruns) == ("stopped", 1)
    bench.start("one")
    assert bench.report("one").statistics.overruns == 0
