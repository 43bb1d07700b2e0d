# SPDX-License-Identifier: BSD-3-Clause
"""State machines: construction, consistency, transitions, userdata, callbacks, stopping."""

from __future__ import annotations

from typing import Any

import pytest
from machine_fixtures import Give, InThread, Raise, Stay

import smach


def machine(*states: tuple[str, smach.State, dict[str, str]], outcomes: tuple[str, ...] = ("done", "lost")) -> Any:
    result = smach.StateMachine(outcomes=outcomes)
    with result:
        for label, state, transitions in states:
            smach.StateMachine.add(label, state, transitions)
    return result


# ---- construction ------------------------------------------------------------------------------------------------
def test_the_first_state_added_runs_first_and_transitions_are_followed() -> None:
    a, b = Give("fail", "success"), Give("success")
    tested = machine(("A", a, {"success": "done", "fail": "B"}), ("B", b, {"success": "A", "fail": "lost"}))
    assert tested.execute() == "done"
    assert (a.executions, b.executions) == (2, 1)


def test_an_outcome_without_transition_leads_to_the_outcome_of_the_same_name() -> None:
    tested = machine(("A", Give("success"), {"fail": "lost"}), outcomes=("success", "lost"))
    assert tested.execute() == "success"


def test_the_initial_state_can_be_chosen_with_userdata() -> None:
    class Read(smach.State):
        def __init__(self) -> None:
            super().__init__(outcomes=["done"], input_keys=["value"])

        def execute(self, userdata: Any) -> str:
            seen.append(userdata.value)
            return "done"

    seen: list[int] = []
    a = Give("success")
    tested = machine(("A", a, {"success": "B", "fail": "lost"}), ("B", Read(), {}))
    values = smach.UserData()
    values.value = 4
    tested.set_initial_state(["B"], values)
    assert tested.get_initial_states() == ["B"]
    assert tested.execute() == "done"
    assert (seen, a.executions) == ([4], 0)


def test_exactly_one_initial_state_is_taken() -> None:
    with pytest.raises(smach.InvalidStateError, match="one state"):
        machine(("A", Give(outcomes=("done",)), {})).set_initial_state(["A", "B"])


def test_a_label_is_taken_once() -> None:
    with pytest.raises(smach.InvalidStateError, match="already has a state with the label 'A'"):
        machine(("A", Give(outcomes=("done",)), {}), ("A", Give(outcomes=("done",)), {}))


def test_a_label_cannot_be_an_outcome() -> None:
    with pytest.raises(smach.InvalidStateError, match="'done' is an outcome"):
        machine(("done", Give(outcomes=("lost",)), {}))


def test_only_states_are_taken() -> None:
    with pytest.raises(smach.InvalidStateError, match="class given"):
        machine(("A", Give, {}))  # type: ignore[arg-type]


def test_a_transition_must_start_from_an_outcome_of_the_state() -> None:
    with pytest.raises(smach.InvalidTransitionError, match=r"\['sucess'\].*\['success', 'fail'\]"):
        machine(("A", Give(), {"sucess": "done"}))


def test_every_transition_to_nowhere_is_named_when_the_machine_is_closed() -> None:
    with pytest.raises(smach.InvalidTransitionError) as caught:
        machine(("A", Give(), {"success": "X", "fail": "Y"}))
    assert "'X'" in str(caught.value) and "'Y'" in str(caught.value)


def test_a_failed_construction_leaves_nothing_open() -> None:
    with pytest.raises(smach.InvalidTransitionError):
        machine(("A", Give(), {"success": "X"}))
    with pytest.raises(smach.InvalidConstructionError, match="no container is open"):
        smach.StateMachine.add("A", Give())


def test_an_error_in_the_block_is_not_hidden_by_the_consistency_check() -> None:
    with pytest.raises(ZeroDivisionError), smach.StateMachine(["done"]):
        _ = 1 / 0
    with pytest.raises(smach.InvalidConstructionError):
        smach.StateMachine.add("A", Give())


