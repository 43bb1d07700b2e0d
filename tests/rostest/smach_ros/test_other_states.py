# SPDX-License-Identifier: BSD-3-Clause
"""ServiceState, MonitorState, ConditionState and ActionServerWrapper on the wire."""

from __future__ import annotations

import threading
import time

import pytest
import rospy
from actionlib.msg import TestAction, TestGoal, TestRequestAction, TestRequestGoal
from actionlib_msgs.msg import GoalStatus
from std_msgs.msg import Int32
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse

import smach
from modular_framework_ros.action_client import SteadyActionClient
from modular_framework_testing.ros_session import until

pytestmark = pytest.mark.usefixtures("ros_session")


def run(state, **userdata):
    data = smach.UserData()
    for key, value in userdata.items():
        data[key] = value
    view = smach.Remapper(data, state.get_registered_input_keys(), state.get_registered_output_keys(), {})
    return state.execute(view), data


@pytest.fixture(scope="module")
def service(ros_session):
    release = threading.Event()

    def answer(request):
        return SetBoolResponse(request.data, "yes" if request.data else "no")

    def slow(request):
        release.wait(60.0)
        return SetBoolResponse(True, "late")

    def broken(request):
        raise ValueError("the switch is loose")

    servers = [
        rospy.Service(name, SetBool, call)
        for name, call in (("switch", answer), ("slow_switch", slow), ("broken_switch", broken))
    ]
    yield "switch"
    release.set()
    for server in servers:
        server.shutdown()


# ---- ServiceState ------------------------------------------------------------------------------------------
def test_the_request_may_come_from_everywhere_and_the_response_goes_to_the_userdata(service):
    from smach_ros import ServiceState

    state = ServiceState(service, SetBool, SetBoolRequest(True), response_key="all", response_slots=["message"])
    outcome, data = run(state)
    assert (outcome, data.all.success, data.message) == ("succeeded", True, "yes")
    state = ServiceState(service, SetBool, request_slots=["data"], response_slots=["message"])
    assert run(state, data=True)[1].message == "yes"
    state = ServiceState(service, SetBool, request_key="ask", response_slots=["message"])
    assert run(state, ask=SetBoolRequest(False))[1].message == "no"
    state = ServiceState(
        service,
        SetBool,
        request_cb=lambda userdata, request, value: SetBoolRequest(value),
        request_cb_args=[True],
        response_cb=lambda userdata, response: response.message,
        outcomes=["yes"],
    )
    assert run(state)[0] == "yes"


def test_a_missing_service_aborts_with_its_name_and_the_time():
    from smach_ros import ServiceState

    state = ServiceState("nobody", SetBool, server_wait_timeout=rospy.Duration(0.3))
    assert run(state)[0] == "aborted"
    assert "service 'nobody'" in state.reason
    assert "not advertised within 0.3 s" in state.reason


def test_a_failing_a_slow_and_a_wrongly_asked_service_abort_with_the_reason(service):
    from smach_ros import ServiceState

    state = ServiceState("broken_switch", SetBool)
    assert run(state)[0] == "aborted"
    assert "the switch is loose" in state.reason
    state = ServiceState("slow_switch", SetBool, exec_timeout=rospy.Duration(0.2))
    assert run(state)[0] == "aborted"
    assert "did not answer within 0.2 s" in state.reason
    state = ServiceState(service, SetBool, request_slots=["data"])
    assert run(state)[0] == "aborted"
    assert "'data', which has no value" in state.reason
    state = ServiceState(service, SetBool, request_slots=["data"])
    assert run(state, data="of course")[0] == "aborted"
    assert "data is not a bool" in state.reason


@pytest.mark.parametrize("name", ["nobody", "slow_switch"])
def test_waiting_for_a_service_and_for_its_answer_can_be_stopped(service, name):
    from smach_ros import ServiceState

    state = ServiceState(name, SetBool)
    threading.Timer(0.2, state.request_preempt).start()
    start = time.monotonic()
    assert run(state)[0] == "preempted"
    assert time.monotonic() - start < 10.0


def test_wrong_arguments_of_service_states_are_refused():
    from smach_ros import ServiceState

    for arguments, words in (
        ({"request": 5}, "request is a int"),
        ({"request_cb": 5}, "request_cb is a int"),
        ({"response_cb": 5}, "response_cb is a int"),
        ({"request_slots": ["x"]}, "no fields"),
        ({"response_slots": ["x"]}, "no fields"),
        ({"server_wait_timeout": rospy.Duration(-1.0)}, "at least 0 s"),
    ):
        with pytest.raises(smach.InvalidStateError, match=words):
            ServiceState("switch", SetBool, **arguments)
    with pytest.raises(smach.InvalidStateError, match="must be the class of a service"):
        ServiceState("switch", SetBoolRequest)


