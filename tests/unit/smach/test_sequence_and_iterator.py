# SPDX-License-Identifier: BSD-3-Clause
"""Sequences run in the order of addition; iterators run one state for each item."""

from __future__ import annotations

from typing import Any

import pytest
from machine_fixtures import Give, InThread, Stay

import smach


def test_a_sequence_runs_its_states_in_order_and_ends_with_the_connector() -> None:
    order: list[str] = []

    def noting(label: str) -> smach.CBState:
        def note(userdata: Any) -> str:
            order.append(label)
            return "success"

        return smach.CBState(note, outcomes=["success", "fail"])

    tested = smach.Sequence(outcomes=["success", "fail"], connector_outcome="success")
    with tested:
        for label in "ABC":
            smach.Sequence.add(label, noting(label))
    assert tested.execute() == "success"
    assert order == ["A", "B", "C"]


def test_another_outcome_leaves_the_sequence() -> None:
    tested = smach.Sequence(outcomes=["success", "fail"], connector_outcome="success")
    after = Give()
    with tested:
        smach.Sequence.add("A", Give("fail"))
        smach.Sequence.add("B", after)
    assert tested.execute() == "fail"
    assert after.executions == 0


def test_a_transition_from_the_connector_breaks_the_sequence_there() -> None:
    tested = smach.Sequence(outcomes=["success", "fail"], connector_outcome="success")
    skipped = Give()
    with tested:
        smach.Sequence.add("A", Give("success"), transitions={"success": "C"})
        smach.Sequence.add("B", skipped)
        smach.Sequence.add("C", Give("success"))
    assert tested.execute() == "success"
    assert skipped.executions == 0


def test_a_state_without_the_connector_outcome_is_refused() -> None:
    with pytest.raises(smach.InvalidTransitionError, match="connector"), smach.Sequence(["a"], "a"):
        smach.Sequence.add("A", Give())


def iterator(state: smach.State, items: Any, outcomes: list[str] | None = None, **contained: Any) -> smach.Iterator:
    result = smach.Iterator(
        outcomes=outcomes or ["finished", "fail"],
        input_keys=[],
        output_keys=["seen"],
        it=items,
        it_label="item",
        exhausted_outcome="finished",
    )
    with result:
        smach.Iterator.set_contained_state("S", state, **contained)
    return result


def collecting() -> smach.CBState:
    def collect(userdata: Any) -> str:
        userdata.seen = [*(userdata.seen if "seen" in userdata else []), userdata.item]
        return "success"

    return smach.CBState(collect, outcomes=["success"], input_keys=["item"], io_keys=["seen"])


@pytest.mark.parametrize("items", [[1, 2, 3], lambda: range(1, 4)])
def test_an_iterator_runs_its_state_for_each_item(items: Any) -> None:
    parent = smach.UserData()
    assert iterator(collecting(), items).execute(parent) == "finished"
    assert parent.seen == [1, 2, 3]


def test_no_items_is_exhausted_at_once() -> None:
    state = Give("success")
    assert iterator(state, [], loop_outcomes=["success"], final_outcome_map={}).execute() == "finished"
    assert state.executions == 0


def test_a_break_outcome_ends_the_iteration() -> None:
    state = Give("success", "fail")
    assert iterator(state, range(9), break_outcomes=["fail"]).execute() == "fail"
    assert state.executions == 2


def test_the_outcome_that_ended_it_is_translated() -> None:
    tested = iterator(
        Give("fail"), range(9), ["finished", "broken"], break_outcomes=["fail"], final_outcome_map={"fail": "broken"}
    )
    assert tested.execute() == "broken"


def test_with_loop_outcomes_every_other_outcome_breaks() -> None:
    assert iterator(Give("success", "fail"), range(9), loop_outcomes=["success"]).execute() == "fail"


def test_set_iteritems_replaces_items_and_key() -> None:
    tested = iterator(collecting(), [1])
    tested.set_iteritems([8, 9], "item")
    parent = smach.UserData()
    tested.execute(parent)
    assert parent.seen == [8, 9]


def test_the_exhausted_outcome_is_added_to_the_outcomes() -> None:
    assert smach.Iterator(["a"], exhausted_outcome="b").get_registered_outcomes() == ("a", "b")


@pytest.mark.parametrize(
    ("contained", "message"),
    [
        ({"loop_outcomes": ["success"], "break_outcomes": ["success"]}, "at once"),
        ({"break_outcomes": ["fial"]}, "not outcomes of 'S'"),
        ({"break_outcomes": ["fail"], "final_outcome_map": {"fail": "gone"}}, "end the iteration"),
    ],
)
def test_an_inconsistent_iterator_is_refused(contained: dict[str, Any], message: str) -> None:
    with pytest.raises(smach.InvalidTransitionError, match=message):
        iterator(Give(), [1], **contained)


def test_an_iterator_without_state_is_refused() -> None:
    with pytest.raises(smach.InvalidStateError, match="no contained state"):
        smach.Iterator(["a"]).execute()


def test_a_request_to_stop_reaches_the_state_and_ends_the_iteration() -> None:
    stay = Stay()
    tested = iterator(stay, range(9), ["finished", "preempted"], loop_outcomes=["success"])
    running = InThread(tested)
    assert stay.started.wait(5.0)
    assert tested.get_active_states() == ["S"]
    tested.request_preempt()
    assert running.end() == "preempted"
    assert not tested.preempt_requested()


def test_edges_show_the_loop_and_the_exits() -> None:
    edges = iterator(Give(), [1], break_outcomes=["fail"]).get_internal_edges()
    assert edges == [("success", "S", "S"), ("success", "S", "finished"), ("fail", "S", "fail")]