def test_an_empty_machine_cannot_run() -> None:
    with pytest.raises(smach.InvalidStateError, match="no states"):
        smach.StateMachine(["done"]).execute()


def test_add_of_another_container_kind_is_refused() -> None:
    with pytest.raises(smach.InvalidConstructionError, match="StateMachine is open"), smach.StateMachine(["done"]):
        smach.Concurrence.add("A", Give())


def test_open_containers_close_in_reverse_order() -> None:
    outer, inner = machine(("A", Give(outcomes=("done",)), {})), machine(("A", Give(outcomes=("done",)), {}))
    outer.open()
    inner.open()
    assert outer.is_opened()
    with pytest.raises(smach.InvalidStateError):
        outer.close()
    inner.close()
    outer.close()
    with pytest.raises(smach.InvalidConstructionError, match="not open"):
        outer.assert_opened()


def test_add_auto_leads_to_the_state_added_next() -> None:
    tested = smach.StateMachine(["done", "fail"])
    with tested:
        smach.StateMachine.add_auto("A", Give("success"), ["success"])
        smach.StateMachine.add_auto("B", Give("success"), ["success"])
        smach.StateMachine.add("C", Give("success"), {"success": "done"})
    assert ("success", "A", "B") in tested.get_internal_edges()
    assert tested.execute() == "done"


def test_add_auto_refuses_a_connector_the_state_does_not_have() -> None:
    with pytest.raises(smach.InvalidTransitionError, match="connector outcome 'ok'"), smach.StateMachine(["done"]):
        smach.StateMachine.add_auto("A", Give(), ["ok"])


# ---- running -----------------------------------------------------------------------------------------------------
def test_an_exception_in_a_state_is_an_error_of_the_user_code() -> None:
    with pytest.raises(smach.InvalidUserCodeError, match="state 'A' of type Raise raised ValueError: a spring broke"):
        machine(("A", Raise(), {"success": "done"})).execute()


def test_a_machine_can_run_again_after_an_exception() -> None:
    tested = machine(("A", Raise(), {"success": "done"}))
    for _ in range(2):
        with pytest.raises(smach.InvalidUserCodeError):
            tested.execute()
        assert not tested.is_running()
        assert tested.get_active_states() == []


@pytest.mark.parametrize("returned", ["succes", None, 3])
def test_a_returned_value_that_is_no_outcome_is_an_error(returned: Any) -> None:
    with pytest.raises(smach.InvalidTransitionError, match=r"returned .*\['success', 'fail'\]"):
        machine(("A", Give(returned), {"success": "done", "fail": "lost"})).execute()


def test_nested_machines_copy_their_keys_in_and_out() -> None:
    @smach.cb_interface(outcomes=["done"], input_keys=["n"], output_keys=["n"])
    def increment(userdata: Any) -> str:
        userdata.n = userdata.n + 1
        return "done"

    inner = smach.StateMachine(["done"], input_keys=["n"], output_keys=["n"])
    with inner:
        smach.StateMachine.add("I", smach.CBState(increment))
    outer = smach.StateMachine(["done"])
    outer.userdata.count = 1
    with outer:
        smach.StateMachine.add("N", inner, remapping={"n": "count"})
    assert outer.execute() == "done"
    assert outer.userdata.count == 2


def test_machines_that_share_a_userdata_object_see_each_others_changes() -> None:
    @smach.cb_interface(outcomes=["done"], output_keys=["n"])
    def write(userdata: Any) -> str:
        userdata.n = 7
        return "done"

    outer, inner = smach.StateMachine(["done"]), smach.StateMachine(["done"])
    inner.userdata = outer.userdata
    with inner:
        smach.StateMachine.add("W", smach.CBState(write))
    with outer:
        smach.StateMachine.add("N", inner)
    outer.execute()
    assert outer.userdata.n == 7


