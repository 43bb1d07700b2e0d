# SPDX-License-Identifier: BSD-3-Clause
"""The rules of ros_controllers' trajectory controller, one by one.

They are tested as a client of actions and topics meets them, in simulated time.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rospy
from control_msgs.msg import FollowJointTrajectoryGoal, JointTolerance
from control_msgs.srv import QueryTrajectoryState
from controller_manager_msgs.srv import ListControllers, SwitchController
from scipy.interpolate import BPoly, CubicHermiteSpline
from trajectory_msgs.msg import JointTrajectory

sys.path.insert(0, str(Path(__file__).parent))
from stepped_robot import PERIOD_S, Arm, SteppedRobot, trajectory_of  # noqa: E402

URDF = (
    "<robot name='r'>"
    + "".join(
        f"<joint name='{name}' type='{kind}'><limit lower='-50' upper='50' velocity='90' effort='900'/></joint>"
        for name, kind in (
            ("shoulder", "revolute"),
            ("elbow", "revolute"),
            ("wrist", "continuous"),
            ("pan", "revolute"),
            ("tilt", "revolute"),
            ("rail", "prismatic"),
            ("hoist", "prismatic"),
        )
    )
    + "</robot>"
)
ARM, HEAD = ["shoulder", "elbow", "wrist"], ["pan", "tilt"]
PARAMETERS: dict[str, Any] = {
    "robot_description": URDF,
    "robot_hardware": ["by_position", "by_velocity", "by_effort"],
    "by_position": {"type": "by_position", "joints": [*ARM, *HEAD]},
    "by_velocity": {"type": "by_velocity", "joints": ["rail"], "command_interface": "VelocityJointInterface"},
    "by_effort": {"type": "by_effort", "joints": ["hoist"], "command_interface": "EffortJointInterface"},
    "arm": {
        "type": "position_controllers/JointTrajectoryController",
        "joints": ARM,
        "state_publish_rate": 1000.0,
        "action_monitor_rate": 10.0,
        "stop_trajectory_duration": 0.2,
        "constraints": {
            "goal_time": 0.3,
            "stopped_velocity_tolerance": 0.05,
            "shoulder": {"trajectory": 0.1, "goal": 0.01},
            "elbow": {"goal": 0.02},
        },
    },
    "head": {
        "type": "position_controllers/JointTrajectoryController",
        "joints": HEAD,
        "state_publish_rate": 1000.0,
        "allow_partial_joints_goal": True,
        "constraints": {"goal_time": 0.1},
    },
    "lift": {
        "type": "velocity_controllers/JointTrajectoryController",
        "joints": ["rail"],
        "state_publish_rate": 25.0,
        "gains": {"rail": {"p": 20.0}},
        "velocity_ff": {"rail": 1.0},
        "constraints": {"goal_time": 0.5, "rail": {"trajectory": 0.05, "goal": 0.001}},
    },
    "crane": {
        "type": "effort_controllers/JointTrajectoryController",
        "joints": ["hoist"],
        "state_publish_rate": 25.0,
        "gains": {"hoist": {"p": 400.0, "d": 40.0, "i": 1.0, "i_clamp": 1.0}},
        "constraints": {"goal_time": 1.0, "stopped_velocity_tolerance": 0.01, "hoist": {"goal": 0.001}},
    },
}
OK, INVALID_GOAL, INVALID_JOINTS, PATH, GOAL = 0, -1, -2, -4, -5
HOME = [0.0, 0.0, 0.0]


@pytest.fixture(scope="module")
def robot(ros_session: Any) -> Iterator[SteppedRobot]:
    stepped = SteppedRobot(PARAMETERS, ["arm", "head", "lift", "crane"])
    yield stepped
    stepped.close()


@pytest.fixture(scope="module")
def clients(robot: SteppedRobot) -> dict[str, Arm]:
    return {name: Arm(robot, name, PARAMETERS[name]["joints"]) for name in ("arm", "head", "lift", "crane")}


@pytest.fixture
def arm(robot: SteppedRobot, clients: dict[str, Arm]) -> Arm:
    """The arm at rest at 0."""
    hardware = robot.hardware["by_position"]
    hardware.blocked, hardware.reason, hardware.scaling.factor = {}, "", 1.0
    client = clients["arm"]
    if any(client.state().actual.positions):
        home = client.send(
            (0.5, HOME),
            goal_time_tolerance=rospy.Duration(2.0),
            path_tolerance=[JointTolerance(name="shoulder", position=-1.0)],
        )
        robot.run(0.7)
        assert client.result(home)[:2] == ("SUCCEEDED", OK)
    return client


@pytest.fixture
def head(clients: dict[str, Arm]) -> Arm:
    return clients["head"]


def move(robot: SteppedRobot, client: Arm, *points: Any, **more: Any) -> tuple[str, int, str]:
    handle = client.send(*points, **more)
    robot.run(float(points[-1][0]) + 1.0)
    return client.result(handle)


def independent_curve(order: int, times: np.ndarray, states: np.ndarray) -> Any:
    """Positions over time of one joint by SciPy alone; `states` is (points, 3)."""
    if order == 1:
        return lambda time_s: np.interp(time_s, times, states[:, 0])
    if order == 3:
        return CubicHermiteSpline(times, states[:, 0], states[:, 1])
    return BPoly.from_derivatives(times, states)


@pytest.mark.parametrize("order", [1, 3, 5])
def test_ten_random_points_are_tracked_to_a_millionth_by_the_curve_that_what_they_give_asks_for(
    arm: Arm, order: int
) -> None:
    rng = np.random.default_rng(order)
    times = np.concatenate([[0.0], np.cumsum(rng.uniform(0.3, 0.5, 10))])
    states = rng.uniform(-0.3, 0.3, (11, 3, 3))
    states[0] = 0.0
    rows = (order + 1) // 2
    points = [(t, *(list(row) for row in state[:rows])) for t, state in zip(times[1:], states[1:], strict=True)]
    goal = arm.goal(*points, path_tolerance=[JointTolerance(name="shoulder", position=-1.0)])
    arm.send_goal(goal)
    begun_s = arm.robot.time_s
    curves = [independent_curve(order, times, states[:, :, joint]) for joint in range(3)]
    trace = arm.trace(times[-1] + 0.1)
    for state in trace:
        since_s = min(state.header.stamp.to_sec() - begun_s, times[-1])
        before_s = min(state.header.stamp.to_sec() - begun_s - PERIOD_S, times[-1])
        for joint, curve in enumerate(curves):
            assert abs(state.desired.positions[joint] - curve(since_s)) < 1e-6
            assert abs(state.actual.positions[joint] - curve(before_s)) < 1e-6
    assert len(trace) == pytest.approx((times[-1] + 0.1) / PERIOD_S, abs=1)


def test_between_points_of_different_kind_the_curve_is_what_both_give(arm: Arm) -> None:
    arm.send_goal(
        arm.goal(
            (0.5, [0.4, 0.0, 0.0], HOME, HOME),
            (1.0, [0.0, 0.2, 0.0], HOME),
            (1.5, [0.4, 0.0, 0.0]),
            path_tolerance=[JointTolerance(name="shoulder", position=-1.0)],
        )
    )
    arm.robot.run(0.5)
    shares = [state.desired.positions[0] / 0.4 for state in arm.trace(1.0)]
    assert shares[24] == pytest.approx(0.5) and shares[11] == pytest.approx(1.0 - 3 * 0.24**2 + 2 * 0.24**3)
    assert shares[74] == pytest.approx(0.5) and shares[61] == pytest.approx(0.24)


def test_accelerations_without_velocities_are_as_good_as_none(arm: Arm) -> None:
    arm.send_goal(arm.goal((1.0, [0.4, 0.0, 0.0], [], [1.0, 1.0, 1.0])))
    assert [state.desired.positions[0] for state in arm.trace(0.5)] == pytest.approx(
        [0.4 * (i + 1) * PERIOD_S for i in range(50)]
    )


def test_a_first_point_at_time_0_is_where_the_arm_is_and_left_out(robot: SteppedRobot, arm: Arm) -> None:
    assert move(robot, arm, (0.0, [0.3, 0.3, 0.3]), (1.0, [0.1, 0.1, 0.1])) == ("SUCCEEDED", OK, "goal reached")
    assert arm.state().actual.positions == pytest.approx((0.1, 0.1, 0.1))


def test_of_a_stamp_in_the_past_the_points_still_to_come_are_followed(robot: SteppedRobot, arm: Arm) -> None:
    handle = arm.send((0.5, [9.0, 9.0, 9.0]), (1.5, [0.2, 0.1, 0.0]), stamp_s=robot.time_s - 1.0)
    trace = arm.trace(0.5)
    assert max(state.desired.positions[0] for state in trace) <= 0.2 + 1e-9
    assert trace[-1].desired.positions == pytest.approx((0.2, 0.1, 0.0))
    robot.run(0.3)
    assert arm.result(handle)[1] == OK


@pytest.mark.parametrize(("ago_s", "points"), [(3.0, [(1.0, HOME), (2.0, HOME)]), (0.0, [(0.0, HOME)])])
def test_a_goal_wholly_in_the_past_is_refused_and_the_motion_under_way_goes_on(
    robot: SteppedRobot, arm: Arm, ago_s: float, points: list[Any]
) -> None:
    running = arm.send((1.0, [0.3, 0.0, 0.0]))
    robot.run(0.3)
    late = arm.send(*points, stamp_s=robot.time_s - ago_s if ago_s else 0.0)
    state, code, text = arm.result(late)
    assert (state, code) == ("REJECTED", INVALID_GOAL) and "in the past" in text
    robot.run(1.1)
    assert arm.result(running)[:2] == ("SUCCEEDED", OK)


def test_a_stamp_in_the_future_waits_and_until_then_the_motion_before_goes_on(robot: SteppedRobot, arm: Arm) -> None:
    begun_s = robot.time_s
    arm.command(arm.trajectory((1.0, [0.4, 0.4, 0.0], None)))
    robot.run(0.2)
    handle = arm.send((0.5, [0.0, 0.0, 0.0]), stamp_s=begun_s + 0.6)
    trace = arm.trace(0.4)
    old = BPoly.from_derivatives([0.0, 1.0], [[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
    assert [state.desired.positions[0] for state in trace] == pytest.approx(
        [float(old(0.2 + PERIOD_S * (i + 1))) for i in range(40)], abs=1e-7
    )
    at_switch = [float(old.derivative(n)(0.6)) for n in (1, 2)]
    new = BPoly.from_derivatives([0.0, 0.5], [[float(old(0.6)), *at_switch], [0.0, 0.0, 0.0]])
    assert [state.desired.positions[0] for state in arm.trace(0.5)] == pytest.approx(
        [float(new(PERIOD_S * (i + 1))) for i in range(50)], abs=1e-6
    )
    robot.run(0.1)
    assert arm.result(handle)[1] == OK


def test_a_new_goal_takes_over_from_the_state_wanted_then_and_preempts(robot: SteppedRobot, arm: Arm) -> None:
    first = arm.send((1.0, [0.8, 0.0, 0.0]))
    before = arm.trace(0.5)[-1].desired
    second = arm.send((1.0, [0.0, 0.0, 0.0]))
    new = BPoly.from_derivatives(
        [0.0, 1.0], [[before.positions[0], before.velocities[0], before.accelerations[0]], [0.0, 0.0, 0.0]]
    )
    assert [state.desired.positions[0] for state in arm.trace(0.9)] == pytest.approx(
        [float(new(PERIOD_S * (i + 1))) for i in range(90)], abs=1e-6
    )
    assert arm.result(first) == ("PREEMPTED", INVALID_GOAL, "preempted by a new goal")
    robot.run(0.2)
    assert arm.result(second)[:2] == ("SUCCEEDED", OK)


def test_a_message_on_command_preempts_a_goal_and_a_bad_one_does_not(robot: SteppedRobot, arm: Arm) -> None:
    handle = arm.send((1.0, [0.3, 0.0, 0.0]))
    robot.run(0.2)
    arm.command(arm.trajectory((1.0, [0.5, 0.0], None)))
    arm.command(arm.trajectory((1.0, [math.nan, 0.0, 0.0], None)))
    robot.run(0.1)
    assert arm.is_running(handle)
    arm.command(arm.trajectory((1.0, [0.1, 0.2, 0.3], None)))
    assert arm.result(handle)[0] == "PREEMPTED"
    robot.run(1.1)
    assert arm.state().actual.positions == pytest.approx((0.1, 0.2, 0.3))


def test_cancel_comes_to_rest_within_the_stop_duration(robot: SteppedRobot, arm: Arm) -> None:
    handle = arm.send((1.0, [0.8, 0.0, 0.0]))
    before = arm.trace(0.5)[-1].desired
    handle.cancel()
    assert arm.result(handle) == ("PREEMPTED", INVALID_GOAL, "canceled on request")
    trace = arm.trace(0.4)
    velocities = [state.desired.velocities[0] for state in trace]
    assert velocities[0] == pytest.approx(before.velocities[0], rel=0.05)
    assert min(velocities) >= -1e-9 and velocities[18] > 0.0 and not any(velocities[20:])
    assert trace[-1].desired.positions[0] == pytest.approx(before.positions[0] + 0.5 * 0.2 * before.velocities[0])


def test_without_a_stop_duration_cancel_holds_at_once(robot: SteppedRobot, head: Arm) -> None:
    handle = head.send((1.0, [0.8, 0.0]))
    before = head.trace(0.5)[-1].desired
    handle.cancel()
    assert head.result(handle)[0] == "PREEMPTED"
    after = head.state().desired
    assert after.positions == before.positions and not any(after.velocities)


@pytest.mark.parametrize("by_goal", [False, True])
def test_a_trajectory_without_points_stops(robot: SteppedRobot, arm: Arm, by_goal: bool) -> None:
    moving = arm.send((2.0, [0.8, 0.0, 0.0]))
    before = arm.trace(1.0)[-1].desired.positions[0]
    if by_goal:
        stop = arm.send()
        robot.run(0.3)
        assert arm.result(stop)[:2] == ("SUCCEEDED", OK)
    else:
        arm.command(JointTrajectory())
        robot.run(0.3)
    assert arm.result(moving)[0] == "PREEMPTED"
    rest = arm.state().desired
    assert not any(rest.velocities) and before < rest.positions[0] < 0.7


def test_a_joint_off_its_path_aborts_with_its_name_error_and_tolerance(robot: SteppedRobot, arm: Arm) -> None:
    robot.hardware["by_position"].blocked["shoulder"] = 0.05
    handle = arm.send((1.0, [0.8, 0.0, 0.0]))
    trace = arm.trace(1.0)
    state, code, text = arm.result(handle)
    assert (state, code) == ("ABORTED", PATH)
    assert text.startswith("path tolerance violated: joint 'shoulder': position error 0.1")
    assert text.endswith(", tolerance 0.1")
    assert not any(trace[-1].desired.velocities) and trace[-1].desired.positions[0] < 0.5


def test_a_joint_short_of_its_goal_aborts_when_goal_time_is_over(robot: SteppedRobot, arm: Arm) -> None:
    robot.hardware["by_position"].blocked["elbow"] = 0.05
    handle = arm.send((1.0, [0.0, 0.1, 0.0]))
    robot.run(1.29)
    assert arm.is_running(handle)
    robot.run(0.02)
    state, code, text = arm.result(handle)
    assert (state, code) == ("ABORTED", GOAL)
    assert "joint 'elbow': position error 0.05, tolerance 0.02" in text and "goal_time 0.3 s" in text


def test_a_joint_that_comes_within_goal_time_succeeds(robot: SteppedRobot, arm: Arm) -> None:
    robot.hardware["by_position"].blocked["elbow"] = 0.05
    handle = arm.send((1.0, [0.0, 0.1, 0.0]))
    robot.run(1.2)
    assert arm.is_running(handle)
    del robot.hardware["by_position"].blocked["elbow"]
    robot.run(0.05)
    assert arm.result(handle)[:2] == ("SUCCEEDED", OK)


def test_a_joint_that_still_moves_has_not_arrived(robot: SteppedRobot, arm: Arm) -> None:
    handle = arm.send_goal(arm.goal((0.505, [0.0, 0.0, 0.5]), goal_time_tolerance=rospy.Duration(-1.0)))
    robot.run(0.6)
    state, code, text = arm.result(handle)
    assert (state, code) == ("ABORTED", GOAL) and "joint 'wrist': velocity error -" in text and "tolerance 0.05" in text


def test_a_goal_replaces_keeps_and_erases_tolerances(robot: SteppedRobot, arm: Arm) -> None:
    blocked = robot.hardware["by_position"].blocked
    blocked["shoulder"] = 0.0
    wide = [JointTolerance(name="shoulder", position=0.5)]
    assert "tolerance 0.1" in move(robot, arm, (1.0, [0.4, 0.0, 0.0]))[2]
    assert move(robot, arm, (1.0, [0.4, 0.0, 0.0]), path_tolerance=wide)[1] == GOAL
    assert move(robot, arm, (1.0, [0.4, 0.0, 0.0]), path_tolerance=wide, goal_tolerance=wide)[1] == OK
    erased = [JointTolerance(name="shoulder", position=-1.0)]
    assert move(robot, arm, (1.0, [0.9, 0.0, 0.0]), path_tolerance=erased, goal_tolerance=erased)[1] == OK
    kept = [JointTolerance(name="shoulder", position=0.0)]
    assert move(robot, arm, (1.0, HOME), path_tolerance=erased, goal_tolerance=kept)[1] == OK


@pytest.mark.parametrize(("seconds", "until_s"), [(0.6, 1.6), (0.0, 1.3), (-1.0, 1.0)])
def test_a_goal_sets_keeps_and_takes_away_goal_time(
    robot: SteppedRobot, arm: Arm, seconds: float, until_s: float
) -> None:
    robot.hardware["by_position"].blocked["elbow"] = 0.05
    handle = arm.send((1.0, [0.0, 0.1, 0.0]), goal_time_tolerance=rospy.Duration.from_sec(seconds))
    robot.run(until_s - PERIOD_S)
    assert arm.is_running(handle)
    robot.run(2.0 * PERIOD_S)
    assert arm.result(handle)[1] == GOAL


def test_joints_may_come_in_any_order(robot: SteppedRobot, arm: Arm) -> None:
    assert move(robot, arm, (1.0, [0.3, 0.1, 0.2]), names=["wrist", "shoulder", "elbow"])[1] == OK
    assert arm.state().actual.positions == pytest.approx((0.1, 0.2, 0.3))


def test_where_it_is_allowed_a_goal_moves_some_joints_and_the_others_finish_what_they_were_at(
    robot: SteppedRobot, head: Arm
) -> None:
    head.command(head.trajectory((2.0, [0.5, 0.5], None)))
    robot.run(0.5)
    assert move(robot, head, (0.5, [-0.2]), names=["pan"])[1] == OK
    robot.run(0.5)
    assert head.state().actual.positions == pytest.approx((-0.2, 0.5))


@pytest.mark.parametrize(
    ("begin", "target", "turn"),
    [
        (0.0, 2.0 * math.pi + 0.1, 0.1),
        (3.0, -3.0, 2.0 * math.pi - 6.0),
        (0.1, 0.2 - 6.0 * math.pi, 0.1),
        (0.0, -math.pi + 0.01, -math.pi + 0.01),
    ],
)
def test_a_joint_without_end_goes_the_short_way(
    robot: SteppedRobot, arm: Arm, begin: float, target: float, turn: float
) -> None:
    assert move(robot, arm, (1.0, [0.0, 0.0, begin]))[1] == OK
    before = arm.state().actual.positions[2]
    assert math.remainder(before - begin, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-9)
    assert move(robot, arm, (1.0, [0.0, 0.0, target]), (1.5, [0.0, 0.0, target + 0.2]))[1] == OK
    assert arm.state().actual.positions[2] - before == pytest.approx(turn + 0.2)


@pytest.mark.parametrize("to_and_fro", [math.pi / 2.0, -math.pi / 2.0])
def test_half_a_turn_goes_the_way_of_the_numbers(robot: SteppedRobot, arm: Arm, to_and_fro: float) -> None:
    here = arm.state().actual.positions[2]
    for target in (here + to_and_fro, here - to_and_fro, here + to_and_fro):
        assert move(robot, arm, (1.0, [0.0, 0.0, target]))[1] == OK
        assert arm.state().actual.positions[2] == pytest.approx(target)


def shortest_gap_s(messages: list[Any]) -> float:
    """Between the stamps of two messages [s]; those of a busy computer's full queues are missing."""
    return float(np.diff([message.header.stamp.to_sec() for message in messages]).min())


