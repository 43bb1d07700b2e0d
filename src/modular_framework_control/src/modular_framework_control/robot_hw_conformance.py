# SPDX-License-Identifier: BSD-3-Clause
"""One suite of tests for every `RobotHW`: what controllers rely on, whatever the hardware is.

Subclass `RobotHWConformance` in a test module under a name that begins with Test and say how the hardware is made;
pytest finds the rest.
"""
from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping

from modular_framework_control.hardware_interface import (
    ControllerInfo,
    InterfaceResources,
    JointHandle,
    JointStateInterface,
    PositionJointInterface,
)
from modular_framework_control.joint_limits import JointLimits
from modular_framework_control.robot_hw import RobotHW


class RobotHWConformance(ABC):
    """Tests of one hardware.

    Attributes:
        period_s: cycle of the control loop [s].
        settle_s: how long a joint may take for a step of `step` [s].
        step: size of the steps [rad|m].
        tolerance: how near a joint must come, and how far an idle one may stray [rad|m].
    """

    period_s = 0.004
    settle_s = 2.0
    step = 0.05
    tolerance = 0.01

    @abstractmethod
    def make_robot_hw(self) -> RobotHW:
        """New, initialised hardware, at rest, with room to move in every joint."""

    @abstractmethod
    def limits(self) -> Mapping[str, JointLimits]:
        """Limits of the joints of that hardware, by name."""

    def _run(self, robot_hw: RobotHW, goals: Mapping[str, float], start_s: float, duration_s: float) -> float:
        """Run the loop, commanding `goals` in every cycle as controllers do; returns the time it ends [s]."""
        cycles = round(duration_s / self.period_s)
        handles = robot_hw.get(PositionJointInterface).handles
        for cycle in range(cycles):
            time_s = start_s + cycle * self.period_s
            robot_hw.read(time_s, self.period_s)
            for handle in handles:
                handle.command = goals[handle.name]
            robot_hw.write(time_s, self.period_s)
        end_s = start_s + cycles * self.period_s
        robot_hw.read(end_s, self.period_s)
        return end_s

    def _ready(self) -> tuple[RobotHW, list[JointHandle]]:
        """Hardware that has been read once and told to stay where it is."""
        robot_hw = self.make_robot_hw()
        robot_hw.read(0.0, self.period_s)
        handles = robot_hw.get(PositionJointInterface).handles
        for handle in handles:
            handle.command = handle.position
        return robot_hw, handles

    def _target(self, handle: JointHandle) -> float:
        limit = self.limits()[handle.name]
        up = handle.position + self.step
        return up if up <= limit.max_position else handle.position - self.step

    def test_the_constructor_needs_no_arguments(self) -> None:
        assert isinstance(type(self.make_robot_hw())(), RobotHW)

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

    def test_told_to_stay_it_stays(self) -> None:
        robot_hw, handles = self._ready()
        before = {handle.name: handle.position for handle in handles}
        self._run(robot_hw, before, 0.0, 0.5)
        assert all(abs(handle.position - before[handle.name]) <= self.tolerance for handle in handles)

    def test_each_joint_follows_its_command_and_the_others_stay(self) -> None:
        robot_hw, handles = self._ready()
        goals = {handle.name: handle.position for handle in handles}
        time_s = self._run(robot_hw, goals, 0.0, 0.1)
        for moved in handles:
            goals[moved.name] = self._target(moved)
            time_s = self._run(robot_hw, goals, time_s, self.settle_s)
            for handle in handles:
                assert abs(handle.position - goals[handle.name]) <= self.tolerance, (moved.name, handle)

    def test_velocity_has_the_sign_of_the_motion(self) -> None:
        robot_hw, handles = self._ready()
        for handle in handles:
            start, target = handle.position, self._target(handle)
            seen = 0.0
            for cycle in range(round(self.settle_s / self.period_s)):
                handle.command = target
                robot_hw.write(cycle * self.period_s, self.period_s)
                robot_hw.read((cycle + 1) * self.period_s, self.period_s)
                seen = max(seen, handle.velocity, key=abs)
            assert seen * (handle.position - start) > 0.0, handle

    def test_commands_beyond_the_limits_or_no_numbers_keep_it_within_them(self) -> None:
        robot_hw, handles = self._ready()
        time_s = 0.0
        for command in (1e9, -1e9, math.inf, math.nan):
            time_s = self._run(robot_hw, {handle.name: command for handle in handles}, time_s, 0.1)
            for handle in handles:
                limit = self.limits()[handle.name]
                assert math.isfinite(handle.position)
                assert limit.min_position - self.tolerance <= handle.position <= limit.max_position + self.tolerance

    def test_a_cycle_without_time_is_survived(self) -> None:
        robot_hw, handles = self._ready()
        robot_hw.write(0.0, 0.0)
        robot_hw.read(0.0, 0.0)
        assert all(math.isfinite(handle.velocity) for handle in handles)

    def test_two_controllers_may_not_claim_one_joint(self) -> None:
        robot_hw, handles = self._ready()
        name = handles[0].name
        claim = (InterfaceResources(PositionJointInterface.type_name, frozenset({name})),)
        one, other = ControllerInfo("one", "some/Type", claim), ControllerInfo("other", "some/Type", claim)
        assert robot_hw.check_for_conflict([one]) == ""
        assert name in robot_hw.check_for_conflict([one, other])
        assert robot_hw.prepare_switch([one], []) is True
