# SPDX-License-Identifier: BSD-3-Clause
"""However a motion ends, the joints stop within their braking distance, and the next valid goal succeeds."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import pytest

from modular_framework_control.hardware_interface.interfaces import COMMAND_INTERFACES
from modular_framework_control.hardware_interface.mock_robot_hw import MockRobotHW
from modular_framework_control.realtime.goal_handle import GoalStatus, RealtimeGoalHandle
from modular_framework_control.trajectory.joint_trajectory import JointTrajectory, TrajectoryPoint
from modular_framework_control.trajectory.trajectory_goal import (
    GoalRejectedError,
    TrajectoryErrorCode,
    TrajectoryGoal,
    TrajectoryGoalHandle,
)

FASTEST = 3.15
LIMITS = {
    "has_velocity_limits": True,
    "max_velocity": FASTEST,
    "has_position_limits": True,
    "min_position": -6.28,
    "max_position": 6.28,
}
FAMILIES = {
    "position": "PositionJointInterface",
    "velocity": "VelocityJointInterface",
    "effort": "EffortJointInterface",
    "pos_vel": "PosVelJointInterface",
    "pos_vel_acc": "PosVelAccJointInterface",
}
GAINS = {"velocity": {"p": 20.0}, "effort": {"p": 100.0, "d": 20.0}}
GOAL = {"trajectory": 0.1, "goal": 0.02}
JOINTS = ("pan", "lift")


class WalledRobotHW(MockRobotHW):
    """Fake hardware whose joints cannot pass a wall.

    Attributes:
        wall: largest position [rad].
    """

    def __init__(self) -> None:
        super().__init__()
        self.wall = float("inf")

    @property
    def joints(self) -> list[Any]:
        """The command handles."""
        return next(interface.handles for interface in map(self.find, COMMAND_INTERFACES) if interface is not None)

    def read(self, time_s: float, period_s: float) -> None:
        super().read(time_s, period_s)
        for joint in self.joints:
            if joint.position > self.wall:
                joint.state.position, joint.state.velocity = self.wall, 0.0


@pytest.fixture
def start(make_loop: Callable[..., Any]) -> Callable[..., Any]:
    def starter(
        family: str = "position",
        limits: dict[str, Any] | None = LIMITS,
        stop_s: float = 0.0,
        tolerance: dict[str, float] | None = None,
        hw: Any = None,
    ) -> Any:
        controller = {
            "type": f"{family}_controllers/JointTrajectoryController",
            "joints": list(JOINTS),
            "gains": dict.fromkeys(JOINTS, GAINS.get(family)),
            "stop_trajectory_duration": stop_s,
            "velocity_ff": dict.fromkeys(JOINTS, 1.0 if family == "velocity" else 0.0),
            "constraints": {
                "goal_time": 0.6,
                "stopped_velocity_tolerance": 0.05,
                **dict.fromkeys(JOINTS, GOAL if tolerance is None else tolerance),
            },
        }
        loop = make_loop(
            {
                "hw": {"joints": list(JOINTS), "command_interface": FAMILIES[family]},
                "c": controller,
                "joint_limits": dict.fromkeys(JOINTS, limits) if limits else {},
            },
            WalledRobotHW() if hw is None else hw,
        )
        loop.spawn("c")
        return loop

    return starter


def send(loop: Any, *points: tuple[float, Sequence[float], Sequence[float]]) -> TrajectoryGoalHandle:
    """Send a goal and let a cycle pass; a goal that is refused at once ends as rejected, too."""
    goal_handle: TrajectoryGoalHandle = RealtimeGoalHandle()
    rows = tuple(
        TrajectoryPoint(time_s, tuple(position), tuple(velocity), (0.0, 0.0) if velocity else ())
        for time_s, position, velocity in points
    )
    try:
        loop.controllers["c"].submit(TrajectoryGoal(JointTrajectory.of_points(JOINTS, rows)), goal_handle)
    except GoalRejectedError as error:
        goal_handle.finish(GoalStatus.REJECTED, error.code, str(error))
    loop.step()
    return goal_handle


def positions(loop: Any) -> list[float]:
    return [joint.position for joint in loop.robot_hw.joints]


def way_after(loop: Any, duration_s: float = 3.0) -> float:
    """How far the joints still go from where they are [rad]."""
    before, furthest = positions(loop), 0.0
    for _ in range(round(duration_s / loop.period_s)):
        loop.step()
        furthest = max(furthest, *(abs(now - then) for now, then in zip(positions(loop), before, strict=True)))
    return furthest


class HeavyRobotHW(WalledRobotHW):
    """Fake hardware whose joints, like those of an arm, cannot stop at once.

    Attributes:
        strength: largest acceleration of a joint [rad/s^2].
    """

    strength = 5.0

    def __init__(self) -> None:
        super().__init__()
        self._last = [0.0, 0.0]

    def read(self, time_s: float, period_s: float) -> None:
        for index, joint in enumerate(self.joints):
            state, command = joint.state, self._last[index] if math.isnan(joint.command) else joint.command
            pace = (command - self._last[index]) / max(period_s, 1e-9)
            behind, self._last[index] = self._last[index] - state.position, command
            wanted = pace + math.copysign(min(FASTEST, 0.8 * math.sqrt(2.0 * self.strength * abs(behind))), behind)
            change = self.strength * period_s
            state.velocity += min(max(wanted - state.velocity, -change), change)
            state.position += state.velocity * period_s


@pytest.mark.parametrize("end", ["cancel", "restart"])
def test_a_heavy_joint_that_is_stopped_without_a_ramp_does_not_turn_back_and_the_next_goal_succeeds(
    start: Callable[..., Any], end: str
) -> None:
    limits = {**LIMITS, "has_acceleration_limits": True, "max_acceleration": HeavyRobotHW.strength}
    loop = start(limits=limits, tolerance={"goal": 0.02}, hw=HeavyRobotHW())
    goal_handle = send(loop, (2.0, (2.0, -1.0), (0.0, 0.0)))
    loop.run(1.0)
    assert loop.robot_hw.joints[0].velocity > 1.5
    if end == "cancel":
        loop.controllers["c"].cancel(goal_handle)
    else:
        assert loop.switch(["c"], ["c"]) is None
    loop.run(0.1)
    seen = []
    for _ in range(70):
        loop.step()
        seen.append(positions(loop)[0])
    assert max(before - after for before, after in pairwise(seen)) < 1e-3
    assert max(seen) - seen[-1] < 0.02
    assert_next_goal_succeeds(loop)


def assert_next_goal_succeeds(loop: Any) -> None:
    target = tuple(position + 0.05 for position in positions(loop))
    goal_handle = send(loop, (1.0, target, (0.0, 0.0)))
    loop.run(2.0)
    assert goal_handle.status is GoalStatus.SUCCEEDED, goal_handle.text
    assert positions(loop) == pytest.approx(target, abs=0.02)


@pytest.mark.parametrize("family", sorted(FAMILIES))
@pytest.mark.parametrize(
    ("points", "words"),
    [
        ([(0.05, (-1.5, 0.0), ())], "on the way to point 0, joint 'pan' reaches the velocity -30; its limit is 3.15"),
        ([(1.0, (0.5, 0.0), (30.0, 0.0))], "point 0: velocity of joint 'pan' is 30; its limit is 3.15"),
        ([(1.0, (0.5, 0.5), (1e6, -1e6))], "point 0: velocity of joint 'lift' is -1e+06; its limit is 3.15"),
        (
            [(0.5, (0.5, 0.0), (0.0, 0.0)), (1.0, (0.5, 9.0), (0.0, 0.0))],
            "point 1: position of joint 'lift' is 9; its limits are -6.28 to 6.28",
        ),
    ],
)
def test_a_goal_beyond_known_limits_is_refused_with_point_and_joint_and_nothing_moves(
    start: Callable[..., Any], family: str, points: list[Any], words: str
) -> None:
    loop = start(family, stop_s=0.5)
    goal_handle = send(loop, *points)
    assert (goal_handle.status, goal_handle.result) == (GoalStatus.REJECTED, TrajectoryErrorCode.INVALID_GOAL)
    assert words in goal_handle.text
    assert way_after(loop) < 1e-6
    assert_next_goal_succeeds(loop)


@pytest.mark.parametrize("family", sorted(FAMILIES))
@pytest.mark.parametrize("stop_s", [0.0, 0.3])
@pytest.mark.parametrize("end", ["cancel", "empty goal", "empty command", "switch"])
def test_a_motion_that_is_broken_off_goes_on_by_no_more_than_its_ramp(
    start: Callable[..., Any], family: str, stop_s: float, end: str
) -> None:
    loop = start(family, stop_s=stop_s, tolerance={"goal": 0.02})
    goal_handle = send(loop, (1.0, (1.5, -1.0), (0.0, 0.0)))
    loop.run(0.5)
    speed = abs(loop.robot_hw.joints[0].state.velocity)
    assert speed > 1.5
    if end == "cancel":
        loop.controllers["c"].cancel(goal_handle)
    elif end == "switch":
        assert loop.switch([], ["c"]) is None
    else:
        names = JOINTS if end == "empty goal" else ()
        goal = TrajectoryGoal(JointTrajectory.of_points(names, ()))
        loop.controllers["c"].submit(goal, RealtimeGoalHandle() if end == "empty goal" else None)
    if family == "effort" and end == "switch":
        return  # a body without friction rolls on when nothing brakes it
    way = way_after(loop)
    lag_s = 0.1 if family in GAINS else 0.03  # gains follow later
    assert way <= speed * (0.5 * stop_s + lag_s) + 1e-3
    assert goal_handle.status is GoalStatus.CANCELED
    if end == "switch":
        assert loop.switch(["c"], []) is None
    assert_next_goal_succeeds(loop)


@pytest.mark.parametrize("family", sorted(FAMILIES))
@pytest.mark.parametrize("end", ["cancel", "path", "goal", "switch"])
def test_at_a_wall_the_actual_position_is_held_and_nothing_pushes(
    start: Callable[..., Any], family: str, end: str
) -> None:
    loop = start(family, tolerance=GOAL if end == "path" else {"goal": 0.02})
    loop.robot_hw.wall = 0.2
    goal_handle = send(loop, (1.0, (1.0, 0.1), (0.0, 0.0)))
    loop.run(0.7)
    if end == "cancel":
        loop.controllers["c"].cancel(goal_handle)
    elif end == "switch":
        assert loop.switch([], ["c"]) is None
    loop.run(1.5)
    assert goal_handle.result is {
        "path": TrajectoryErrorCode.PATH_TOLERANCE_VIOLATED,
        "goal": TrajectoryErrorCode.GOAL_TOLERANCE_VIOLATED,
    }.get(end, TrajectoryErrorCode.INVALID_GOAL)
    rest = 0.0 if family in GAINS else 0.2
    assert loop.robot_hw.joints[0].command == pytest.approx(rest, abs=1e-6)
    if end != "switch":
        assert loop.controllers["c"].desired_at(loop.time_s)[:, 0] == pytest.approx([0.2, 0.0, 0.0])
        loop.robot_hw.wall = float("inf")
        assert way_after(loop) < 1e-3
        assert_next_goal_succeeds(loop)


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_no_goal_makes_a_controller_forget_where_its_joints_are(start: Callable[..., Any], family: str) -> None:
    loop = start(family, limits=None, stop_s=0.5)
    loop.robot_hw.wall = 0.01
    for velocity in (1e6, -1e6, 1e9):
        goal_handle = send(loop, (0.5, (0.5, 0.005), (velocity, 0.0)))
        loop.run(2.0)
        assert goal_handle.status is GoalStatus.ABORTED
        before = positions(loop)
        desired = loop.controllers["c"].desired_at(loop.time_s)
        assert abs(desired[0, 0] - before[0]) < 1e-3 or family in GAINS
    loop.robot_hw.wall = float("inf")
    assert way_after(loop, 1.0) < 0.1
    assert_next_goal_succeeds(loop)


def test_a_preempting_goal_that_the_present_motion_makes_too_fast_is_refused_and_the_motion_goes_on(
    start: Callable[..., Any],
) -> None:
    loop = start()
    first = send(loop, (1.0, (1.5, 0.0), (0.0, 0.0)))
    loop.run(0.5)
    second = send(loop, (0.2, (0.0, 0.0), (0.0, 0.0)))
    assert second.status is GoalStatus.REJECTED
    assert "on the way to point 0, joint 'pan' reaches the velocity -" in second.text
    loop.run(0.7)
    assert first.status is GoalStatus.SUCCEEDED


def test_a_joint_outside_its_range_may_come_back(make_loop: Callable[..., Any]) -> None:
    loop = make_loop(
        {
            "hw": {"joints": list(JOINTS), "initial_positions": {"pan": 6.4}},
            "joint_limits": dict.fromkeys(JOINTS, LIMITS),
            "c": {"type": "position_controllers/JointTrajectoryController", "joints": list(JOINTS)},
        },
        WalledRobotHW(),
    )
    loop.spawn("c")
    loop.robot_hw.joints[0].state.position = 6.4
    further = send(loop, (1.0, (6.5, 0.0), (0.0, 0.0)))
    assert "joint 'pan' is 6.5; its limits are -6.28 to 6.28 (the joint is outside, at 6.4)" in further.text
    back = send(loop, (1.0, (6.0, 0.0), (0.0, 0.0)))
    loop.run(1.1)
    assert back.status is GoalStatus.SUCCEEDED and positions(loop)[0] == pytest.approx(6.0)


class BlindRobotHW(WalledRobotHW):
    """Fake hardware that can lose the measured position of its first joint.

    Attributes:
        blind: whether that is not a number.
        position: where the joint is [rad].
    """

    def __init__(self) -> None:
        super().__init__()
        self.blind = False
        self.position = 0.0

    def read(self, time_s: float, period_s: float) -> None:
        state = self.joints[0].state
        state.position = self.position
        super().read(time_s, period_s)
        self.position = state.position
        if self.blind:
            state.position = math.nan


@pytest.mark.parametrize("family", sorted(FAMILIES))
@pytest.mark.parametrize("stop_s", [0.0, 0.3])
def test_a_joint_that_is_measured_at_no_position_stops_and_takes_no_goals_until_it_is_measured_again(
    start: Callable[..., Any], family: str, stop_s: float
) -> None:
    hw = BlindRobotHW()
    loop = start(family, stop_s=stop_s, tolerance={"goal": 0.02}, hw=hw)
    goal_handle = send(loop, (1.0, (1.5, -1.0), (0.0, 0.0)))
    loop.run(0.5)
    before, speed, hw.blind = hw.position, hw.joints[0].velocity, True
    refused = send(loop, (5.0, (0.1, 0.1), (0.0, 0.0)))
    for lost in (goal_handle, refused):
        assert "joint 'pan' is measured at nan; expected a position" in lost.text
    assert (goal_handle.status, refused.status) == (GoalStatus.ABORTED, GoalStatus.REJECTED)
    for _ in range(50):
        loop.step()
        assert all(math.isfinite(joint.command) for joint in hw.joints)
    if family != "effort":  # a body without friction rolls on when nothing brakes it
        assert abs(hw.position - before) <= speed * (0.5 * stop_s + 0.03) + 1e-3
    hw.blind = False
    loop.run(1.0)
    assert way_after(loop, 1.0) < 1e-3
    assert_next_goal_succeeds(loop)


@pytest.mark.parametrize("family", sorted(FAMILIES))
def test_a_controller_does_not_start_on_a_joint_that_is_measured_at_no_position(
    start: Callable[..., Any], family: str
) -> None:
    hw = BlindRobotHW()
    loop = start(family, hw=hw)
    assert loop.switch([], ["c"]) is None
    hw.blind = True
    for _ in range(2):
        assert "joint 'pan' is measured at nan" in str(loop.switch(["c"], []))
        assert all(math.isfinite(joint.command) for joint in hw.joints)
    hw.blind = False
    assert loop.switch(["c"], []) is None
    assert_next_goal_succeeds(loop)


class LateRobotHW(WalledRobotHW):
    """Fake hardware that follows commands a cycle late, and measures angles between -pi and pi."""

    def __init__(self) -> None:
        super().__init__()
        self._under_way: list[float] = []

    def read(self, time_s: float, period_s: float) -> None:
        self._sent, self._under_way = self._under_way or self._sent, self._sent
        before = [joint.position for joint in self.joints]
        super().read(time_s, period_s)
        for joint, then in zip(self.joints, before, strict=True):
            joint.state.velocity = math.remainder(joint.position - then, 2.0 * math.pi) / period_s
            joint.state.position = math.remainder(joint.position, 2.0 * math.pi)


@pytest.fixture
def late_loop(make_loop: Callable[..., Any]) -> Any:
    endless = {
        "has_position_limits": False,
        "angle_wraparound": True,
        "has_velocity_limits": True,
        "max_velocity": FASTEST,
    }
    loop = make_loop(
        {
            "hw": {"joints": list(JOINTS)},
            "joint_limits": dict.fromkeys(JOINTS, endless),
            **{
                name: {
                    "type": "position_controllers/JointTrajectoryController",
                    "joints": list(JOINTS),
                    "stop_trajectory_duration": stop_s,
                }
                for name, stop_s in (("c", 0.1), ("hold", 0.0))
            },
        },
        LateRobotHW(),
    )
    loop.manager.load_controller("hold")
    loop.spawn("c")
    return loop


def test_on_a_ramp_a_joint_that_follows_late_never_turns_back(late_loop: Any) -> None:
    goal_handle = send(late_loop, (4.0, (0.8, 0.0), (0.0, 0.0)))
    late_loop.run(2.0)
    late_loop.controllers["c"].cancel(goal_handle)
    seen = []
    for _ in range(40):
        late_loop.step()
        seen.append(positions(late_loop)[0])
    assert all(after >= before - 1e-9 for before, after in pairwise(seen))
    assert seen[-1] == seen[-10]


def test_a_ramp_at_a_wall_begins_with_no_more_than_the_last_command(late_loop: Any) -> None:
    late_loop.robot_hw.wall = 0.26
    goal_handle = send(late_loop, (1.0, (0.8, 0.0), (0.0, 0.0)))
    late_loop.run(0.5)
    late_loop.controllers["c"].cancel(goal_handle)
    late_loop.run(0.5)
    assert 0.26 < late_loop.controllers["c"].desired_at(late_loop.time_s)[0, 0] < 0.28


@pytest.mark.parametrize("name", ["c", "hold"])
def test_a_joint_without_end_is_stopped_in_the_turn_in_which_it_is_commanded(late_loop: Any, name: str) -> None:
    assert name == "c" or late_loop.switch([name], ["c"]) is None
    late_loop.controllers["c"] = late_loop.controllers[name]
    for target in (3.0, 4.5):
        goal_handle = send(late_loop, (2.0, (target, 0.0), (0.0, 0.0)))
        late_loop.run(2.1 if target == 3.0 else 1.0)
    assert positions(late_loop)[0] < -2.0, "measured a turn below its command"
    late_loop.controllers["c"].cancel(goal_handle)
    before = late_loop.robot_hw.joints[0].command
    late_loop.run(0.5)
    assert before > 3.5 and late_loop.robot_hw.joints[0].command == pytest.approx(before, abs=0.1)
    assert late_loop.switch([], [name]) is None
    assert late_loop.robot_hw.joints[0].command == pytest.approx(before, abs=0.1)
