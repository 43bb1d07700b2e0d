# SPDX-License-Identifier: BSD-3-Clause
"""Conformance suite of `RobotHW`: what controllers rely on, for every hardware.

Subclass `RobotHWConformance` in a test module under a name that begins with Test and say how the hardware is made;
pytest finds the rest. Hardware that takes long to make may be handed out again by `make_robot_hw`, unless
`close_after_test` is True.

What belongs to the control loop is called from a thread of its own, as the loop does.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from modular_framework_control.hardware_interface.handles import JointHandle
from modular_framework_control.hardware_interface.interfaces import (
    ControllerInfo,
    InterfaceResources,
    JointStateInterface,
    PositionJointInterface,
)
from modular_framework_control.hardware_interface.joint_limits import JointLimits
from modular_framework_control.hardware_interface.robot_hw import RobotHW, SwitchState

ResultT = TypeVar("ResultT")
TIMELY_SHARE = 0.7
"""Share of the time that a jump takes at the velocity limit; a joint that needs less exceeded the limit."""


class RobotHWConformance(ABC):
    """Tests of one hardware.

    Attributes:
        period_s: cycle of the control loop [s].
        settle_s: how long a joint may take for a step of `step` [s].
        ready_s: how long the hardware may take until it has no fault [s].
        step: size of the steps [rad|m].
        jump: size of the step whose speed is watched, less where a joint has no room for it; it takes many cycles at
            the greatest velocity [rad|m].
        tolerance: how near a joint must come, and how far an idle one may stray [rad|m].
        real_time: whether the hardware moves by itself, so that each cycle must take its time.
        close_after_test: whether what `make_robot_hw` gave is closed after each test.
    """

    period_s = 0.004
    settle_s = 2.0
    ready_s = 20.0
    step = 0.05
    jump = 0.4
    tolerance = 0.01
    real_time = False
    close_after_test = True

    @abstractmethod
    def make_robot_hw(self) -> RobotHW:
        """Initialised hardware, at rest, with room to move in every joint."""

    @abstractmethod
    def limits(self) -> Mapping[str, JointLimits]:
        """Limits of the joints of that hardware, by name."""

    def advance(self, period_s: float) -> None:
        """Advances time between two cycles: real time for real hardware, physics for simulated hardware."""
        if self.real_time:
            time.sleep(period_s)

    def setup_method(self) -> None:
        """Called by pytest before each test."""
        self._made: list[RobotHW] = []
        self._time_s = 0.0
        self._read_s = math.nan
        self._loop = ThreadPoolExecutor(1, "loop")

    def teardown_method(self) -> None:
        """Called by pytest after each test."""
        self._loop.shutdown()
        if self.close_after_test:
            for robot_hw in self._made:
                robot_hw.close()

    def _in_loop(self, call: Callable[..., ResultT], *arguments: Any) -> ResultT:
        """Calls in the thread of the loop; returns what it returns."""
        return self._loop.submit(call, *arguments).result()

    def _read(self, robot_hw: RobotHW) -> None:
        self._in_loop(robot_hw.read, self._time_s, self.period_s)

    def _cycle(self, robot_hw: RobotHW, goals: Mapping[str, float] | None = None) -> None:
        """Reads, commands as controllers do (the present positions, without `goals`), writes; then time passes."""
        self._in_loop(self._cycle_in_loop, robot_hw, goals)
        self._time_s += self.period_s
        self.advance(self.period_s)

    def _cycle_in_loop(self, robot_hw: RobotHW, goals: Mapping[str, float] | None) -> None:
        robot_hw.read(self._time_s, self.period_s)
        self._read_s = time.monotonic() if self.real_time else self._time_s
        for handle in robot_hw.get(PositionJointInterface).handles:
            handle.command = handle.position if goals is None else goals[handle.name]
        robot_hw.write(self._time_s, self.period_s)

    def _run(self, robot_hw: RobotHW, goals: Mapping[str, float], duration_s: float) -> None:
        for _ in range(round(duration_s / self.period_s)):
            self._cycle(robot_hw, goals)
        self._read(robot_hw)

    def _ready(self) -> tuple[RobotHW, list[JointHandle]]:
        """Returns hardware without a fault whose joints are commanded to their present positions."""
        robot_hw = self.make_robot_hw()
        self._made.append(robot_hw)
        self._read(robot_hw)
        cycles = 0
        while self._in_loop(robot_hw.faults):
            assert cycles * self.period_s < self.ready_s, list(robot_hw.faults())
            self._cycle(robot_hw)
            cycles += 1
        handles = robot_hw.get(PositionJointInterface).handles
        for handle in handles:
            handle.command = handle.position
        return robot_hw, handles

    def _target(self, handle: JointHandle, distance: float) -> float:
        """A position that far away, upward where there is room; else the range's farther end."""
        limit = self.limits()[handle.name]
        up, down = limit.max_position - handle.position, handle.position - limit.min_position
        if up >= distance or up >= down:
            return handle.position + min(distance, up)
        return handle.position - min(distance, down)

    def test_the_constructor_needs_no_arguments(self) -> None:
        assert isinstance(type(self._ready()[0])(), RobotHW)

    def test_commanded_joints_share_their_state_with_the_state_interface(self) -> None:
        robot_hw, handles = self._ready()
        states = robot_hw.get(JointStateInterface)
        assert handles
        assert all(states.get_handle(handle.name) is handle.state for handle in handles)

    def test_states_are_finite_and_within_the_limits(self) -> None:
        robot_hw, handles = self._ready()
        limits = self.limits()
        for state in robot_hw.get(JointStateInterface).handles:
            assert all(map(math.isfinite, (state.position, state.velocity, state.effort)))
        for handle in handles:
            limit = limits[handle.name]
            assert limit.min_position - self.tolerance <= handle.position <= limit.max_position + self.tolerance

    def test_at_rest_it_has_no_fault(self) -> None:
        robot_hw, handles = self._ready()
        self._run(robot_hw, {handle.name: handle.position for handle in handles}, 0.1)
        assert self._in_loop(robot_hw.fault) == "" and not self._in_loop(robot_hw.faults)

    def test_commanded_to_hold_it_stays(self) -> None:
        robot_hw, handles = self._ready()
        before = {handle.name: handle.position for handle in handles}
        self._run(robot_hw, before, 0.5)
        assert all(abs(handle.position - before[handle.name]) <= self.tolerance for handle in handles)

    def test_each_joint_follows_its_command_and_the_others_stay(self) -> None:
        robot_hw, handles = self._ready()
        goals = {handle.name: handle.position for handle in handles}
        self._run(robot_hw, goals, 0.1)
        for moved in handles:
            goals[moved.name] = self._target(moved, self.step)
            self._run(robot_hw, goals, self.settle_s)
            for handle in handles:
                assert abs(handle.position - goals[handle.name]) <= self.tolerance, (moved.name, handle)

    def test_velocity_has_the_sign_of_the_motion(self) -> None:
        robot_hw, handles = self._ready()
        goals = {handle.name: handle.position for handle in handles}
        for handle in handles:
            start, seen = handle.position, 0.0
            goals[handle.name] = self._target(handle, self.step)
            for _ in range(round(self.settle_s / self.period_s)):
                self._cycle(robot_hw, goals)
                self._read(robot_hw)
                seen = max(seen, handle.velocity, key=abs)
            assert seen * (handle.position - start) > 0.0, handle

    def test_a_jump_of_the_command_is_followed_no_faster_than_the_limit_allows(self) -> None:
        robot_hw, handles = self._ready()
        limits = self.limits()
        limited = [handle for handle in handles if math.isfinite(limits[handle.name].max_velocity)]
        assert limited, f"limits() has no finite max_velocity of any of {[handle.name for handle in handles]}"
        goals = {handle.name: handle.position for handle in handles}
        for handle in limited:
            goals[handle.name] = self._target(handle, self.jump)
            jump = abs(goals[handle.name] - handle.position)
            least_s = TIMELY_SHARE * (jump - 2.0 * self.tolerance) / limits[handle.name].max_velocity
            assert least_s >= 5 * self.period_s, (
                f"a jump of {jump} of {handle.name} takes too few cycles; give a greater one, more room at the start, "
                "a smaller tolerance or a shorter period"
            )
            assert self._duration_of_jump(robot_hw, handle, goals) >= least_s, handle

    def _duration_of_jump(self, robot_hw: RobotHW, handle: JointHandle, goals: Mapping[str, float]) -> float:
        """Returns how long the joint takes from its start position to its goal [s]; fails if it does not arrive."""
        start, left_s = handle.position, math.nan
        for _ in range(round((self.settle_s + self.jump / self.limits()[handle.name].max_velocity) / self.period_s)):
            self._cycle(robot_hw, goals)
            if abs(handle.position - start) <= self.tolerance:
                left_s = self._read_s
            if abs(handle.position - goals[handle.name]) <= self.tolerance:
                return self._read_s - left_s
        raise AssertionError(
            f"{handle.name} has not come from {start} to {goals[handle.name]}, but to {handle.position}"
        )

    def test_commands_beyond_the_limits_or_no_numbers_keep_it_within_them(self) -> None:
        robot_hw, handles = self._ready()
        for command in (1e9, -1e9, math.inf, math.nan):
            self._run(robot_hw, {handle.name: command for handle in handles}, 0.1)
            for handle in handles:
                limit = self.limits()[handle.name]
                assert math.isfinite(handle.position)
                assert limit.min_position - self.tolerance <= handle.position <= limit.max_position + self.tolerance

    def test_a_cycle_without_time_is_survived(self) -> None:
        robot_hw, handles = self._ready()
        self._in_loop(robot_hw.write, self._time_s, 0.0)
        self._in_loop(robot_hw.read, self._time_s, 0.0)
        assert all(math.isfinite(handle.velocity) for handle in handles)

    def test_two_controllers_may_not_claim_one_joint(self) -> None:
        robot_hw, handles = self._ready()
        name = handles[0].name
        claim = (InterfaceResources(PositionJointInterface.type_name, (name,)),)
        one, other = ControllerInfo("one", "some/Type", claim), ControllerInfo("other", "some/Type", claim)
        assert robot_hw.check_for_conflict([one]) == ""
        assert name in robot_hw.check_for_conflict([one, other])
        assert robot_hw.prepare_switch([one], []) is True

    def test_switches_are_done_and_leave_it_where_it_is(self) -> None:
        robot_hw, handles = self._ready()
        before = {handle.name: handle.position for handle in handles}
        claim = (InterfaceResources(PositionJointInterface.type_name, tuple(before)),)
        info = ControllerInfo("one", "some/Type", claim)
        for start, stop in (([info], []), ([], [info])):
            assert robot_hw.prepare_switch(start, stop) is True
            self._in_loop(robot_hw.do_switch, start, stop)
            assert self._in_loop(robot_hw.switch_result) is SwitchState.DONE
            assert self._in_loop(robot_hw.switch_result, info) is SwitchState.DONE
            self._run(robot_hw, before, 0.2)
        assert all(abs(handle.position - before[handle.name]) <= self.tolerance for handle in handles)

    def test_it_may_be_closed_twice(self) -> None:
        robot_hw, _ = self._ready()
        if self.close_after_test:
            robot_hw.close()
            robot_hw.close()