# ---- MonitorState ------------------------------------------------------------------------------------------
class Talker:
    """Publishes 1, 2, 3, ... every 20 ms."""

    def __init__(self, topic: str) -> None:
        self._publisher = rospy.Publisher(topic, Int32, queue_size=10)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._talk, daemon=True)

    def _talk(self) -> None:
        number = 0
        while not self._stop.wait(0.02):
            if self._publisher.get_num_connections():
                number += 1
                self._publisher.publish(number)

    def __enter__(self) -> Talker:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._publisher.unregister()


def test_a_monitor_ends_when_the_condition_fails_or_has_held_often_enough():
    from smach_ros import MonitorState

    with Talker("numbers"):
        assert run(MonitorState("numbers", Int32, lambda userdata, message: message.data < 5))[0] == "invalid"
    seen = []
    with Talker("numbers"):
        state = MonitorState("numbers", Int32, lambda userdata, message: not seen.append(message.data), max_checks=3)
        assert run(state)[0] == "valid"
    assert len(seen) == 3


def test_a_monitor_writes_userdata_and_survives_a_broken_condition():
    from smach_ros import MonitorState

    def keep(userdata, message):
        userdata.last = message.data
        return message.data < 3

    with Talker("numbers"):
        outcome, data = run(MonitorState("numbers", Int32, keep, output_keys=["last"]))
    assert (outcome, data.last) == ("invalid", 3)
    with Talker("numbers"):
        state = MonitorState("numbers", Int32, lambda userdata, message: message.colour)
        assert run(state)[0] == "invalid"
    assert "raised AttributeError" in state.reason


def test_a_monitor_can_be_stopped_and_limited():
    from smach_ros import MonitorState

    state = MonitorState("silence", Int32, lambda userdata, message: True)
    threading.Timer(0.1, state.request_preempt).start()
    assert run(state)[0] == "preempted"
    state = MonitorState("silence", Int32, lambda userdata, message: True, timeout=rospy.Duration(0.2))
    assert run(state)[0] == "invalid"
    assert "within 0.2 s" in state.reason
    with pytest.raises(smach.InvalidStateError, match="class of a message"):
        MonitorState("silence", "Int32", print)
    with pytest.raises(smach.InvalidStateError, match="cond_cb"):
        MonitorState("silence", Int32, "x")


# ---- ConditionState ----------------------------------------------------------------------------------------
def test_a_condition_is_asked_as_often_as_was_said():
    from smach_ros import ConditionState

    asked = []
    state = ConditionState(lambda userdata: asked.append(1), max_checks=3, poll_rate=rospy.Duration(0.01))
    assert run(state)[0] == "false"
    assert len(asked) == 3
    answers = iter([False, True])
    state = ConditionState(lambda userdata: next(answers), max_checks=-1, poll_rate=rospy.Duration(0.01))
    assert run(state)[0] == "true"
    state = ConditionState(lambda userdata: userdata.number > 1, input_keys=["number"])
    assert run(state, number=2)[0] == "true"


def test_a_condition_can_be_stopped_limited_and_broken():
    from smach_ros import ConditionState

    state = ConditionState(lambda userdata: False, max_checks=-1, poll_rate=rospy.Duration(30.0))
    threading.Timer(0.1, state.request_preempt).start()
    assert run(state)[0] == "preempted"
    state = ConditionState(
        lambda userdata: False, max_checks=-1, poll_rate=rospy.Duration(0.02), timeout=rospy.Duration(0.1)
    )
    assert run(state)[0] == "false"
    with pytest.raises(smach.InvalidUserCodeError, match="ZeroDivisionError"):
        run(ConditionState(lambda userdata: 1 / 0))
    with pytest.raises(smach.InvalidStateError, match="max_checks"):
        ConditionState(lambda userdata: True, max_checks=0)
    with pytest.raises(smach.InvalidStateError, match="cond_cb"):
        ConditionState(5)


# ---- ActionServerWrapper -----------------------------------------------------------------------------------
class Double(smach.State):
    """Goal 0 waits for a request to stop; a negative one raises."""

    def __init__(self) -> None:
        super().__init__(["done", "odd", "stopped"], ["action_goal", "number"], ["answer"])
        self.running = threading.Event()

    def execute(self, userdata):
        number = userdata.number
        if number < 0:
            raise ValueError("negative numbers cannot be doubled here")
        self.running.set()
        end = time.monotonic() + 60.0
        while number == 0 and time.monotonic() < end:
            if self.preempt_requested():
                self.service_preempt()
                return "stopped"
            time.sleep(0.01)
        userdata.answer = 2 * number
        return "odd" if number % 2 else "done"


