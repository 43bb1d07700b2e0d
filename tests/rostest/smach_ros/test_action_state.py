# SPDX-License-Identifier: BSD-3-Clause
"""SimpleActionState against a real action server."""

from __future__ import annotations

import subprocess
import sys
import threading
import time

import actionlib
import pytest
import rospy
from actionlib.msg import TestAction, TestGoal, TestResult
from actionlib_msgs.msg import GoalStatusArray

import smach

ACTION = "count"


class Server:
    """Counts up to the goal, 50 ms a step; goal -1 fails; goal -2 does not listen to cancels."""

    def __init__(self) -> None:
        self.started = threading.Event()
        self.cancelled_at: float | None = None
        self.goals: list[int] = []
        self.release = threading.Event()
        self._server = actionlib.SimpleActionServer(ACTION, TestAction, self._run, auto_start=False)
        self._server.register_preempt_callback(self._on_cancel)
        self._server.start()

    def _on_cancel(self) -> None:
        self.cancelled_at = time.monotonic()

    def _run(self, goal: TestGoal) -> None:
        self.goals.append(goal.goal)
        self.started.set()
        if goal.goal == -1:
            self._server.set_aborted(TestResult(-1), "the counter is broken")
            return
        if goal.goal == -2:
            self.release.wait(60.0)
            self._server.set_preempted()
            return
        for _ in range(goal.goal):
            if self._server.is_preempt_requested():
                self._server.set_preempted(TestResult(0), "stopped counting")
                return
            time.sleep(0.05)
        self._server.set_succeeded(TestResult(goal.goal))


@pytest.fixture(scope="module")
def server(ros_session):
    return Server()


@pytest.fixture(autouse=True)
def fresh(server):
    server.started.clear()
    server.cancelled_at = None
    server.goals.clear()


def state_of(**arguments):
    from smach_ros import SimpleActionState

    return SimpleActionState(ACTION, TestAction, **arguments)


def run(state, **userdata):
    data = smach.UserData()
    for key, value in userdata.items():
        data[key] = value
    view = smach.Remapper(data, state.get_registered_input_keys(), state.get_registered_output_keys(), {})
    return state.execute(view), data


def test_the_goal_may_be_fixed_and_the_result_goes_to_the_userdata():
    outcome, data = run(state_of(goal=TestGoal(1), result_key="answer", result_slots=["result"]))
    assert outcome == "succeeded"
    assert data.answer == TestResult(1)
    assert data.result == 1


def test_the_goal_may_come_from_a_key_from_slots_and_from_a_function(server):
    assert run(state_of(goal_key="target"), target=TestGoal(2))[0] == "succeeded"
    assert run(state_of(goal_slots=["goal"]), goal=3)[0] == "succeeded"

    def make(userdata, goal, factor, plus):
        goal.goal = userdata.number * factor + plus

    state = state_of(goal_cb=make, goal_cb_args=[2], goal_cb_kwargs={"plus": 0}, input_keys=["number"])
    assert run(state, number=2)[0] == "succeeded"
    assert run(state_of(goal_cb=lambda userdata, goal: TestGoal(1)))[0] == "succeeded"
    assert server.goals == [2, 3, 4, 1]


def test_a_function_with_an_interface_brings_its_keys_and_outcomes():
    @smach.cb_interface(output_keys=["seen"], outcomes=["odd"])
    def read(userdata, status, result):
        userdata.seen = result.result
        return "odd" if result.result % 2 else None

    state = state_of(goal=TestGoal(1), result_cb=read)
    assert set(state.get_registered_outcomes()) == {"succeeded", "aborted", "preempted", "odd"}
    outcome, data = run(state)
    assert outcome == "odd"
    assert data.seen == 1
    assert run(state_of(goal=TestGoal(2), result_cb=read))[0] == "succeeded"


def test_result_cb_gets_its_extra_arguments():
    got = []
    state = state_of(
        goal=TestGoal(0),
        result_cb=lambda *values, **named: got.append((values[3:], named)),
        result_cb_args=[7],
        result_cb_kwargs={"eight": 8},
    )
    assert run(state)[0] == "succeeded"
    assert got == [((7,), {"eight": 8})]


def test_a_goal_that_fails_aborts_with_the_reason_of_the_server():
    state = state_of(goal=TestGoal(-1))
    assert run(state)[0] == "aborted"
    assert "ABORTED" in state.reason
    assert "the counter is broken" in state.reason


def test_a_goal_is_not_changed_by_the_execution_before(server):
    state = state_of(goal=TestGoal(1), goal_cb=lambda userdata, goal: setattr(goal, "goal", goal.goal + 1))
    run(state)
    run(state)
    assert server.goals == [2, 2]


