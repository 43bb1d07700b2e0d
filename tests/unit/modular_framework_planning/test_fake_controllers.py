# SPDX-License-Identifier: BSD-3-Clause
"""Motions of a robot with fake controllers."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rospy
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from modular_framework_planning.errors import ErrorCode, PlanningError
from modular_framework_planning.messages.execution_messages import MotionPart
from modular_framework_planning.move_group.controllers.fake_controllers import (
    FakeControllers,
    FakeMotion,
    initial_positions,
)
from modular_framework_planning.trajectory_execution.controllers import FAKE_KINDS, ControllerSpec

SPEC = SimpleNamespace(group_states={"arm": {"ready": {"a": 1.0, "b": 2.0, "gone": 3.0, "drive/x": 4.0}}, "hand": {}})
BASE = SimpleNamespace(variables=("drive/x", "drive/y", "drive/theta"))
MODEL = SimpleNamespace(index={"a": 0, "b": 1, "drive/x": 2}, semantics=SPEC, base=BASE)


class Echo:
    """Publisher and scene monitor in one: what is published is where the robot is, if somebody passes it on."""

    model = MODEL

    def __init__(self, passes_on: bool = True) -> None:
        self.states: list[JointState] = []
        self._passes_on = passes_on

    def publish(self, message: JointState) -> None:
        self.states.append(message)

    def positions(self) -> Any:
        known = self._passes_on and self.states
        return np.array(
            [
                dict(zip(self.states[-1].name, self.states[-1].position, strict=True)).get(name, 0.0) if known else 0.0
                for name in MODEL.index
            ]
        )


@pytest.fixture(autouse=True)
def clock() -> Iterator[None]:
    rospy.rostime.set_rostime_initialized(True)
    yield
    rospy.rostime.set_rostime_initialized(False)


def begin(kind: str, echo: Echo, times: tuple[float, ...] = (0.0, 0.1, 0.2)) -> FakeMotion:
    points = [
        JointTrajectoryPoint(positions=[10 * at, -at], time_from_start=rospy.Duration.from_sec(at)) for at in times
    ]
    part = MotionPart(
        ControllerSpec("fake", "", kind, ("a", "b")), JointTrajectory(joint_names=["a", "b"], points=points)
    )
    return FakeMotion(part, echo, echo, rate=50.0)  # type: ignore[arg-type]


def wait(condition: Callable[[], bool], timeout_s: float = 20.0) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.005)


@pytest.mark.parametrize(
    ("kind", "fewest", "most"), [("last point", 1, 1), ("via points", 3, 4), ("interpolate", 5, 42)]
)
def test_every_kind_ends_at_the_last_point_in_its_time(kind: str, fewest: int, most: int) -> None:
    echo, begun = Echo(), time.monotonic()
    motion = begin(kind, echo, (0.0, 0.4, 0.8))
    wait(motion.is_done)
    assert echo.states[-1].position == [8.0, -0.8]
    assert fewest <= len(echo.states) <= most
    assert time.monotonic() - begun >= 0.8 or kind == "last point"


def test_interpolation_passes_through_straight_lines() -> None:
    echo = Echo()
    wait(begin("interpolate", echo).is_done)
    rows = np.array([state.position for state in echo.states])
    assert np.allclose(rows[:, 0], -10 * rows[:, 1])
    assert (np.diff(rows[:, 0]) >= 0.0).all()


@pytest.mark.parametrize("kind", FAKE_KINDS[:2])
def test_a_stopped_motion_stays_on_its_way(kind: str) -> None:
    echo = Echo()
    motion = begin(kind, echo, (0.0, 0.1, 30.0))
    wait(lambda: len(echo.states) >= 2)
    motion.cancel()
    count = len(echo.states)
    with pytest.raises(PlanningError) as failure:
        motion.is_done()
    assert failure.value.code is ErrorCode.PREEMPTED
    time.sleep(0.1)
    assert len(echo.states) == count and echo.states[-1].position[0] < 100.0


def test_a_motion_nobody_shows_on_joint_states_is_no_success(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modular_framework_planning.move_group.controllers.fake_controllers.SEEN_TIMEOUT_S", 0.1)
    motion = begin("last point", Echo(passes_on=False))
    with pytest.raises(
        PlanningError, match="does not show the positions of fake controller 'fake' for a, b .*source_list"
    ):
        wait(motion.is_done)


def test_the_robot_starts_in_named_poses_of_its_groups() -> None:
    positions, faults = initial_positions(
        MODEL,
        [  # type: ignore[arg-type]
            {"group": "arm", "pose": "ready"},
            {"group": "hand", "pose": "open"},
            "text",
        ],
    )
    assert positions == {"a": 1.0, "b": 2.0}, "the base that moves is no part of joint_states"
    assert len(faults) == 2 and "group 'hand' has no pose 'open' in the SRDF; known poses: none" in faults[0]


class LateEcho(Echo):
    """Shows the initial positions only after they were asked for a few times, as joint_state_publisher does."""

    late = 5

    def positions(self) -> Any:
        self.late -= 1
        self._passes_on = self.late <= 0
        return super().positions()


def connect(echo: Echo, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Connects fake controllers with initial positions; returns their warnings."""
    warnings: list[str] = []
    monkeypatch.setattr(rospy, "get_param", lambda name, default: default if "rate" in name else [READY])
    monkeypatch.setattr(rospy, "Publisher", lambda *_, **__: echo)
    monkeypatch.setattr(rospy, "logwarn", lambda text, *values: warnings.append(text % values))
    monkeypatch.setattr(rospy, "is_shutdown", lambda: False)
    FakeControllers((), echo).connect()  # type: ignore[arg-type]
    return warnings


READY = {"group": "arm", "pose": "ready"}


def test_the_controllers_are_connected_when_the_robot_stands_at_the_initial_positions(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    echo = LateEcho()
    assert connect(echo, monkeypatch) == []
    assert list(echo.positions()[:2]) == [1.0, 2.0]


def test_initial_positions_that_nobody_shows_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("modular_framework_planning.move_group.controllers.fake_controllers.SEEN_TIMEOUT_S", 0.1)
    (warning,) = connect(Echo(passes_on=False), monkeypatch)
    assert "joint_states does not show the initial positions for a, b" in warning and "source_list" in warning
