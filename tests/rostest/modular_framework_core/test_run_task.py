# SPDX-License-Identifier: BSD-3-Clause
"""run_task on a real master: makes the state machine of a task, runs it, reports how it ended, and stops on request."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from xmlrpc.client import ServerProxy

import pytest
import rosgraph
import rospy
from moveit_msgs.msg import PlannerInterfaceDescription
from moveit_msgs.srv import (
    QueryPlannerInterfaces,
    QueryPlannerInterfacesRequest,
    QueryPlannerInterfacesResponse,
)
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger
from visualization_msgs.msg import Marker

from modular_framework_core.srv import ListMessages, ListMessagesRequest
from modular_framework_ros.calls import CallError, call_service
from modular_framework_testing.ros_session import RosSession, executable, until

FROZEN_WITHIN_S = 10.0
"""From the stop of a node's process to the end of what waits for it [s]."""

STOPPED_WITHIN_S = 1.0
"""From the signal to the last line [s]."""

STATES = {
    "give.py": """
from modular_framework_core.state_api.framework_state import FrameworkState


class Give(FrameworkState):
    def __init__(self, answer=True, why="it was told to", outcomes=("success", "fail"), input_keys=(),
                 output_keys=(), io_keys=()):
        super().__init__(outcomes, input_keys, output_keys, io_keys)
        self._answer, self._why = answer, why

    def execute(self, userdata):
        return self.succeed() if self._answer else self.fail(self._why)
""",
    "choose.py": """
from typing import Annotated

from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_uses import Named


class Choose(FrameworkState):
    def __init__(self, planner: Annotated[str, Named("planner")], outcomes=("success", "fail"), input_keys=(),
                 output_keys=(), io_keys=()):
        super().__init__(outcomes, input_keys, output_keys, io_keys)

    def execute(self, userdata):
        return self.succeed()
""",
    "stay.py": """
from modular_framework_core.state_api.framework_state import FrameworkState


class Stay(FrameworkState):
    def __init__(self, outcomes=("success", "fail"), input_keys=(), output_keys=(), io_keys=()):
        super().__init__(outcomes, input_keys, output_keys, io_keys)

    def execute(self, userdata):
        self.feedback = "staying"
        self.wait_until(lambda: False, None)
        return self.stopped()
""",
    "nap.py": """
import rospy

from modular_framework_core.state_api.framework_state import FrameworkState


class Nap(FrameworkState):
    def execute(self, userdata):
        woken = self.wait_until(lambda: rospy.has_param("/alarm"), 60.0, 0.1)
        return self.succeed() if woken else self.fail("overslept")
""",
    "deaf.py": """
import threading

import smach


class Deaf(smach.State):
    def __init__(self, outcomes=("success", "fail")):
        smach.State.__init__(self, outcomes=outcomes)

    def execute(self, userdata):
        threading.Event().wait(60.0)
        return "success"
""",
    "burst.py": """
import smach


class Burst(smach.State):
    def __init__(self, outcomes=("success", "fail")):
        smach.State.__init__(self, outcomes=outcomes)

    def execute(self, userdata):
        raise RuntimeError("a tyre burst")
""",
}


def task(states: str, name: str = "tiny") -> str:
    header = f"name: {name}\nsource: state_machine\nnode_name: tiny_node\noutcomes: [done, gave_up]\nstates:\n"
    return header + states


GOOD = task("  - A:\n      source: give\n      transitions: {success: done, fail: gave_up}\n")
BAD = task(
    "  - A:\n      source: give\n      answer: false\n      why: the door is locked\n"
    "      transitions: {success: done, fail: gave_up}\n"
)
LONG = task("  - A:\n      source: stay\n      transitions: {success: done, fail: A}\n").replace(", gave_up]", "]")


