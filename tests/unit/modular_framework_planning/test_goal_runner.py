# SPDX-License-Identifier: BSD-3-Clause
"""Goals of an action run one after the other, and one that was given up meanwhile never begins."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest
from moveit_msgs.msg import ExecuteTrajectoryAction

from modular_framework_planning.move_group import goal_runner
from modular_framework_planning.move_group.goal_runner import GoalRunner


class Handle:
    """A goal as the action server hands it over; remembers how it ended."""

    def __init__(self, name: str, server_lock: Any = None) -> None:
        self.name = name
        self._server_lock = server_lock or threading.RLock()
        self.outcome = ""
        self.accepted = False
        self.ended = threading.Event()

    def get_goal_id(self) -> Any:
        with self._server_lock:  # as actionlib's handles do
            return SimpleNamespace(id=self.name)

    def get_goal(self) -> str:
        return self.name

    def publish_feedback(self, _: Any) -> None:
        return

    def set_accepted(self) -> None:
        self.accepted = True

    def _end(self, outcome: str) -> None:
        self.outcome = outcome
        self.ended.set()

    def set_succeeded(self, _: Any, __: str = "") -> None:
        self._end("succeeded")

    def set_canceled(self, _: Any, __: str = "") -> None:
        self._end("canceled")

    def set_aborted(self, _: Any, __: str = "") -> None:
        self._end("aborted")

    set_rejected = set_aborted


class Server:
    """Stands for actionlib: hands over the goals that the test sends."""

    made: Server

    def __init__(self, _name: str, _kind: Any, on_goal: Callable[[Any], None], *_: Any, **__: Any) -> None:
        self.on_goal = on_goal
        Server.made = self


@pytest.fixture(autouse=True)
def server(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(goal_runner, "SteadyActionServer", Server)


def run(work: Callable[..., Any], *names: str, all_sent: threading.Event | None = None) -> list[Handle]:
    """Sends goals one right after the other, reports that they are sent, and waits for their ends."""
    GoalRunner("some_action", ExecuteTrajectoryAction, work)
    handles = [Handle(name) for name in names]
    for handle in handles:
        Server.made.on_goal(handle)
    if all_sent is not None:
        all_sent.set()
    for handle in handles:
        assert handle.ended.wait(20.0), f"goal '{handle.name}' did not end within 20 s"
    return handles


def test_a_new_goal_ends_the_one_before_and_one_given_up_while_waiting_never_begins() -> None:
    begun = []

    def work(goal: str, cancelled: threading.Event, _: Any) -> tuple[None, bool, str]:
        begun.append(goal)
        if goal == "first":
            assert cancelled.wait(20.0)
            assert all_sent.wait(20.0)  # the first takes a while to stop; second and third wait for their turn
            return None, False, "stopped"
        return None, True, "done"

    all_sent = threading.Event()
    first, second, third = run(work, "first", "second", "third", all_sent=all_sent)
    assert (first.outcome, second.outcome, third.outcome) == ("canceled", "canceled", "succeeded")
    assert begun == ["first", "third"] and not second.accepted


def test_a_goal_that_comes_while_the_one_before_is_cleared_away_does_not_lock_the_server() -> None:
    server_lock = threading.RLock()  # actionlib holds it while it hands a goal over
    clearing = threading.Event()

    class SlowToName(Handle):
        """Returns its name so late, once it has ended, that the next goal arrives meanwhile."""

        def get_goal_id(self) -> Any:
            if self.ended.is_set():
                clearing.set()
                time.sleep(0.2)
            return super().get_goal_id()

    GoalRunner("some_action", ExecuteTrajectoryAction, lambda *_: (None, True, "done"))
    first, second = SlowToName("first", server_lock), Handle("second", server_lock)
    Server.made.on_goal(first)
    assert clearing.wait(20.0)

    def hand_over() -> None:
        with server_lock:
            Server.made.on_goal(second)

    thread = threading.Thread(target=hand_over, daemon=True)
    thread.start()
    thread.join(20.0)
    assert not thread.is_alive() and second.ended.wait(20.0)


def test_goals_that_use_different_things_run_at_the_same_time() -> None:
    both_run, release = threading.Barrier(2), threading.Event()

    def work(_goal: Any, _cancelled: threading.Event, _feedback: Any) -> tuple[Any, bool, str]:
        both_run.wait(5.0)
        release.wait(5.0)
        return None, True, ""

    GoalRunner("some_action", ExecuteTrajectoryAction, work, lambda goal: frozenset(goal.split("+")))
    left, right, both = Handle("left"), Handle("right"), Handle("left+right")
    Server.made.on_goal(left)
    Server.made.on_goal(right)
    release.set()
    assert left.ended.wait(5.0) and right.ended.wait(5.0)
    assert (left.outcome, right.outcome) == ("succeeded", "succeeded")
    both_run = threading.Barrier(1)
    Server.made.on_goal(both)
    assert both.ended.wait(5.0) and both.outcome == "succeeded"