def test_states_and_feedback_come_at_their_rates_and_have_the_progress_of_the_trajectory(
    robot: SteppedRobot, arm: Arm, clients: dict[str, Arm]
) -> None:
    feedback: list[Any] = []
    handle = arm.send_goal(arm.goal((1.0, [0.4, 0.0, 0.0], None)), lambda _, message: feedback.append(message))
    clients["crane"].states.clear()
    trace = arm.trace(0.95)
    slow = clients["crane"].states
    robot.wait_until(lambda: slow and slow[-1].header.stamp.to_sec() > robot.time_s - 0.05)
    robot.wait_until(lambda: feedback and feedback[-1].header.stamp.to_sec() > robot.time_s - 0.11)
    assert len(trace) == 95
    assert shortest_gap_s(slow) == pytest.approx(0.04) and shortest_gap_s(feedback) == pytest.approx(0.1)
    for number, state in enumerate(trace):
        assert state.desired.time_from_start.to_sec() == pytest.approx((number + 1) * PERIOD_S)
        assert list(state.joint_names) == ARM
        assert state.error.positions == pytest.approx(np.subtract(state.desired.positions, state.actual.positions))
        assert state.error.velocities == pytest.approx(np.subtract(state.desired.velocities, state.actual.velocities))
        assert len(state.desired.accelerations) == 3
    assert feedback[-1].desired.time_from_start.to_sec() == pytest.approx(0.9, abs=0.06)
    robot.run(0.1)
    assert arm.result(handle)[1] == OK


