# SPDX-License-Identifier: BSD-3-Clause
"""Conformance suite of `RobotHW`, with the requirements of controllers on every hardware.

To use the suite, define in a test module a subclass of `RobotHWConformance` whose name starts with Test and implement
its abstract methods. Each test applies to joints with matching commands: positions (also with velocities and
accelerations), velocities or efforts. Unless `close_after_test` is True, `make_robot_hw` may return the same hardware
again.

Methods for the control loop are called from a separate thread, as in the real loop.
"""

from __future__ import annotations

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

from modular_framework_control.hardware_interface.handles import JointHandle
from modular_framework_control.hardware_interface.interfaces import (
    COMMAND_INTERFACES,
    CommandInterface,
    ControllerInfo,
    EffortJointInterface,
    InterfaceResources,
    JointStateInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.joint_limits import JointLimits
from modular_framework_control.hardware_interface.robot_hw import RobotHW, SwitchState

ResultT = TypeVar("ResultT")
POSITIONS = tuple(interface for interface in COMMAND_INTERFACES if interface.commands_positions)
START_FRACTIONS = (0.15, 0.5, 0.8)
"""Start positions as fractions of the joint range; consecutive joints use different fractions."""
START_REACH = 1.0
"""Maximum distance of a start position from the middle of the range, or from 0 without a range [rad|m]."""
HOSTILE_COMMANDS = (1e9, -1e9, math.inf, -math.inf, math.nan)
STATE_AGE_S = 0.1
"""Maximum age of the states of real-time hardware [s], due to polling links and busy computers."""
OVERSPEED = 1.5
"""Maximum mean speed as a multiple of the limit, because braking by an effort takes time."""
TIMED_CYCLES = 50
SLOW_CYCLES_FRACTION = 0.2
"""Fraction of cycles that may exceed the period on a busy machine."""
MIN_DURATION_FRACTION = 0.7
"""Minimum duration of a jump as a fraction of its duration at the velocity limit."""


def _duration_s(call: Callable[..., Any], *arguments: Any) -> float:
    """Returns the duration of a call, without the switch to the thread of the loop [s]."""
    start_s = time.perf_counter()
    call(*arguments)
    return time.perf_counter() - start_s


class RobotHWConformance(ABC):
    """Tests of one hardware.

    Attributes:
        period_s: Period of the control loop.
        settle_s: Maximum time of a joint to move by `step`.
        ready_s: Maximum time until the hardware has no fault.
        step: Size of the steps [rad|m].
        jump: Size of the step in the test of the velocity limit, smaller for joints near a position limit; must take
            many cycles at the maximum velocity [rad|m].
        tolerance: Tolerance for reaching a position, and for the motion of an idle joint [rad|m].
        real_time: Whether the hardware moves in real time.
        close_after_test: Whether the hardware is closed after each test.
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
    def make_robot_hw(self, positions: Mapping[str, float] | None = None) -> RobotHW:
        """Returns initialized hardware at rest, with all joints away from their limits.

        Args:
            positions: Joint positions before initialization, by name and within the limits, for new hardware [rad|m];
                None for any positions.
        """

    @abstractmethod
    def limits(self) -> Mapping[str, JointLimits]:
        """Returns the limits of the joints, by name."""

    def advance(self, period_s: float) -> None:
        """Advances time between two cycles, real time for real hardware and physics for simulated hardware."""
        if self.real_time:
            time.sleep(period_s)

    def setup_method(self) -> None:
        """Runs before each test."""
        self._made: list[RobotHW] = []
        self._time_s = 0.0
        self._read_s = math.nan
        self._loop = ThreadPoolExecutor(1, "loop")

    def teardown_method(self) -> None:
        """Runs after each test."""
        self._loop.shutdown()
        if self.close_after_test:
            for robot_hw in self._made:
                robot_hw.close()

    def _in_loop(self, call: Callable[..., ResultT], *arguments: Any) -> ResultT:
        """Calls a function in the thread of the loop and returns the result."""
        return self._loop.submit(call, *arguments).result()

    def _read(self, robot_hw: RobotHW) -> None:
        self._in_loop(robot_hw.read, self._time_s, self.period_s)

    def _cycle(self, robot_hw: RobotHW, commands: Mapping[JointHandle, float]) -> None:
        """Reads, commands and writes as the loop and controllers do, then advances time."""
        self._in_loop(self._cycle_in_loop, robot_hw, commands)
        self._time_s += self.period_s
        self.advance(self.period_s)

    def _cycle_in_loop(self, robot_hw: RobotHW, commands: Mapping[JointHandle, float]) -> None:
        robot_hw.read(self._time_s, self.period_s)
        self._read_s = time.monotonic() if self.real_time else self._time_s
        robot_hw.seed_commands()
        for handle, command in commands.items():
            handle.command = command
        robot_hw.write(self._time_s, self.period_s)

    def _run(self, robot_hw: RobotHW, commands: Mapping[JointHandle, float], duration_s: float) -> None:
        for _ in range(round(duration_s / self.period_s)):
            self._cycle(robot_hw, commands)
        self._read(robot_hw)

    def _ready(self, positions: Mapping[str, float] | None = None) -> RobotHW:
        """Returns hardware without a fault."""
        robot_hw = self.make_robot_hw(positions)
        self._made.append(robot_hw)
        if positions is None and not self.close_after_test:
            self._in_loop(self._hold, robot_hw)
        self._read(robot_hw)
        cycles = 0
        while self._in_loop(robot_hw.faults):
            assert cycles * self.period_s < self.ready_s, list(robot_hw.faults())
            self._cycle(robot_hw, {})
            cycles += 1
        return robot_hw

    def _hold(self, robot_hw: RobotHW) -> None:
        """Holds the joints as a starting controller does, because the previous test may have commanded anything."""
        robot_hw.read(self._time_s, self.period_s)
        for _, handles in self._command_interfaces(robot_hw, POSITIONS):
            for handle in handles:
                handle.hold(handle.position)
        robot_hw.write(self._time_s, self.period_s)

    @staticmethod
    def _command_interfaces(
        robot_hw: RobotHW, interfaces: Sequence[type[CommandInterface]] = COMMAND_INTERFACES
    ) -> Iterator[tuple[CommandInterface, list[JointHandle]]]:
        """Yields the hardware's interfaces among `interfaces`, with their handles."""
        for interface_class in interfaces:
            interface = robot_hw.find(interface_class)
            if interface is not None and interface.handles:
                yield interface, interface.handles

    def _claimed_joints(
        self, *interfaces: type[CommandInterface]
    ) -> Iterator[tuple[RobotHW, list[JointHandle], dict[JointHandle, float]]]:
        """Yields ready hardware, the joints of each of its interfaces among `interfaces`, and commands of rest."""
        robot_hw = self._ready()
        for interface, handles in self._command_interfaces(robot_hw, interfaces):
            claim = InterfaceResources(interface.type_name, tuple(handle.name for handle in handles))
            info = ControllerInfo("one", "some/Type", (claim,))
            assert robot_hw.prepare_switch([info], []) is True
            self._in_loop(robot_hw.do_switch, [info], [])
            yield (
                robot_hw,
                handles,
                {handle: handle.position if interface.commands_positions else 0.0 for handle in handles},
            )

    def _start_positions(self, offset: int) -> dict[str, float]:
        """Returns positions within the limits, at different fractions of the joints' ranges."""
        positions = {}
        for index, (name, limit) in enumerate(self.limits().items()):
            bounded = math.isfinite(limit.min_position + limit.max_position)
            middle = 0.5 * (limit.min_position + limit.max_position) if bounded else 0.0
            reach = min(START_REACH, limit.max_position - middle)
            fraction = START_FRACTIONS[(index + offset) % len(START_FRACTIONS)]
            positions[name] = middle + reach * (2.0 * fraction - 1.0)
        return positions

    def _target(self, handle: JointHandle, distance: float) -> float:
        """Returns a position at a distance, upwards if possible, at most the farther end of the range."""
        limit = self.limits()[handle.name]
        up, down = limit.max_position - handle.position, handle.position - limit.min_position
        if up >= distance or up >= down:
            return handle.position + min(distance, up)
        return handle.position - min(distance, down)

    def test_the_constructor_needs_no_arguments(self) -> None:
        assert isinstance(type(self._ready())(), RobotHW)

    def test_commanded_joints_share_their_state_with_the_state_interface(self) -> None:
        robot_hw = self._ready()
        states = robot_hw.get(JointStateInterface)
        assert robot_hw.command_handles
        assert all(states.get_handle(handle.name) is handle.state for _, handle in robot_hw.command_handles)

    def test_states_are_finite_and_within_the_limits(self) -> None:
        robot_hw = self._ready()
        for state in robot_hw.get(JointStateInterface).handles:
            assert all(map(math.isfinite, (state.position, state.velocity, state.effort)))
        self._assert_within_limits(handle for _, handle in robot_hw.command_handles)

    def _assert_within_limits(self, handles: Iterable[JointHandle]) -> None:
        for handle in handles:
            limit = self.limits()[handle.name]
            assert math.isfinite(handle.position)
            assert limit.min_position - self.tolerance <= handle.position <= limit.max_position + self.tolerance, handle

    def test_wherever_it_stands_at_the_start_it_stays_until_it_is_commanded(self) -> None:
        for offset in range(len(START_FRACTIONS)):
            starts = self._start_positions(offset)
            robot_hw = self._ready(starts)
            states = [robot_hw.get(JointStateInterface).get_handle(name) for name in starts]
            resting = {handle.name for _, handles in self._commanded_at_rest(robot_hw) for handle in handles}
            for _ in range(round(0.5 / self.period_s)):
                for state in states:
                    error = abs(state.position - starts[state.name])
                    assert state.name not in resting or error <= self.tolerance, (
                        f"{state} moved from {starts[state.name]}"
                    )
                self._cycle(robot_hw, {})
            rates = self._command_interfaces(robot_hw, (VelocityJointInterface, EffortJointInterface))
            assert all(handle.command == 0.0 for _, handles in rates for handle in handles)
            robot_hw.close()

    def _commanded_at_rest(self, robot_hw: RobotHW) -> Iterator[tuple[CommandInterface, list[JointHandle]]]:
        """Yields the interfaces whose joints stay without a command; with an effort of 0, joints may fall."""
        return self._command_interfaces(robot_hw, (*POSITIONS, VelocityJointInterface))

    def test_at_rest_it_has_no_fault(self) -> None:
        robot_hw = self._ready()
        self._run(robot_hw, {}, 0.1)
        assert self._in_loop(robot_hw.fault) == "" and not self._in_loop(robot_hw.faults)

    def test_read_and_write_do_not_wait(self) -> None:
        robot_hw = self._ready()
        durations_s: dict[str, list[float]] = {"read": [], "write": []}
        for _ in range(TIMED_CYCLES):
            for name, durations in durations_s.items():
                durations.append(self._in_loop(_duration_s, getattr(robot_hw, name), self._time_s, self.period_s))
                if name == "read":
                    self._in_loop(robot_hw.seed_commands)
            self._time_s += self.period_s
            self.advance(self.period_s)
        for name, durations in durations_s.items():
            typical_s = sorted(durations)[-1 - round(SLOW_CYCLES_FRACTION * TIMED_CYCLES)]
            assert typical_s <= self.period_s, (
                f"{name}() takes {typical_s * 1e3:.1f} ms or more in every fifth cycle, the period is "
                f"{self.period_s * 1e3:g} ms; it must not wait: wait in a separate thread, started in init()"
            )

    def test_commanded_to_hold_it_stays(self) -> None:
        for robot_hw, handles, commands in self._claimed_joints(*POSITIONS):
            self._run(robot_hw, commands, 0.5)
            assert all(abs(handle.position - commands[handle]) <= self.tolerance for handle in handles)

    def test_each_joint_follows_its_command_and_the_others_stay(self) -> None:
        for robot_hw, handles, goals in self._claimed_joints(*POSITIONS):
            self._run(robot_hw, goals, 0.1)
            for moved in handles:
                goals[moved] = self._target(moved, self.step)
                self._run(robot_hw, goals, self.settle_s)
                for handle in handles:
                    assert abs(handle.position - goals[handle]) <= self.tolerance, (moved.name, handle)

    def test_velocity_has_the_sign_of_the_motion(self) -> None:
        for robot_hw, handles, goals in self._claimed_joints(*POSITIONS):
            for handle in handles:
                start, seen = handle.position, 0.0
                goals[handle] = self._target(handle, self.step)
                for _ in range(round(self.settle_s / self.period_s)):
                    self._cycle(robot_hw, goals)
                    self._read(robot_hw)
                    seen = max(seen, handle.velocity, key=abs)
                assert seen * (handle.position - start) > 0.0, handle

    def test_a_jump_of_the_command_is_followed_no_faster_than_the_limit_allows(self) -> None:
        limits = self.limits()
        for robot_hw, handles, goals in self._claimed_joints(*POSITIONS):
            limited = [handle for handle in handles if math.isfinite(limits[handle.name].max_velocity)]
            assert limited, f"limits() has no finite max_velocity of any of {[handle.name for handle in handles]}"
            for handle in limited:
                goals[handle] = self._target(handle, self.jump)
                jump = abs(goals[handle] - handle.position)
                min_duration_s = (
                    MIN_DURATION_FRACTION * (jump - 2.0 * self.tolerance) / limits[handle.name].max_velocity
                )
                assert min_duration_s >= 5 * self.period_s, (
                    f"a jump of {jump} of {handle.name} takes too few cycles; give a greater one, more room at the "
                    "start, a smaller tolerance or a shorter period"
                )
                assert self._duration_of_jump(robot_hw, handle, goals) >= min_duration_s, handle

    def _duration_of_jump(self, robot_hw: RobotHW, handle: JointHandle, goals: Mapping[JointHandle, float]) -> float:
        """Returns the duration of a joint's motion to its goal [s]; fails if the joint does not arrive."""
        start, start_s = handle.position, math.nan
        for _ in range(round((self.settle_s + self.jump / self.limits()[handle.name].max_velocity) / self.period_s)):
            self._cycle(robot_hw, goals)
            if abs(handle.position - start) <= self.tolerance:
                start_s = self._read_s
            if abs(handle.position - goals[handle]) <= self.tolerance:
                return self._read_s - start_s
        raise AssertionError(f"{handle.name} has not come from {start} to {goals[handle]}, but to {handle.position}")

    def test_commands_beyond_the_limits_or_no_numbers_keep_it_within_them(self) -> None:
        for robot_hw, handles, _ in self._claimed_joints(*POSITIONS, VelocityJointInterface):
            for command in HOSTILE_COMMANDS:
                self._assert_no_faster_than_the_limit(robot_hw, handles, command)
                self._assert_within_limits(handles)

    def test_a_velocity_is_followed_until_it_is_0(self) -> None:
        self._assert_that_joints_move(VelocityJointInterface, lambda limit: min(0.5, 0.5 * limit.max_velocity))

    def test_an_effort_moves_its_joint(self) -> None:
        self._assert_that_joints_move(
            EffortJointInterface, lambda limit: 0.5 * limit.max_effort if limit.max_effort < math.inf else 1.0
        )

    def _assert_that_joints_move(self, interface: type[CommandInterface], size: Callable[[JointLimits], float]) -> None:
        """Commands each joint by `size` of its limits towards the position of `_target`, then by 0."""
        for robot_hw, handles, commands in self._claimed_joints(interface):
            for handle in handles:
                start, target = handle.position, self._target(handle, self.step)
                direction = math.copysign(1.0, target - start)
                commands[handle] = direction * size(self.limits()[handle.name])
                for _ in range(round(self.settle_s / self.period_s)):
                    self._cycle(robot_hw, commands)
                    if (handle.position - start) * direction > 0.5 * abs(target - start):
                        break
                self._read(robot_hw)
                assert handle.velocity * direction > 0.0 and (handle.position - start) * direction > 0.0, handle
                commands[handle] = 0.0
                self._run(robot_hw, commands, self.settle_s)
                if interface is VelocityJointInterface:
                    stopped = handle.position
                    self._run(robot_hw, commands, 0.1)
                    assert abs(handle.position - stopped) <= self.tolerance, f"{handle} does not stop"

    def test_no_effort_exceeds_the_limits_or_makes_a_joint_faster_than_its_velocity_limit(self) -> None:
        for robot_hw, handles, _ in self._claimed_joints(EffortJointInterface):
            for command in HOSTILE_COMMANDS:
                self._assert_no_faster_than_the_limit(robot_hw, handles, command)

    def _assert_no_faster_than_the_limit(self, robot_hw: RobotHW, handles: list[JointHandle], command: float) -> None:
        """Commands all joints by `command` for some time and checks speeds and efforts."""
        self._cycle(robot_hw, dict.fromkeys(handles, command))
        starts, began_s = [handle.position for handle in handles], self._read_s
        age_s, duration_s = (STATE_AGE_S, 0.4) if self.real_time else (0.0, 0.1)
        for _ in range(round(duration_s / self.period_s)):
            self._cycle(robot_hw, dict.fromkeys(handles, command))
            for handle, start in zip(handles, starts, strict=True):
                limit = self.limits()[handle.name]
                elapsed_s = self._read_s - began_s + age_s
                allowed = OVERSPEED * limit.max_velocity * elapsed_s + 2.0 * self.tolerance
                assert abs(handle.position - start) <= allowed, f"{handle} is too fast, commanded {command}"
                assert not abs(handle.effort) > OVERSPEED * limit.max_effort, f"{handle} has effort {handle.effort}"
        self._read(robot_hw)

    def test_a_cycle_without_time_is_survived(self) -> None:
        robot_hw = self._ready()
        self._cycle(robot_hw, {})
        self._in_loop(robot_hw.write, self._time_s, 0.0)
        self._in_loop(robot_hw.read, self._time_s, 0.0)
        assert all(math.isfinite(state.velocity) for state in robot_hw.get(JointStateInterface).handles)

    def test_two_controllers_may_not_claim_one_joint(self) -> None:
        robot_hw = self._ready()
        for interface, handles in self._command_interfaces(robot_hw):
            name = handles[0].name
            claim = (InterfaceResources(interface.type_name, (name,)),)
            one, other = ControllerInfo("one", "some/Type", claim), ControllerInfo("other", "some/Type", claim)
            assert robot_hw.check_for_conflict([one]) == ""
            assert name in robot_hw.check_for_conflict([one, other])
            assert robot_hw.prepare_switch([one], []) is True

    def test_switches_are_done_and_leave_it_where_it_is(self) -> None:
        robot_hw = self._ready()
        for interface, handles in self._commanded_at_rest(robot_hw):
            before = {handle: handle.position for handle in handles}
            info = ControllerInfo(
                "one", "some/Type", (InterfaceResources(interface.type_name, tuple(interface.names)),)
            )
            for start, stop in (([info], []), ([], [info])):
                assert robot_hw.prepare_switch(start, stop) is True
                self._in_loop(robot_hw.do_switch, start, stop)
                assert self._in_loop(robot_hw.switch_result) is SwitchState.DONE
                assert self._in_loop(robot_hw.switch_result, info) is SwitchState.DONE
                self._run(robot_hw, {}, 0.2)
            assert all(abs(handle.position - before[handle]) <= self.tolerance for handle in handles)

    def test_it_may_be_closed_twice(self) -> None:
        robot_hw = self._ready()
        if self.close_after_test:
            robot_hw.close()
            robot_hw.close()
