# SPDX-License-Identifier: BSD-3-Clause
"""Concurrences: everything runs at once, the outcome follows the children's, stopping reaches all of them."""

from __future__ import annotations

import threading
from typing import Any

import pytest
from machine_fixtures import Give, InThread, Raise, Stay

import smach

BOTH = {"good": {"A": "success", "B": "success"}}


def concurrence(states: dict[str, smach.State], **arguments: Any) -> smach.Concurrence:
    arguments.setdefault("outcomes", ["good", "bad", "preempted"])
    arguments.setdefault("default_outcome", "bad")
    result = smach.Concurrence(**arguments)
    with result:
        for label, state in states.items():
            smach.Concurrence.add(label, state)
    return result


def test_all_children_run_at_the_same_time() -> None:
    meeting = threading.Barrier(3)

    @smach.cb_interface(outcomes=["success"])
    def meet(userdata: Any) -> str:
        meeting.wait(5.0)
        return "success"

    tested = concurrence({name: smach.CBState(meet) for name in "ABC"}, outcome_map={"good": {"C": "success"}})
    assert tested.execute() == "good"


@pytest.mark.parametrize(("given", "expected"), [("success", "good"), ("fail", "bad")])
def test_the_outcome_map_decides_and_the_default_is_for_the_rest(given: str, expected: str) -> None:
    assert concurrence({"A": Give("success"), "B": Give(given)}, outcome_map=BOTH).execute() == expected


def test_the_first_matching_entry_of_the_map_wins() -> None:
    chosen = concurrence(
        {"A": Give("success"), "B": Give("fail")}, outcome_map={"bad": {"B": "fail"}, "good": {"A": "success"}}
    )
    assert chosen.execute() == "bad"


def test_the_outcome_callback_comes_before_the_map() -> None:
    seen: list[dict[str, str | None]] = []

    def decide(outcomes: dict[str, str | None]) -> str:
        seen.append(outcomes)
        return "preempted"

    tested = concurrence({"A": Give("success"), "B": Give("success")}, outcome_map=BOTH, outcome_cb=decide)
    assert tested.execute() == "preempted"
    assert seen == [{"A": "success", "B": "success"}]


def test_an_outcome_callback_without_opinion_leaves_it_to_the_map() -> None:
    tested = concurrence({"A": Give(), "B": Give()}, outcome_map=BOTH, outcome_cb=lambda outcomes: None)
    assert tested.execute() == "good"


def test_a_wrong_answer_of_the_outcome_callback_is_an_error() -> None:
    with pytest.raises(smach.InvalidStateError, match="'best'"):
        concurrence({"A": Give()}, outcome_cb=lambda outcomes: "best").execute()


@pytest.mark.parametrize("answer", [True, ["B"]])
def test_the_child_termination_callback_stops_the_others(answer: bool | list[str]) -> None:
    stay = Stay()
    calls: list[dict[str, str | None]] = []

    def on_end(outcomes: dict[str, str | None]) -> bool | list[str]:
        calls.append(outcomes)
        return answer

    tested = concurrence(
        {"A": Give("success"), "B": stay},
        child_termination_cb=on_end,
        outcome_map={"good": {"A": "success", "B": "preempted"}},
    )
    assert InThread(tested).end() == "good"
    assert calls[0] == {"A": "success", "B": None}


def test_a_child_termination_callback_that_says_no_lets_the_others_run() -> None:
    stay = Stay()
    tested = concurrence({"A": Give("success"), "B": stay}, child_termination_cb=lambda outcomes: False)
    running = InThread(tested)
    assert stay.started.wait(5.0)
    assert tested.is_running()
    tested.request_preempt()
    assert running.end() == "bad"


def test_an_error_in_the_child_termination_callback_stops_all_and_is_raised() -> None:
    tested = concurrence({"A": Give("success"), "B": Stay()}, child_termination_cb=lambda outcomes: 1 / 0)
    with pytest.raises(smach.InvalidUserCodeError, match="ZeroDivisionError"):
        InThread(tested).end()


def test_a_request_to_stop_reaches_every_running_child() -> None:
    stays = {name: Stay() for name in "ABC"}
    tested = concurrence(dict(stays), outcome_map={"preempted": dict.fromkeys("ABC", "preempted")})
    running = InThread(tested)
    for stay in stays.values():
        assert stay.started.wait(5.0)
    tested.request_preempt()
    assert running.end() == "preempted"
    assert not tested.preempt_requested()