@pytest.mark.parametrize("attempt", range(8))
def test_preemption_stops_the_goal_at_once(server, attempt):
    state = state_of(goal=TestGoal(200))
    machine = smach.StateMachine(outcomes=["done", "preempted"])
    with machine:
        smach.StateMachine.add(
            "COUNT", state, transitions={"succeeded": "done", "aborted": "done", "preempted": "preempted"}
        )
    outcomes: list[str] = []
    thread = threading.Thread(target=lambda: outcomes.append(machine.execute()))
    thread.start()
    assert server.started.wait(60.0)
    time.sleep(0.01 * attempt)  # before, while and after the server confirms the goal
    asked = time.monotonic()
    machine.request_preempt()
    thread.join(9.0)  # counting to the end takes ten seconds
    assert outcomes == ["preempted"], state.reason
    assert server.cancelled_at is not None
    assert server.cancelled_at - asked < 2.0
    assert not machine.preempt_requested()


def test_preemption_before_the_goal_sends_none(server):
    state = state_of(goal=TestGoal(1))
    state.request_preempt()
    assert run(state)[0] == "preempted"
    assert server.goals == []
    assert run(state)[0] == "succeeded"


def test_too_long_an_execution_is_cancelled_and_aborted(server):
    state = state_of(goal=TestGoal(200), exec_timeout=rospy.Duration(0.3))
    assert run(state)[0] == "aborted"
    assert "was not done within 0.3 s" in state.reason
    assert server.cancelled_at is not None


def test_a_server_that_does_not_stop_is_given_up(server):
    server.release.clear()
    state = state_of(goal=TestGoal(-2), exec_timeout=rospy.Duration(0.1), preempt_timeout=rospy.Duration(0.3))
    start = time.monotonic()
    assert run(state)[0] == "aborted"
    assert time.monotonic() - start < 20.0
    assert "did not end within 0.3 s" in state.reason
    server.release.set()


def test_a_missing_server_aborts_with_its_name_and_the_time():
    from smach_ros import SimpleActionState

    state = SimpleActionState("nobody", TestAction, server_wait_timeout=rospy.Duration(0.3))
    assert run(state)[0] == "aborted"
    assert "actionlib/TestAction" in state.reason
    assert "'/nobody' within 0.3 s" in state.reason


MORTAL = """
import rospy, actionlib
from actionlib.msg import TestAction
rospy.init_node("mortal", disable_signals=True)
server = actionlib.SimpleActionServer("mortal", TestAction, lambda goal: rospy.sleep(60.0), auto_start=False)
server.start()
rospy.spin()
"""


def test_a_server_that_dies_with_its_goal_is_noticed(ros_session, monkeypatch):
    from smach_ros import SimpleActionState, simple_action_state

    monkeypatch.setattr(simple_action_state, "SERVER_LOST_S", 0.5)
    process = subprocess.Popen([sys.executable, "-c", MORTAL], env=ros_session.env)
    try:
        sent = threading.Event()
        rospy.Subscriber("mortal/status", GoalStatusArray, lambda message: message.status_list and sent.set())
        state = SimpleActionState("mortal", TestAction, server_wait_timeout=rospy.Duration(60.0))
        outcomes: list[str] = []
        thread = threading.Thread(target=lambda: outcomes.append(run(state)[0]))
        thread.start()
        assert sent.wait(60.0)
        time.sleep(0.3)
        process.kill()
        thread.join(30.0)
        assert outcomes == ["aborted"]
        assert "the server went away" in state.reason
    finally:
        process.kill()
        process.wait(5.0)


def test_waiting_for_a_server_can_be_stopped():
    from smach_ros import SimpleActionState

    state = SimpleActionState("nobody", TestAction)
    threading.Timer(0.2, state.request_preempt).start()
    start = time.monotonic()
    assert run(state)[0] == "preempted"
    assert time.monotonic() - start < 10.0


def test_userdata_that_does_not_fit_aborts_with_the_reason():
    state = state_of(goal_key="target")
    assert run(state)[0] == "aborted"
    assert "'target', which has no value" in state.reason
    assert run(state, target=5)[0] == "aborted"
    assert "gave a int as goal; it must be a actionlib/TestGoal" in state.reason
    state = state_of(goal_cb=lambda userdata, goal: 1 / 0)
    assert run(state)[0] == "aborted"
    assert "goal_cb raised ZeroDivisionError" in state.reason
    state = state_of(goal=TestGoal(0), result_cb=lambda userdata, status, result: "elsewhere")
    assert run(state)[0] == "aborted"
    assert "result_cb returned 'elsewhere'" in state.reason


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"goal": 5}, "goal is a int"),
        ({"goal": lambda: None}, "goal is a function"),
        ({"goal_cb": "name"}, "goal_cb is a str"),
        ({"result_cb": 1}, "result_cb is a int"),
        ({"goal_slots": ["speed"]}, r"goal_slots: \['speed'\] are no fields of actionlib/TestGoal.*\['goal'\]"),
        ({"goal_slots": "goal"}, "must be a list"),
        ({"result_slots": ["x"]}, "result_slots"),
        ({"exec_timeout": "soon"}, "exec_timeout must be a rospy.Duration"),
    ],
)
def test_wrong_arguments_are_refused(arguments, words):
    with pytest.raises(smach.InvalidStateError, match=words):
        state_of(**arguments)


def test_a_wrong_action_type_is_refused():
    from smach_ros import SimpleActionState

    with pytest.raises(smach.InvalidStateError, match="must be the class of an action"):
        SimpleActionState(ACTION, TestGoal)
