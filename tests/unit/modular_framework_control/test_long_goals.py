# SPDX-License-Identifier: BSD-3-Clause
"""What keeps goals of very many points from holding the control loop; `benchmarks/control_loop` measures the times."""

from __future__ import annotations

import io
import struct
import threading
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rospy.msg
from actionlib_msgs.msg import GoalStatus as GoalStatusMsg
from control_msgs.msg import FollowJointTrajectoryActionGoal, JointTolerance
from genpy import DeserializationError, Duration, Time
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_control.ros import controller_action_server
from modular_framework_control.ros.controller_action_server import ControllerActionServer, GoalCallbacks
from modular_framework_control.ros.conversions import trajectory_from_msg
from modular_framework_control.ros.large_messages import ReceiveBuffer
from modular_framework_control.ros.trajectory_messages import CompactJointTrajectory, CompactTrajectoryActionGoal
from modular_framework_control.trajectory.joint_trajectory import (
    CHUNK_SIZE,
    InvalidTrajectoryError,
    Spline,
    TrajectoryPoints,
    splice,
)
from modular_framework_control.trajectory.point_checks import check_points

POINTS = 3 * CHUNK_SIZE + 7
RNG = np.random.default_rng(35)


def message(points: int = POINTS) -> JointTrajectoryMsg:
    made = JointTrajectoryMsg(joint_names=["a", "b"])
    for i in range(points):
        values = [0.001 * i, -0.001 * i]
        made.points.append(JointTrajectoryPoint(values, values, values, [], Duration.from_sec(0.01 * (i + 1))))
    return made


def serialised(sent: Any) -> bytes:
    raw = io.BytesIO()
    sent.serialize(raw)
    return raw.getvalue()


def received(sent: JointTrajectoryMsg) -> CompactJointTrajectory:
    return CompactJointTrajectory().deserialize(serialised(sent))


def action_goal(trajectory: JointTrajectoryMsg) -> FollowJointTrajectoryActionGoal:
    goal = FollowJointTrajectoryActionGoal()
    goal.header.frame_id, goal.goal_id.id, goal.goal_id.stamp = "frame", "long", Time(7, 8)
    goal.goal.trajectory = trajectory
    goal.goal.path_tolerance = [JointTolerance("a", 0.1, 0.2, 0.3)]
    goal.goal.goal_time_tolerance = Duration(3)
    return goal


def assert_same_points(points: TrajectoryPoints, sent: list[JointTrajectoryPoint]) -> None:
    assert points.times_s.tolist() == [point.time_from_start.to_sec() for point in sent]
    for row, kind in enumerate(("positions", "velocities", "accelerations")):
        rows = [getattr(point, kind) for point in sent]
        assert points.counts[:, row].tolist() == [len(values) for values in rows]
        joints = points.values.shape[2]
        expected = [(list(values) + [0.0] * joints)[:joints] for values in rows]
        np.testing.assert_array_equal(points.values[:, row], expected)


@pytest.mark.parametrize("mixed", [1, 3, POINTS])
def test_compact_messages_hold_what_was_sent(mixed: int) -> None:
    """`mixed` points after one another have the same sizes; genpy's own classes are the reference."""
    sent = message()
    for begin in range(0, POINTS, mixed):
        sizes = RNG.choice([0, 1, 2, 3], size=4, p=[0.1, 0.1, 0.7, 0.1])
        for point in sent.points[begin : begin + mixed]:
            point.positions, point.velocities, point.accelerations, point.effort = (
                RNG.uniform(-9.0, 9.0, size).tolist() for size in sizes
            )
            point.time_from_start = Duration(int(RNG.integers(-5, 5)), int(RNG.integers(0, 10**9)))
    sent.points[5].positions = [float("nan"), float("inf")]
    assert_same_points(received(sent).points, sent.points)
    goal = action_goal(sent)
    compact = CompactTrajectoryActionGoal().deserialize(serialised(goal))
    assert_same_points(compact.goal.trajectory.points, sent.points)
    compact.goal.trajectory.points = sent.points = []
    assert serialised(compact) == serialised(goal)