def test_parent_userdata_goes_through_input_and_output_keys() -> None:
    tested = smach.StateMachine(["done"], input_keys=["i"], output_keys=["o"])

    @smach.cb_interface(outcomes=["done"], input_keys=["i"], output_keys=["o"])
    def double(userdata: Any) -> str:
        userdata.o = 2 * userdata.i
        return "done"

    with tested:
        smach.StateMachine.add("D", smach.CBState(double))
    parent = smach.UserData()
    parent.i = 4
    tested.execute(parent)
    assert parent.o == 8


# ---- callbacks ---------------------------------------------------------------------------------------------------
def test_callbacks_get_userdata_labels_outcome_and_their_own_arguments() -> None:
    heard: list[tuple[Any, ...]] = []
    tested = machine(("A", Give("success"), {"success": "B", "fail": "lost"}), ("B", Give(outcomes=("done",)), {}))
    tested.register_start_cb(lambda ud, labels, mark: heard.append(("start", labels, mark)), ["s"])
    tested.register_transition_cb(lambda ud, labels: heard.append(("transition", labels)))
    tested.register_termination_cb(lambda ud, labels, outcome: heard.append(("end", labels, outcome)))
    tested.execute()
    assert heard == [("start", ["A"], "s"), ("transition", ["B"]), ("end", ["B"], "done")]


def test_a_callback_that_raises_does_not_disturb_the_machine() -> None:
    tested = machine(("A", Give(outcomes=("done",)), {}))
    tested.register_start_cb(lambda ud, labels: 1 / 0)
    assert tested.execute() == "done"


def test_active_states_and_running_are_seen_from_outside() -> None:
    stay = Stay()
    tested = machine(("A", stay, {"success": "done", "preempted": "lost"}))
    running = InThread(tested)
    assert stay.started.wait(5.0)
    assert (tested.is_running(), tested.get_active_states()) == (True, ["A"])
    tested.request_preempt()
    assert running.end() == "lost"
    assert (tested.is_running(), tested.get_active_states()) == (False, [])


# ---- stopping ----------------------------------------------------------------------------------------------------
def test_a_request_to_stop_reaches_the_running_state_of_the_innermost_machine() -> None:
    stay = Stay()
    inner = machine(("I", stay, {"success": "done", "preempted": "lost"}))
    outer = machine(("O", inner, {}))
    running = InThread(outer)
    assert stay.started.wait(5.0)
    outer.request_preempt()
    assert running.end() == "lost"
    assert not outer.preempt_requested() and not inner.preempt_requested() and not stay.preempt_requested()


def test_a_machine_asked_to_stop_before_it_runs_passes_it_to_its_first_state() -> None:
    tested = machine(("A", Stay(), {"success": "done", "preempted": "lost"}))
    tested.request_preempt()
    assert InThread(tested).end() == "lost"


def test_a_state_that_does_not_service_the_request_leaves_it_for_the_next_state() -> None:
    first, second = Stay(services=False), Stay()
    tested = machine(
        ("A", first, {"success": "done", "preempted": "B"}), ("B", second, {"success": "done", "preempted": "lost"})
    )
    running = InThread(tested)
    assert first.started.wait(5.0)
    tested.request_preempt()
    assert running.end() == "lost"
    assert second.started.is_set()
    assert not first.preempt_requested() and not tested.preempt_requested()


def test_once_serviced_the_request_is_over_and_transitions_go_on() -> None:
    stay, after = Stay(), Give("success")
    tested = machine(
        ("A", stay, {"success": "done", "preempted": "B"}), ("B", after, {"success": "done", "fail": "lost"})
    )
    running = InThread(tested)
    assert stay.started.wait(5.0)
    tested.request_preempt()
    assert running.end() == "done"
    assert after.executions == 1


def test_a_shutdown_ends_a_machine_that_would_loop_for_ever() -> None:
    class Count(Give):
        def execute(self, userdata: Any) -> str:
            if self.executions == 5:
                smach.set_shutdown_check(lambda: True)
            return super().execute(userdata)

    state = Count("success")
    inner = machine(("I", state, {"success": "I", "fail": "lost"}))
    outer = machine(("O", inner, {"done": "O", "lost": "O"}))
    assert InThread(outer).end() == "preempted"
    assert state.executions == 6
