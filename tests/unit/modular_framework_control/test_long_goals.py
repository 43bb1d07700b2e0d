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
from control_msgs.msg import FollowJointTrajectoryActionGoal
from genpy import Duration
from trajectory_msgs.msg import JointTrajectory as JointTrajectoryMsg
from trajectory_msgs.msg import JointTrajectoryPoint

from modular_framework_control.ros import controller_action_server
from modular_framework_control.ros.controller_action_server import ControllerActionServer
from modular_framework_control.ros.conversions import trajectory_from_msg
from modular_framework_control.ros.large_messages import PiecewiseBuffer
from modular_framework_control.trajectory.joint_trajectory import ITEMS_AT_ONCE, Spline, splice

POINTS = 3 * ITEMS_AT_ONCE + 7


def message(points: int = POINTS) -> JointTrajectoryMsg:
    made = JointTrajectoryMsg(joint_names=["a", "b"])
    for i in range(points):
        values = [0.001 * i, -0.001 * i]
        made.points.append(JointTrajectoryPoint(values, values, values, [], Duration.from_sec(0.01 * (i + 1))))
    return made


def test_a_trajectory_takes_the_points_of_its_message_in_their_order_and_releases_them() -> None:
    sent = message()
    trajectory = trajectory_from_msg(sent)
    assert not sent.points and len(trajectory.points) == POINTS
    spline = Spline(trajectory)
    assert spline.times_s == pytest.approx(0.01 * np.arange(1, POINTS + 1))
    assert spline.states[:, 0, 0] == pytest.approx(0.001 * np.arange(POINTS))
    trajectory.release()
    assert not trajectory.points


def test_a_track_copies_nothing_of_a_trajectory_in_the_control_loop() -> None:
    spline = Spline(trajectory_from_msg(message()))
    track = splice(spline, [0, 1], 10.0, 10.0, np.full((3, 2), 7.0), [True, True])
    assert np.shares_memory(track.others, spline.coefficients)
    part = track.without([1])
    assert part is not None and np.shares_memory(part.others, spline.coefficients)
    assert part.sample(12.003) == pytest.approx(track.sample(12.003)[:, :1])
    assert track.sample(12.0)[0, 0] == pytest.approx(0.199 + 2.0 * np.pi), "continuous joints keep their rotation"


def test_large_messages_are_received_in_pieces_and_are_the_same() -> None:
    sent = FollowJointTrajectoryActionGoal()
    sent.goal_id.id = "long"
    sent.goal.trajectory = message(5000)
    raw = io.BytesIO()
    sent.serialize(raw)
    buffer, received = PiecewiseBuffer(), []
    for _ in range(2):
        buffer.write(struct.pack("<I", len(raw.getvalue())) + raw.getvalue())
    rospy.msg.deserialize_messages(buffer, received, FollowJointTrajectoryActionGoal)
    assert received == [sent, sent] and buffer.tell() == 0


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
    ControllerActionServer("s", object, submit, lambda handle: events.append("cancel"), None, None)  # type: ignore[arg-type]
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