def test_query_state_returns_what_is_desired_when(robot: SteppedRobot, arm: Arm) -> None:
    query = rospy.ServiceProxy("arm/query_state", QueryTrajectoryState)
    arm.send((1.0, [0.4, 0.0, 0.0]))
    begun_s = robot.time_s
    robot.run(0.3)
    curve = BPoly.from_derivatives([0.0, 1.0], [[0.0] * 3, [0.4, 0.0, 0.0]])
    for since_s in (0.0, 0.2, 0.5, 0.9):
        answer = query(rospy.Time.from_sec(begun_s + since_s))
        assert list(answer.name) == ARM
        assert [answer.position[0], answer.velocity[0], answer.acceleration[0]] == pytest.approx(
            [float(curve(since_s)), *(float(curve.derivative(n)(since_s)) for n in (1, 2))], abs=1e-5
        )
    after = query(rospy.Time.from_sec(begun_s + 5.0))
    assert list(after.position[:2]) == pytest.approx([0.4, 0.0]) and not any(after.velocity)
    with pytest.raises(rospy.ServiceException, match="before the start of the current motion"):
        query(rospy.Time.from_sec(begun_s - 5.0))


def faulty(**changes: Any) -> FollowJointTrajectoryGoal:
    """A goal of which is changed: `names`, `points`, or other fields."""
    names, points = changes.pop("names", ARM), changes.pop("points", [(1.0, HOME, None)])
    return FollowJointTrajectoryGoal(trajectory=trajectory_of(names, *points), **changes)


