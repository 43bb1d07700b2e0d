# SPDX-License-Identifier: BSD-3-Clause
"""Time that is held passes for goals and requests only, and no hold outlives its owner."""

from __future__ import annotations

import pytest

from modular_framework_simulation.loop.time_holds import MAX_IDLE_S, HoldError, TimeHolds


class RealTime:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


@pytest.fixture
def real_time() -> RealTime:
    return RealTime()


@pytest.fixture
def log() -> list[str]:
    return []


@pytest.fixture
def holds(real_time: RealTime, log: list[str]) -> TimeHolds:
    return TimeHolds(log.append, real_time)


def test_time_passes_while_nobody_holds_it(holds: TimeHolds) -> None:
    assert holds.may_pass(0, moving=False)


def test_held_time_passes_for_a_goal_until_the_step_in_which_it_ends(holds: TimeHolds) -> None:
    holds.hold("task", 10.0)
    assert [holds.may_pass(step, moving=step in (5, 6)) for step in (4, 5, 6, 7)] == [False, True, True, False]


def test_a_hold_during_motions_stops_goals_and_requests(holds: TimeHolds) -> None:
    holds.hold("planning", 10.0, during_motions=True)
    holds.advance(10)
    assert not holds.may_pass(0, moving=True)
    holds.release("planning")
    assert holds.may_pass(0, moving=True)


def test_a_request_lets_exactly_its_steps_pass(holds: TimeHolds) -> None:
    holds.hold("task", 10.0)
    asked, step = holds.advance(3), 0
    while holds.may_pass(step, moving=False):
        assert not asked.passed.is_set()
        step += 1
    assert (step, asked.passed.is_set()) == (3, True)


def test_time_passes_until_the_last_of_two_requests(holds: TimeHolds) -> None:
    holds.hold("task", 10.0)
    short, long, step = holds.advance(2), holds.advance(5), 0
    while holds.may_pass(step, moving=False):
        step += 1
    assert step == 5
    assert short.passed.is_set() and long.passed.is_set()


def test_a_request_that_was_given_up_lets_nothing_pass(holds: TimeHolds) -> None:
    holds.hold("task", 10.0)
    holds.give_up(holds.advance(3))
    assert not holds.may_pass(0, moving=False)


def test_the_hold_of_a_dead_owner_ends_with_its_lease_and_is_named_in_the_log(
    holds: TimeHolds, real_time: RealTime, log: list[str]
) -> None:
    holds.hold("dead node", 10.0)
    real_time.now_s += 9.9
    assert not holds.may_pass(0, moving=False)
    real_time.now_s += 0.2
    assert holds.may_pass(0, moving=False)
    assert len(log) == 1 and "'dead node'" in log[0] and "10 s" in log[0]
    assert holds.owners == ()


def test_a_renewed_hold_goes_on(holds: TimeHolds, real_time: RealTime, log: list[str]) -> None:
    holds.hold("task", 10.0)
    for _ in range(3):
        real_time.now_s += 8.0
        holds.hold("task", 10.0)
        assert not holds.may_pass(0, moving=False)
    assert log == []


def test_each_owner_has_to_release_its_own_hold(holds: TimeHolds) -> None:
    holds.hold("task", 10.0)
    holds.hold("episode", 10.0)
    assert holds.release("task") and not holds.release("task")
    assert not holds.may_pass(0, moving=False)
    holds.release("episode")
    assert holds.may_pass(0, moving=False)


def test_a_renewed_hold_that_only_waits_lets_time_pass_in_the_end_and_says_so_once(
    holds: TimeHolds, real_time: RealTime, log: list[str]
) -> None:
    passed_at_s = None
    for second in range(int(MAX_IDLE_S) + 20):
        holds.hold("task", 10.0)
        if holds.may_pass(0, moving=False) and passed_at_s is None:
            passed_at_s = second
        real_time.now_s += 1.0
    assert passed_at_s == MAX_IDLE_S
    assert len(log) == 1 and "task" in log[0] and "not repeatable" in log[0]


def test_silence_counts_from_the_last_request(holds: TimeHolds, real_time: RealTime) -> None:
    holds.hold("task", 600.0)
    real_time.now_s += MAX_IDLE_S - 1.0
    holds.give_up(holds.advance(1))
    real_time.now_s += MAX_IDLE_S - 1.0
    assert not holds.may_pass(0, moving=False)


def test_planning_for_longer_than_the_silence_goes_on_in_held_time(holds: TimeHolds, real_time: RealTime) -> None:
    holds.hold("task", 600.0)
    holds.hold("planning", 600.0, during_motions=True)
    for _ in range(30):
        real_time.now_s += 10.0
        assert not holds.may_pass(0, moving=False)


def test_a_world_that_begins_again_ends_the_requests(holds: TimeHolds) -> None:
    holds.hold("task", 10.0)
    asked = holds.advance(1000)
    holds.restart()
    assert asked.passed.is_set()
    assert not holds.may_pass(0, moving=False)


@pytest.mark.parametrize(("owner", "lease_s"), [("", 1.0), ("task", 0.0), ("task", 601.0), ("task", float("nan"))])
def test_a_hold_without_owner_or_bound_is_refused(holds: TimeHolds, owner: str, lease_s: float) -> None:
    with pytest.raises(HoldError):
        holds.hold(owner, lease_s)
    assert holds.may_pass(0, moving=False)