def test_a_message_that_is_cut_off_or_claims_what_it_does_not_hold_is_refused() -> None:
    raw = serialised(message(3))
    for end in range(len(raw)):
        with pytest.raises(DeserializationError):
            CompactJointTrajectory().deserialize(raw[:end])
    names_end = 12 + 4 + 4 + 2 * 5
    for offset in (names_end, names_end + 4):  # the number of points, and the first point's number of positions
        with pytest.raises(DeserializationError):
            CompactJointTrajectory().deserialize(raw[:offset] + b"\xff" * 4 + raw[offset + 4 :])


def test_points_without_values_for_very_many_joints_take_no_memory() -> None:
    sent = JointTrajectoryMsg(joint_names=[str(i) for i in range(2000)], points=[JointTrajectoryPoint()] * 2000)
    points = received(sent).points
    assert points.values.nbytes == 0 and len(points) == 2000
    with pytest.raises(InvalidTrajectoryError, match="point 0: has 0 positions; expected 2000"):
        check_points(trajectory_from_msg(received(sent)))


def test_a_track_copies_nothing_of_a_trajectory_in_the_control_loop() -> None:
    spline = Spline(trajectory_from_msg(received(message())))
    track = splice(spline, [0, 1], origin_s=10.0, splice_s=10.0, state=np.full((3, 2), 7.0), continuous=[True, True])
    assert np.shares_memory(track.others, spline.coefficients)
    part = track.without([1])
    assert part is not None and np.shares_memory(part.others, spline.coefficients)
    assert part.sample(12.003) == pytest.approx(track.sample(12.003)[:, :1])
    assert track.sample(12.0)[0, 0] == pytest.approx(0.199 + 2.0 * np.pi), "continuous joints keep their rotation"


@pytest.mark.parametrize("piece", [100, 65536])
def test_large_messages_are_received_in_pieces_and_are_the_same(piece: int) -> None:
    sent = [action_goal(message(points)) for points in (5000, 0, 5000, 1)]
    stream = b"".join(struct.pack("<I", len(raw)) + raw for raw in map(serialised, sent))
    buffer, taken = ReceiveBuffer(), []
    for begin in range(0, len(stream), piece):
        buffer.write(stream[begin : begin + piece])
        rospy.msg.deserialize_messages(buffer, taken, FollowJointTrajectoryActionGoal)
    assert taken == sent and buffer.tell() == 0 and buffer.getvalue() == b""


class FakeServer:
    """In place of the action server, which calls with its lock held."""

    ns = "server"
    made: list[FakeServer]

    def __init__(self, name: str, action: Any, on_goal: Any, on_cancel: Any, auto_start: bool) -> None:
        self.lock, self.on_goal, self.on_cancel = threading.RLock(), on_goal, on_cancel
        self.made.append(self)

    def start(self) -> None:
        pass


@pytest.fixture
def goal() -> Any:
    """A goal handle of the server, to which a cancel comes while the goal is checked."""
    status = SimpleNamespace(status=GoalStatusMsg.PENDING)
    return SimpleNamespace(get_goal=lambda: "goal", get_goal_status=lambda: status)


def test_a_cancel_does_not_wait_until_a_goal_is_checked_and_ends_that_goal_too(
    goal: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(controller_action_server, "SteadyActionServer", FakeServer)
    checking, checked, events = threading.Event(), threading.Event(), []

    def submit(sent: Any, goal_handle: Any) -> None:
        checking.set()
        assert checked.wait(30.0)
        events.append("submitted")

    FakeServer.made = []
    callbacks = GoalCallbacks(submit=submit, cancel=lambda _: events.append("cancel"), make_result=lambda _: None)
    ControllerActionServer("s", object, callbacks, None)  # type: ignore[arg-type]
    (server,) = FakeServer.made
    lock = server.lock

    def receive(callback: Callable[[Any], None]) -> None:
        with lock:
            callback(goal)

    receiver = threading.Thread(target=receive, args=(server.on_goal,))
    receiver.start()
    assert checking.wait(30.0)
    assert lock.acquire(timeout=30.0), "a cancel waits for the check of the goal"
    goal.get_goal_status().status = GoalStatusMsg.RECALLING
    server.on_cancel(goal)
    lock.release()
    checked.set()
    receiver.join(30.0)
    assert events == ["cancel", "submitted", "cancel"]