class TaskProcess:
    """run_task as a process of its own."""

    def __init__(self, session: RosSession, folder: Path, text: str | None, *extra: str, own: bool = True) -> None:
        script = folder / "tiny.yaml"
        if text is not None:
            script.write_text(text)
        command = [executable("modular_framework_core", "run_task"), *([str(script)] if text is not None else [])]
        command += [f"_states_directory:={folder / 'states'}"] if own else []
        command += extra
        self.process = subprocess.Popen(
            command, env=session.env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        self.lines: list[tuple[float, str]] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append((time.monotonic(), line))

    def end(self, timeout_s: float = 90.0) -> tuple[int, str]:
        """Answers the exit code and all output."""
        code = self.process.wait(timeout_s)
        self._reader.join(timeout_s)
        return code, "".join(line for _, line in self.lines)

    def ended_at(self) -> float:
        """Answers when the last line was printed: when the task had ended, and the process only had to leave."""
        return self.lines[-1][0]


@pytest.fixture()
def run(ros_session: RosSession, tmp_path: Path) -> Iterator[Callable[..., TaskProcess]]:
    states = tmp_path / "states"
    states.mkdir()
    for name in ("/run_task", "/alarm"):
        if rospy.has_param(name):
            rospy.delete_param(name)
    for file, text in STATES.items():
        (states / file).write_text(text)
    started: list[TaskProcess] = []

    def start(text: str | None, *extra: str, own: bool = True) -> TaskProcess:
        started.append(TaskProcess(ros_session, tmp_path, text, *extra, own=own))
        return started[-1]

    yield start
    for item in started:
        if item.process.poll() is None:
            item.process.kill()
            item.process.wait(10.0)


class Heard:
    """Collects the messages of a topic."""

    def __init__(self, topic: str) -> None:
        self.messages: list[str] = []
        self._subscriber = rospy.Subscriber(topic, String, lambda message: self.messages.append(message.data))

    def wait_for(self, condition: Callable[[list[str]], bool], timeout_s: float = 60.0) -> None:
        end = time.monotonic() + timeout_s
        while not condition(self.messages):
            assert time.monotonic() < end, f"not heard within {timeout_s} s; heard: {self.messages}"
            time.sleep(0.02)

    def close(self) -> None:
        self._subscriber.unregister()


@pytest.fixture()
def status() -> Iterator[Heard]:
    heard = Heard("task_status")
    yield heard
    heard.close()


def wait_for_start(status: Heard, state: str = "A") -> None:
    status.wait_for(lambda messages: any(state in json.loads(text)["active"] for text in messages))


def test_the_success_outcome_exits_with_0_and_says_so_in_the_last_line(run) -> None:
    code, output = run(GOOD).end()
    assert code == 0, output
    assert output.strip().splitlines()[-1] == "Task 'tiny' ended with outcome 'done': SUCCEEDED"
    assert "first state running: A after" in output


def test_a_planner_that_move_group_lacks_is_refused_before_the_first_state(run) -> None:
    def planners(_: QueryPlannerInterfacesRequest) -> QueryPlannerInterfacesResponse:
        names = ["RRTConnect", "arm[Quick]"]
        return QueryPlannerInterfacesResponse([PlannerInterfaceDescription(pipeline_id="ompl", planner_ids=names)])

    text = task("  - A: {{source: choose, planner: {}, transitions: {{success: done, fail: gave_up}}}}\n")
    service = rospy.Service("query_planner_interface", QueryPlannerInterfaces, planners)
    try:
        refused = {name: run(text.format(name)).end() for name in ("RRTConect", "ompl/Quik", "Quick")}
    finally:
        service.shutdown("the test ends")
    assert refused["RRTConect"][0] == refused["ompl/Quik"][0] == 2
    assert "the planner 'RRTConect' is unknown" in refused["RRTConect"][1]
    assert "did you mean 'RRTConnect'?" in refused["RRTConect"][1]
    assert "did you mean 'ompl/Quick'?" in refused["ompl/Quik"][1]
    assert refused["Quick"][0] == 0, refused["Quick"][1]


def test_another_outcome_exits_with_1_and_reports_the_reason_of_the_state(run) -> None:
    code, output = run(BAD).end()
    assert code == 1, output
    assert output.strip().splitlines()[-1] == "Task 'tiny' ended with outcome 'gave_up': FAILED"
    assert "A failed once: the door is locked" in output


def test_the_outcome_and_the_states_are_published(run, status: Heard) -> None:
    outcome = Heard("task_outcome")
    nap = "states:\n  - Nap: {source: nap, transitions: {success: A, fail: A}}\n"
    process = run(BAD.replace("states:\n", nap))
    status.wait_for(
        lambda messages: any(
            event["event"] == "running" and event["active"] == ["Nap"] and event["state_elapsed_s"] >= 0.3
            for event in map(json.loads, messages)
        )
    )
    rospy.set_param("/alarm", True)
    process.end()
    outcome.wait_for(lambda messages: messages == ["gave_up"])
    outcome.close()
    status.wait_for(lambda messages: json.loads(messages[-1])["event"] == "task_end")
    events = [event for event in map(json.loads, status.messages) if event["state"] != "Nap"]
    assert [(event["event"], event["state"]) for event in events] == [("start", "A"), ("end", "A"), ("task_end", "")]
    assert events[1]["outcome"] == "fail"
    assert events[1]["reason"] == "the door is locked"
    assert events[2]["succeeded"] is False


def test_rviz_shows_the_running_state_and_the_reason_of_a_failure_above_the_arm(run) -> None:
    rospy.set_param(
        "/robot_description",
        '<robot name="arm"><link name="floor"/><link name="post"/><link name="turret"/>'
        '<joint name="bolt" type="fixed"><parent link="floor"/><child link="post"/><origin xyz="0 0 0.7"/></joint>'
        '<joint name="pan" type="continuous"><parent link="post"/><child link="turret"/><origin xyz="0.1 0 0.2"/>'
        "</joint></robot>",
    )
    shown: list[Marker] = []
    subscriber = rospy.Subscriber("task_marker", Marker, shown.append)
    try:
        nap = "states:\n  - Nap: {source: nap, transitions: {success: A, fail: A}}\n"
        process = run(BAD.replace("states:\n", nap))
        until(lambda: [marker.text for marker in shown] == ["tiny\nNap"], "the first state")
        rospy.set_param("/alarm", True)
        process.end()
        until(lambda: len(shown) == 3, "the result")
    finally:
        subscriber.unregister()
        rospy.delete_param("/robot_description")
    assert [marker.text for marker in shown[1:]] == ["tiny\nA", "tiny\nFAILED: gave_up\nA: the door is locked"]
    assert {(marker.type, marker.header.frame_id) for marker in shown} == {(Marker.TEXT_VIEW_FACING, "post")}
    assert {(marker.pose.position.x, marker.pose.position.z > 0.9) for marker in shown} == {(0.1, True)}


@pytest.fixture()
def frozen(ros_session: RosSession) -> Iterator[Callable[[], int]]:
    """A node of a launch, and its process, which `frozen()` stops."""
    launch = ros_session.launch('<launch><node name="managers" pkg="modular_framework_core" type="managers"/></launch>')
    ros_session.wait_for_service("/list_grasps", 60.0)
    pid = int(ServerProxy(rosgraph.Master("/test").lookupNode("/managers")).getPid("/test")[2])

    def freeze() -> int:
        os.kill(pid, signal.SIGSTOP)
        return pid

    yield freeze
    os.kill(pid, signal.SIGCONT)
    launch.stop()


def test_a_frozen_node_ends_the_task_and_is_named(run, status: Heard, frozen) -> None:
    process = run(LONG)
    wait_for_start(status)
    begun_s, pid = time.monotonic(), frozen()
    code, output = process.end()
    assert code == 1, output
    assert f"node '/managers' is frozen: its process {pid} was stopped" in output
    assert process.ended_at() - begun_s < FROZEN_WITHIN_S


def test_a_call_of_a_frozen_node_fails_long_before_its_timeout(frozen) -> None:
    proxy = rospy.ServiceProxy("/list_grasps", ListMessages)
    assert call_service(proxy, ListMessagesRequest(), 60.0).anonymous == 0
    begun_s = time.monotonic()
    frozen()
    with pytest.raises(CallError, match="service '/list_grasps' does not answer: node '/managers' is frozen"):
        call_service(proxy, ListMessagesRequest(), 60.0)
    assert time.monotonic() - begun_s < FROZEN_WITHIN_S


def test_a_short_stop_of_a_node_ends_nothing(run, status: Heard, frozen) -> None:
    process = run(LONG)
    wait_for_start(status)
    for _ in range(5):
        os.kill(frozen(), signal.SIGCONT)
    seen = len(status.messages)
    status.wait_for(lambda messages: len(messages) > seen + 12)  # one every half second
    assert process.process.poll() is None


def test_the_generated_module_is_written_below_ros_home(run, ros_session: RosSession) -> None:
    run(GOOD).end()
    written = Path(ros_session.env["ROS_HOME"]) / "modular_framework" / "state_machines" / "tiny.py"
    assert "class Tiny(smach.StateMachine)" in written.read_text()


def test_the_generated_module_has_the_file_name_that_is_given(run, ros_session: RosSession) -> None:
    folder = Path(ros_session.env["ROS_HOME"]) / "modular_framework" / "state_machines"
    code, output = run(GOOD.replace("tiny", "renamed"), "_generated_state_machine_name:=of_mine.py").end()
    assert code == 0, output
    assert "class Renamed(smach.StateMachine)" in (folder / "of_mine.py").read_text()
    assert not (folder / "renamed.py").exists()
    code, output = run(None, "_state_machine_to_load:=of_mine.py").end()
    assert code == 0, output
    code, output = run(GOOD, "_generated_state_machine_name:=../outside.py").end()
    assert code == 2 and "generated_state_machine_name: '../outside.py'" in output
    assert not (folder.parent / "outside.py").exists()


def test_a_generated_module_can_be_loaded_instead_of_a_script(run) -> None:
    run(BAD).end()
    code, output = run(None, "_state_machine_to_load:=tiny.py").end()
    assert code == 1, output
    assert "Task 'tiny' ended with outcome 'gave_up': FAILED" in output


def test_a_faulty_script_exits_with_2_and_lists_every_fault(run) -> None:
    code, output = run(task("  - A:\n      source: giv\n      transitions: {success: dnoe}\n")).end()
    assert code == 2, output
    assert "tiny.yaml:7:15: state 'A': source 'giv' is unknown" in output
    assert "transition target 'dnoe' is unknown" in output
    assert "Traceback" not in output


def test_names_are_checked_against_the_files_and_the_robot_of_the_launch(run, tmp_path: Path) -> None:
    (tmp_path / "named_poses.yaml").write_text("above: {reference_frame: world, position: {}, orientation: {}}\n")
    (tmp_path / "manipulator_controller_parameters.yaml").write_text("manipulator_group_name: hand\n")
    rospy.set_param(
        "/robot_description_semantic",
        """<robot name="r"><group name="hand"><joint name="f"/></group>
<group_state name="wide" group="hand"><joint name="f" value="0"/></group_state></robot>""",
    )
    line = "      source: {}\n      transitions: {{success: done, fail: gave_up}}\n"
    text = task(
        "  - A:\n"
        + line.format("cartesian_move\n      pose_name: abvoe").replace("done", "B")
        + "  - B:\n"
        + line.format("gripper\n      posture: open")
    )
    text = text.replace("source: state_machine", "source: framework_state_machine")
    try:
        code, output = run(text, f"_config_directory:={tmp_path}").end()
    finally:
        rospy.delete_param("/robot_description_semantic")
    assert code == 2, output
    assert f"the pose 'abvoe' is unknown; allowed: above; add it to {tmp_path}/named_poses.yaml" in output
    assert "the posture 'open' is unknown; allowed: wide" in output


def test_nothing_to_run_exits_with_2(run) -> None:
    code, output = run(None).end()
    assert code == 2, output
    assert "~task_constructor_script" in output


def test_a_framework_task_without_its_parameters_lists_all_of_them_and_exits_with_2(run) -> None:
    text = GOOD.replace("source: state_machine", "source: framework_state_machine")
    code, output = run(text).end()
    assert code == 2, output
    for name in ("planner_name", "robot_speed_factor", "arm_group_name", "number_plan_attempt", "planning_max_time"):
        assert f"parameter '/{name}' is not set; allowed: " in output
    assert output.count("in motion_planner_config.yaml") >= 5


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_running_state_within_a_second(run, status: Heard, number: int) -> None:
    process = run(LONG)
    wait_for_start(status)
    before = time.monotonic()
    process.process.send_signal(number)
    code, output = process.end()
    assert process.ended_at() - before < STOPPED_WITHIN_S
    assert "did not end in time" not in output
    assert code == 1, output
    assert output.strip().splitlines()[-1] == "Task 'tiny' ended with outcome 'preempted': FAILED"
    assert f"stopped by {signal.Signals(number).name}" in output


def test_the_stop_service_stops_the_running_state_within_a_second(run, status: Heard) -> None:
    process = run(LONG)
    wait_for_start(status)
    stop = rospy.ServiceProxy("/run_task/stop", Trigger)
    stop.wait_for_service(60.0)
    before = time.monotonic()
    assert stop().success
    code, output = process.end()
    assert process.ended_at() - before < STOPPED_WITHIN_S
    assert code == 1, output
    assert "stopped by the service ~stop" in output


def test_what_a_running_state_says_it_does_is_published(run, status: Heard) -> None:
    process = run(LONG)
    status.wait_for(lambda messages: any(json.loads(text).get("feedback") == {"A": "staying"} for text in messages))
    process.process.send_signal(signal.SIGINT)
    process.end()


def test_the_record_of_a_run_has_every_state(run, tmp_path: Path) -> None:
    run(BAD, f"_record_directory:={tmp_path / 'records'}").end()
    (file,) = (tmp_path / "records").glob("tiny_*.json")
    record = json.loads(file.read_text())
    assert (record["task"], record["outcome"], record["succeeded"]) == ("tiny", "gave_up", False)
    (state,) = record["states"]
    assert (state["path"], state["outcome"], state["reason"]) == ("A", "fail", "the door is locked")
    assert 0.0 <= state["started_s"] <= state["ended_s"] < 60.0
    assert abs(record["begun"] - time.time()) < 120.0


def test_a_state_in_a_concurrence_in_a_nested_machine_is_stopped_too(run, status: Heard) -> None:
    inner = (
        "  - Nested:\n      source: state_machine\n      outcomes: [done, gave_up]\n      states:\n"
        "        - Both:\n            source: concurrent_state_machine\n            outcomes: [done, gave_up]\n"
        "            default_outcome: gave_up\n            outcome_map: {done: {A: success}}\n            states:\n"
        "              - A: {source: stay}\n              - B: {source: stay}\n"
    )
    process = run(task(inner))
    wait_for_start(status, "Nested/Both/B")
    before = time.monotonic()
    process.process.send_signal(signal.SIGINT)
    code, output = process.end()
    assert process.ended_at() - before < STOPPED_WITHIN_S
    assert "did not end in time" not in output
    assert code == 1, output
    assert "Traceback" not in output


def test_a_state_that_does_not_listen_is_given_up_and_named(run, status: Heard) -> None:
    process = run(LONG.replace("source: stay", "source: deaf"))
    wait_for_start(status)
    before = time.monotonic()
    process.process.send_signal(signal.SIGINT)
    code, output = process.end()
    assert process.ended_at() - before < STOPPED_WITHIN_S
    assert code == 1, output
    assert "stopped by SIGINT, but A did not end in time" in output


def test_a_state_that_raises_ends_the_task_with_its_error(run) -> None:
    code, output = run(GOOD.replace("source: give", "source: burst")).end()
    assert code == 1, output
    assert "A failed once: raised RuntimeError: a tyre burst" in output
    assert output.strip().splitlines()[-1] == "Task 'tiny' ended with outcome 'error': FAILED"


def test_a_launch_ends_with_its_task(ros_session: RosSession, tmp_path: Path) -> None:
    (tmp_path / "give.py").write_text(STATES["give.py"])
    (tmp_path / "tiny.yaml").write_text(GOOD)
    launch = ros_session.launch(
        f"""<launch><node pkg="modular_framework_core" type="run_task" name="task" output="screen" required="true">
        <param name="task_constructor_script" value="{tmp_path}/tiny.yaml"/>
        <param name="states_directory" value="{tmp_path}"/></node></launch>"""
    )
    launch.wait(90.0)
    assert "Task 'tiny' ended with outcome 'done': SUCCEEDED" in launch.log()


def test_the_shipped_wait_for_signal_state_runs_in_a_task(run, status: Heard) -> None:
    text = task(
        "  - A:\n      source: wait_for_signal\n      topic_name: go\n"
        "      transitions: {success: done, fail: gave_up}\n"
    )
    publisher = rospy.Publisher("go", Bool, queue_size=1, latch=True)
    publisher.publish(Bool(True))
    code, output = run(text, own=False).end()
    assert code == 0, output
    publisher.unregister()