def test_a_machine_is_offered_as_an_action():
    from smach_ros import ActionServerWrapper

    machine = smach.StateMachine(["done", "odd", "stopped"], ["action_goal", "number"], ["answer"])
    double = Double()
    with machine:
        smach.StateMachine.add("DOUBLE", double)
    wrapper = ActionServerWrapper(
        "double",
        TestAction,
        machine,
        ["done"],
        ["odd"],
        ["stopped"],
        goal_slots_map={"goal": "number"},
        result_slots_map={"result": "answer"},
    )
    wrapper.run_server()
    client = SteadyActionClient("double", TestAction)
    assert client.wait_for_server(rospy.Duration(60.0))

    def end_of(number):
        assert client.send_goal_and_wait(TestGoal(number), rospy.Duration(30.0)) is not None
        return client.get_state(), client.get_result().result, client.get_goal_status_text()

    assert end_of(2)[:2] == (GoalStatus.SUCCEEDED, 4)
    assert end_of(3)[:2] == (GoalStatus.ABORTED, 6)
    state, _, text = end_of(-1)
    assert state == GoalStatus.ABORTED
    assert "negative numbers" in text
    double.running.clear()
    client.send_goal(TestGoal(0))
    assert double.running.wait(30.0)
    # actionlib's client takes a goal for lost if it cancels before it has seen it accepted
    until(lambda: client.get_state() == GoalStatus.ACTIVE, "the goal is active")
    client.cancel_goal()
    assert client.wait_for_result(rospy.Duration(30.0))
    assert client.get_state() == GoalStatus.PREEMPTED
    assert end_of(4)[:2] == (GoalStatus.SUCCEEDED, 8)


def test_transitions_send_the_mapped_feedback_and_slots_are_expanded_and_packed():
    from smach_ros import ActionServerWrapper

    feedback, sent, heard = [], threading.Event(), threading.Event()

    @smach.cb_interface(outcomes=["next"], input_keys=["goal"], output_keys=["progress", "result"])
    def work(userdata):
        assert sent.wait(60.0)  # a client that is still sending does not listen to feedback yet
        userdata.progress = userdata.goal + 1
        userdata.result = userdata.goal + 2
        return "next"

    @smach.cb_interface(outcomes=["next"], input_keys=["goal"], output_keys=["progress", "result"])
    def finish(userdata):
        assert heard.wait(60.0)  # a client that has the result does not listen to feedback any more
        return work(userdata)

    machine = smach.StateMachine(["done"], ["goal"], ["result"])
    with machine:
        smach.StateMachine.add("FIRST", smach.CBState(work), {"next": "SECOND"})
        smach.StateMachine.add("SECOND", smach.CBState(finish), {"next": "done"})
    wrapper = ActionServerWrapper(
        "staged",
        TestAction,
        machine,
        ["done"],
        feedback_slots_map={"feedback": "progress"},
        expand_goal_slots=True,
        pack_result_slots=True,
    )
    wrapper.run_server()
    client = SteadyActionClient("staged", TestAction)
    assert client.wait_for_server(rospy.Duration(60.0))
    client.send_goal(TestGoal(5), feedback_cb=lambda message: feedback.append(message.feedback) or heard.set())
    sent.set()
    assert client.wait_for_result(rospy.Duration(60.0))
    assert client.get_result().result == 7
    assert feedback == [6]


def test_wrong_arguments_of_the_wrapper_are_refused():
    from smach_ros import ActionServerWrapper

    machine = smach.StateMachine(["done", "odd"])
    with machine:
        smach.StateMachine.add("A", smach.CBState(lambda userdata: "done", outcomes=["done"]))
    for arguments, words in (
        ({"succeeded_outcomes": ["done"], "aborted_outcomes": ["done"]}, r"\['done'\] are in more than one"),
        ({"goal_slots_map": {"speed": "x"}}, "goal_slots_map.*no fields"),
        ({"result_slots_map": {"speed": "x"}}, "result_slots_map.*no fields"),
        ({"feedback_slots_map": {"speed": "x"}}, "feedback_slots_map.*no fields"),
    ):
        with pytest.raises(smach.InvalidConstructionError, match=words):
            ActionServerWrapper("w", TestAction, machine, **arguments)
    with pytest.raises(smach.InvalidConstructionError, match="class of an action"):
        ActionServerWrapper("w", TestGoal, machine)
    with pytest.raises(smach.InvalidConstructionError, match="needs a container"):
        ActionServerWrapper("w", TestRequestAction, TestRequestGoal())