INF, NAN = math.inf, math.nan


@pytest.mark.parametrize(
    ("goal", "code", "words"),
    [
        (
            faulty(points=[(1.0, [0.0, NAN, 0.0], None)]),
            INVALID_GOAL,
            "point 0: position of joint 'elbow' (index 1) is nan; expected a finite number",
        ),
        (
            faulty(points=[(1.0, HOME, None), (2.0, [INF, 0.0, 0.0], None)]),
            INVALID_GOAL,
            "point 1: position of joint 'shoulder' (index 0) is inf",
        ),
        (faulty(points=[(1.0, HOME, [0.0, 0.0, -INF])]), INVALID_GOAL, "velocity of joint 'wrist' (index 2) is -inf"),
        (faulty(points=[(1.0, HOME, HOME, [NAN, 0.0, 0.0])]), INVALID_GOAL, "acceleration of joint 'shoulder'"),
        (faulty(points=[(1.0, [1e300, 0.0, 0.0], None)]), INVALID_GOAL, "of at most 1e+09 in size"),
        (
            faulty(points=[(1.0, HOME, None), (1.0, HOME, None)]),
            INVALID_GOAL,
            "point 1: time_from_start 1 s does not come after 1 s of point 0; times must increase strictly",
        ),
        (faulty(points=[(2.0, HOME, None), (1.0, HOME, None)]), INVALID_GOAL, "does not come after 2 s"),
        (faulty(points=[(-1.0, HOME, None)]), INVALID_GOAL, "all 1 points lie in the past"),
        (
            faulty(points=[(1.0, [51.0, 0.0, 0.0], None)]),
            INVALID_GOAL,
            "point 0: position of joint 'shoulder' is 51; its limits are -50 to 50; give a position within the limits",
        ),
        (
            faulty(points=[(1.0, HOME, [0.0, -95.0, 0.0])]),
            INVALID_GOAL,
            "point 0: velocity of joint 'elbow' is -95; its limit is 90; give a lower velocity",
        ),
        (
            faulty(points=[(1.0, HOME, None), (1.1, [0.0, 20.0, 0.0], None)]),
            INVALID_GOAL,
            "on the way to point 1, joint 'elbow' reaches the velocity 375; its limit is 90; give the point a later",
        ),
        (faulty(points=[(1.0, [0.0], None)]), INVALID_GOAL, "point 0: has 1 positions; expected 3"),
        (faulty(points=[(1.0, [0.0] * 4, None)]), INVALID_GOAL, "point 0: has 4 positions; expected 3"),
        (faulty(points=[(1.0, HOME, [0.0])]), INVALID_GOAL, "point 0: has 1 velocities; expected 3 or none"),
        (faulty(points=[(1.0, HOME, HOME, [0.0, 0.0])]), INVALID_GOAL, "has 2 accelerations; expected 3 or none"),
        (faulty(points=[(1.0, [], HOME)]), INVALID_GOAL, "point 0: has 0 positions; expected 3"),
        (faulty(names=["shoulder", "elbow", "knee"]), INVALID_JOINTS, "unknown joint 'knee' (index 2)"),
        (
            faulty(names=["shoulder", "elbow", "elbow"]),
            INVALID_JOINTS,
            "joint 'elbow' is named twice (indices 1 and 2)",
        ),
        (faulty(names=["shoulder", "elbow", ""]), INVALID_JOINTS, "the joint name at index 2 is empty"),
        (
            faulty(names=["shoulder", "elbow"], points=[(1.0, [0.0, 0.0], None)]),
            INVALID_JOINTS,
            "joints missing: wrist (allow_partial_joints_goal is false); "
            "joints of the controller: shoulder, elbow, wrist",
        ),
        (faulty(names=[], points=[]), INVALID_JOINTS, "joints missing: shoulder, elbow, wrist"),
        (
            faulty(names=["shoulder", "elbow", "wrist", "knee"], points=[(1.0, [0.0] * 4, None)]),
            INVALID_JOINTS,
            "'knee'",
        ),
        (
            faulty(goal_tolerance=[JointTolerance(name="elbow", position=NAN)]),
            INVALID_GOAL,
            "goal_tolerance of joint 'elbow' is not a number: position nan",
        ),
    ],
)
def test_a_bad_goal_is_refused_with_what_is_wrong_where_and_nothing_else_happens(
    robot: SteppedRobot, clients: dict[str, Arm], goal: FollowJointTrajectoryGoal, code: int, words: str
) -> None:
    arm = clients["arm"]
    running = arm.send((0.2, arm.state().desired.positions))
    state, got, text = arm.result(arm.send_goal(goal))
    assert (state, got) == ("REJECTED", code)
    assert words in text
    assert arm.is_running(running)
    listed = rospy.ServiceProxy("controller_manager/list_controllers", ListControllers)().controller
    assert {entry.state for entry in listed} == {"running"}