def test_a_request_that_a_child_ignores_stays_with_the_concurrence() -> None:
    tested = concurrence({"A": Stay(services=False), "B": Stay()})
    running = InThread(tested)
    for child in tested.get_children().values():
        assert isinstance(child, Stay) and child.started.wait(5.0)
    tested.request_preempt()
    running.end()
    assert tested.preempt_requested()
    assert not tested["A"].preempt_requested()


def test_a_request_before_the_start_stops_the_children_at_once() -> None:
    tested = concurrence({"A": Stay(), "B": Stay()}, outcome_map={"preempted": {"A": "preempted"}})
    tested.request_preempt()
    assert InThread(tested).end() == "preempted"


def test_a_request_to_a_machine_stops_the_concurrence_in_it() -> None:
    stay = Stay()
    inner = concurrence({"A": stay}, outcome_map={"preempted": {"A": "preempted"}})
    outer = smach.StateMachine(["good", "bad", "preempted"])
    with outer:
        smach.StateMachine.add("C", inner)
    running = InThread(outer)
    assert stay.started.wait(5.0)
    outer.request_preempt()
    assert running.end() == "preempted"


def test_a_child_that_raises_stops_the_others_and_its_error_is_raised() -> None:
    stay = Stay()
    with pytest.raises(smach.InvalidUserCodeError, match="state 'A' of type Raise raised ValueError"):
        InThread(concurrence({"A": Raise(), "B": stay})).end()
    assert not stay.preempt_requested()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_child_that_leaves_its_thread_does_not_hang_the_concurrence() -> None:
    @smach.cb_interface(outcomes=["success"])
    def leave(userdata: Any) -> str:
        raise SystemExit

    with pytest.raises(smach.InvalidUserCodeError, match="'A'"):
        InThread(concurrence({"A": smach.CBState(leave)})).end()


def test_a_returned_value_that_is_no_outcome_is_an_error() -> None:
    with pytest.raises(smach.InvalidTransitionError, match="returned 'great'"):
        concurrence({"A": Give("great")}).execute()


def test_a_concurrence_can_run_again_and_again() -> None:
    tested = concurrence({"A": Give("success", "fail"), "B": Give("success")}, outcome_map=BOTH)
    assert [tested.execute(), tested.execute()] == ["good", "bad"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"default_outcome": "bda"}, "default outcome 'bda'"),
        ({"outcome_map": {"god": {"A": "success"}}}, "gives 'god'"),
        ({"outcome_map": {"good": {"X": "success"}}}, "names the state 'X'"),
        ({"outcome_map": {"good": {"A": "sucess"}}}, "names 'sucess' of 'A'"),
    ],
)
def test_an_inconsistent_concurrence_is_refused_when_it_is_closed(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(smach.InvalidStateError, match=message):
        concurrence({"A": Give()}, **arguments)


def test_an_empty_concurrence_is_refused() -> None:
    with pytest.raises(smach.InvalidStateError, match="no states"):
        concurrence({})


def test_a_label_is_taken_once_and_only_states_are_taken() -> None:
    with pytest.raises(smach.InvalidStateError, match="already"), smach.Concurrence(["a"], "a"):
        smach.Concurrence.add("A", Give())
        smach.Concurrence.add("A", Give())
    with pytest.raises(smach.InvalidStateError, match="not a smach.State"):
        concurrence({"A": Give})  # type: ignore[dict-item]


def test_children_share_the_userdata_through_their_own_names() -> None:
    def writer(key: str) -> smach.CBState:
        def write(userdata: Any) -> str:
            userdata.mine = key
            return "success"

        return smach.CBState(write, outcomes=["success"], output_keys=["mine"])

    tested = smach.Concurrence(["good"], "good", output_keys=["a", "b"])
    with tested:
        for label in "ab":
            smach.Concurrence.add(label, writer(label), remapping={"mine": label})
    parent = smach.UserData()
    tested.execute(parent)
    assert (parent.a, parent.b) == ("a", "b")


def test_callbacks_and_edges_describe_the_children() -> None:
    heard: list[Any] = []
    tested = concurrence({"A": Give("success"), "B": Give("success")}, outcome_map=BOTH)
    tested.register_start_cb(lambda ud, labels: heard.append(labels))
    tested.register_termination_cb(lambda ud, labels, outcome: heard.append(outcome))
    tested.execute()
    assert heard == [["A", "B"], "good"]
    assert tested.get_internal_edges() == [("success", "A", "good"), ("success", "B", "good")]
    assert tested.get_initial_states() == ["A", "B"]
