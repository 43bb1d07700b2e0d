# SPDX-License-Identifier: BSD-3-Clause
"""States and functions made into states: their interface and the request to stop."""

from __future__ import annotations

import pytest

import smach


def test_outcomes_and_keys_keep_their_order_and_are_unique() -> None:
    state = smach.State(outcomes=["b", "a", "b"], input_keys=["i"], output_keys=["o"], io_keys=["both"])
    assert state.get_registered_outcomes() == ("b", "a")
    assert state.get_registered_input_keys() == ("i", "both")
    assert state.get_registered_output_keys() == ("o", "both")


def test_interfaces_can_be_registered_later() -> None:
    state = smach.State()
    state.register_outcomes(["a"])
    state.register_input_keys(["i"])
    state.register_output_keys(["o"])
    state.register_io_keys(["both"])
    assert state.get_registered_outcomes() == ("a",)
    assert state.get_registered_input_keys() == ("i", "both")
    assert state.get_registered_output_keys() == ("o", "both")


def test_two_states_share_no_defaults() -> None:
    smach.State().register_outcomes(["a"])
    assert smach.State().get_registered_outcomes() == ()


def test_a_state_without_execute_is_an_error_of_the_user_code() -> None:
    with pytest.raises(smach.InvalidUserCodeError, match="State does not define execute"):
        smach.State().execute(smach.UserData())


def test_a_request_to_stop_is_serviced_or_recalled() -> None:
    state = smach.State()
    assert not state.preempt_requested()
    for settle in (state.service_preempt, state.recall_preempt):
        state.request_preempt()
        assert state.preempt_requested()
        settle()
        assert not state.preempt_requested()


def test_a_function_state_passes_userdata_and_arguments() -> None:
    def work(userdata: smach.UserData, first: int, second: int = 0) -> str:
        return f"{userdata.base + first + second}"

    state = smach.CBState(work, cb_args=[10], cb_kwargs={"second": 5}, outcomes=["16"], input_keys=["base"])
    userdata = smach.UserData()
    userdata.base = 1
    assert state.execute(userdata) == "16"


def test_a_decorated_function_brings_its_interface() -> None:
    @smach.cb_interface(outcomes=["done"], input_keys=["i"], output_keys=["o"], io_keys=["both"])
    def work(userdata: object) -> str:
        return "done"

    state = smach.CBState(work)
    assert smach.has_smach_interface(work)
    assert state.get_registered_outcomes() == ("done",)
    assert state.get_registered_input_keys() == ("i", "both")
    assert state.get_registered_output_keys() == ("o", "both")
    assert state.execute(None) == "done"


def test_a_plain_function_has_no_interface() -> None:
    assert not smach.has_smach_interface(lambda userdata: "done")


def test_loggers_can_be_replaced() -> None:
    before = (smach.loginfo, smach.logwarn, smach.logdebug, smach.logerr)
    heard: list[str] = []
    try:
        smach.set_loggers(*[lambda text, kind=kind: heard.append(f"{kind} {text}") for kind in "iwde"])
        smach.loginfo("a")
        smach.logwarn("b")
        smach.logdebug("c")
        smach.logerr("d")
    finally:
        smach.set_loggers(*before)
    assert heard == ["i a", "w b", "d c", "e d"]