def test_a_first_point_before_the_beginning_and_tolerances_of_other_joints_are_left_out(
    robot: SteppedRobot, arm: Arm
) -> None:
    foreign = [JointTolerance(name="knee", position=1e-9)]
    assert move(
        robot, arm, (-0.1, [9.0, 9.0, 9.0]), (1.0, [0.2, 0.1, 0.0]), path_tolerance=foreign, goal_tolerance=foreign
    )[:2] == ("SUCCEEDED", OK)
    assert arm.state().actual.positions[:2] == pytest.approx((0.2, 0.1))


@pytest.mark.parametrize(("name", "joint"), [("lift", "rail"), ("crane", "hoist")])
def test_gains_and_feed_forward_make_joints_follow_that_take_velocities_or_efforts(
    robot: SteppedRobot, clients: dict[str, Arm], name: str, joint: str
) -> None:
    client = clients[name]
    assert move(robot, client, (1.0, [0.5]), (2.0, [0.2]))[:2] == ("SUCCEEDED", OK)
    robot.run(0.1)
    robot.flush()
    robot.wait_until(lambda: client.states and client.states[-1].header.stamp.to_sec() > robot.time_s - 0.05)
    assert client.states[-1].actual.positions[0] == pytest.approx(0.2, abs=0.002)


def test_a_hardware_fault_ends_the_goal_with_its_reason_and_recovery_takes_new_ones(
    robot: SteppedRobot, arm: Arm, clients: dict[str, Arm]
) -> None:
    other = clients["lift"].send((1.0, [0.0]))
    handle = arm.send((1.0, [0.4, 0.0, 0.0]))
    robot.run(0.5)
    hardware = robot.hardware["by_position"]
    hardware.reason, hardware.blocked = "protective stop", {"shoulder": 0.15}
    robot.step()
    reason = "hardware fault: hardware 'by_position': protective stop"
    assert arm.result(handle) == ("ABORTED", INVALID_GOAL, reason)
    assert arm.state().desired.positions[0] == 0.15
    refused = arm.send((1.0, HOME))
    assert arm.result(refused) == ("REJECTED", INVALID_GOAL, reason)
    hardware.blocked = {"shoulder": 0.17}
    hardware.reason = ""
    robot.step()
    hardware.blocked = {}
    assert [state.actual.positions[0] for state in arm.trace(0.1)] == pytest.approx([0.17] * 10)
    assert move(robot, arm, (1.0, HOME))[1] == OK
    robot.run(0.5)
    assert clients["lift"].result(other)[1] == OK, "the other hardware had no fault"


def test_at_half_speed_a_trajectory_takes_twice_as_long_and_a_pause_violates_nothing(
    robot: SteppedRobot, arm: Arm
) -> None:
    speed = robot.hardware["by_position"].scaling
    handle = arm.send((1.0, [0.8, 0.0, 0.0]))
    robot.run(0.2)
    speed.factor = 0.5
    robot.run(0.8)
    speed.factor = 0.0
    paused = arm.trace(1.0)
    assert paused[0].desired.positions == paused[-1].desired.positions
    assert not any(paused[-1].desired.velocities)
    assert paused[-1].desired.time_from_start.to_sec() == pytest.approx(0.6)
    assert arm.is_running(handle)
    speed.factor = 1.0
    steps = np.diff([state.desired.positions[0] for state in arm.trace(1.0)])
    assert np.abs(np.diff(steps)).max() < 0.0006, "no jump of the velocity"
    assert arm.result(handle)[:2] == ("SUCCEEDED", OK)


def test_a_stopped_controller_ends_its_goal_refuses_others_and_publishes_no_state(
    robot: SteppedRobot, arm: Arm
) -> None:
    switch = rospy.ServiceProxy("controller_manager/switch_controller", SwitchController)
    handle = arm.send((1.0, [0.4, 0.0, 0.0]))
    robot.run(0.2)
    assert robot.wait_for(lambda: switch([], ["arm"], 2, False, 0.0).ok)
    assert arm.result(handle) == ("PREEMPTED", INVALID_GOAL, "the controller was stopped")
    state, code, text = arm.result(arm.send((1.0, HOME)))
    assert (state, code) == ("REJECTED", INVALID_GOAL) and "not running" in text
    with pytest.raises(rospy.ServiceException, match="not running"):
        rospy.ServiceProxy("arm/query_state", QueryTrajectoryState)(rospy.Time.from_sec(robot.time_s))
    robot.hardware["by_position"].blocked = {"shoulder": 0.25}
    robot.run(0.1)
    robot.hardware["by_position"].blocked = {}
    assert robot.wait_for(lambda: switch(["arm"], [], 2, False, 0.0).ok)
