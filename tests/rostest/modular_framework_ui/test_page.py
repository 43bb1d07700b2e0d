# SPDX-License-Identifier: BSD-3-Clause
"""The page follows a running task: messages of the server, and contents in a browser."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import rospy
from control_msgs.msg import JointTrajectoryControllerState
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from trajectory_msgs.msg import JointTrajectoryPoint
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from modular_framework_testing.chromium import Chromium
from modular_framework_testing.ros_session import Launch, RosSession, free_port, until

STAY = """
import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion
from std_msgs.msg import Header

from modular_framework_core.state_api.framework_state import FrameworkState


class Stay(FrameworkState):
    def __init__(self, until: str, outcomes=("success", "fail"), input_keys=(), output_keys=()):
        super().__init__(outcomes, input_keys, output_keys)
        self._until = until

    def execute(self, userdata):
        for key in self.get_registered_output_keys():
            userdata[key] = PoseStamped(header=Header(frame_id="world"), pose=Pose(Point(0.4, -0.1, 0.2), Quaternion()))
        name = f"/go_on/{self._until}"
        if not self.wait_until(lambda: rospy.has_param(name), 60.0, 0.1):
            return self.fail("nobody said go on")
        if rospy.get_param(name) == "fail":
            rospy.logwarn("the fingers touch each other")
            return self.fail("no object is between the fingers")
        return self.succeed()
"""
PICK = """
name: pick_like
source: state_machine
node_name: pick_like
outcomes: [done, gave_up]
states:
  - Select: {source: stay, until: selected, output_keys: [pose], transitions: {success: Plan, fail: gave_up}}
  - Plan:
      source: concurrent_state_machine
      outcomes: [planned, gave_up]
      default_outcome: gave_up
      outcome_map: {planned: {PlanPregrasp: success, PlanGrasp: success}}
      transitions: {planned: Pick, gave_up: gave_up}
      states:
        - PlanPregrasp: {source: stay, until: planned}
        - PlanGrasp: {source: stay, until: planned}
  - Pick:
      source: state_machine
      input_keys: [pose]
      outcomes: [done, gave_up]
      transitions: {done: done, gave_up: gave_up}
      states:
        - Close: {source: stay, until: closed, input_keys: [pose], transitions: {success: Lift, fail: gave_up}}
        - Lift: {source: stay, until: lifted, transitions: {success: done, fail: gave_up}}
"""
SMACH = """
import rospy
import smach
import smach_ros


class Wait(smach.State):
    def __init__(self):
        super().__init__(outcomes=["ready"])

    def execute(self, userdata):
        while not rospy.has_param("/go_on/smach"):
            rospy.sleep(0.05)
        return "ready"


rospy.init_node("plain_smach")
machine = smach.StateMachine(outcomes=["over", "lost"])
with machine:
    smach.StateMachine.add("WAIT", Wait(), {"ready": "over"})
server = smach_ros.IntrospectionServer("plain_smach", machine, "/PLAIN")
server.start()
machine.execute()
rospy.set_param("/go_on/smach_ended", True)
rospy.spin()
"""
PAGE = """<launch><node pkg="rosout" type="rosout" name="log_collector"/>
  <include file="$(find modular_framework_ui)/launch/page.launch">
  <arg name="port" value="{port}"/></include></launch>"""
POSE = "position (0.400, -0.100, 0.200); orientation not set, frame world"
FAILURE = "no object is between the fingers"


class Page:
    """State of a page, from the messages to a client without a browser."""

    def __init__(self, address: str) -> None:
        self.task: dict[str, Any] = {}
        self.runs: dict[int, dict[str, Any]] = {}
        self.log: dict[int, dict[str, Any]] = {}
        self.joints: list[str] = []
        self.samples: dict[int, dict[str, Any]] = {}
        self.drawing = ""
        self.viewer = ""
        self._socket = connect(f"{address.replace('http:', 'ws:')}live", max_size=None)
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        try:
            for text in self._socket:
                self._take(json.loads(text))
        except ConnectionClosed:
            return

    def _take(self, message: dict[str, Any]) -> None:
        if self.task.get("number") != message["task"]["number"]:
            self.runs.clear()
            self.samples.clear()
        self.joints = message["joints"]
        self.samples.update({sample["index"]: sample for sample in message["samples"]})
        self.runs.update({run["index"]: run for run in message["runs"]})
        self.log.update({line["index"]: line for line in message["log"]})
        self.drawing = self.drawing if message["drawing"] is None else message["drawing"]
        self.viewer, self.task = message["viewer"], message["task"]

    def active(self) -> list[str]:
        return sorted(run["path"] for run in list(self.runs.values()) if run["end_s"] is None)

    def last(self, path: str) -> dict[str, Any]:
        return [run for run in self.runs.values() if run["path"] == path][-1]

    def close(self) -> None:
        self._socket.close()


@pytest.fixture(scope="module")
def launch(ros_session: RosSession) -> Iterator[Launch]:
    launch = ros_session.launch(PAGE.format(port=free_port()))
    until(lambda: "/ in a browser" in launch.log(), "the address in the log", 60.0)
    yield launch
    launch.stop()


@pytest.fixture(scope="module")
def address(launch: Launch) -> str:
    found = re.search(r"page: open (http://127\.0\.0\.1:\d+/\S+/) in a browser", launch.log())
    assert found, launch.log()
    return found[1]


@pytest.fixture
def page(address: str) -> Iterator[Page]:
    page = Page(address)
    yield page
    page.close()


@pytest.fixture
def task(ros_session: RosSession, tmp_path: Path, launch: Launch) -> Iterator[subprocess.Popen[str]]:
    if rospy.has_param("/go_on"):
        rospy.delete_param("/go_on")
    (tmp_path / "stay.py").write_text(STAY)
    script = tmp_path / "pick_like.yaml"
    script.write_text(PICK)
    command = ["rosrun", "modular_framework_core", "run_task", str(script), f"_states_directory:={tmp_path}"]
    process = subprocess.Popen(
        command, env=ros_session.env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    yield process
    if process.poll() is None:
        process.kill()
        process.wait(10.0)


def go_on(page: Page, active: list[str], step: str, answer: str = "on") -> None:
    wanted = [f"/pick_like/{path}" for path in active]
    until(lambda: page.active() == wanted, f"{wanted} run instead of {page.active()}", 60.0)
    rospy.set_param(f"/go_on/{step}", answer)


def test_the_page_follows_nested_and_concurrent_states_to_a_failure_with_its_reason(
    task: subprocess.Popen[str], page: Page, address: str
) -> None:
    go_on(page, ["Select"], "selected")
    until(lambda: "pick_like/Pick/Lift" in page.drawing, "the drawing")
    go_on(page, ["Plan", "Plan/PlanGrasp", "Plan/PlanPregrasp"], "planned")
    until(lambda: "/pick_like/Pick/Close" in page.active(), "the gripper closes")
    late = Page(address)  # a page that is opened during the task
    go_on(late, ["Pick", "Pick/Close"], "closed", "fail")
    assert task.wait(60.0) == 1
    for each in (page, late):
        until(lambda each=each: each.task["phase"] == "failed", "the task has failed")
        assert each.task["outcome"] == "gave_up" and FAILURE in each.task["reason"]
        close, plan, pick = (each.last(f"/pick_like/{name}") for name in ("Pick/Close", "Plan", "Pick"))
        assert (close["outcome"], close["reason"], close["has_failed"]) == ("fail", FAILURE, True)
        assert (plan["outcome"], plan["has_failed"], plan["is_machine"]) == ("planned", False, True)
        assert (pick["outcome"], pick["has_failed"]) == ("gave_up", True)
        assert (close["inputs"], close["location"].endswith("pick_like.yaml:23:11")) == ({"pose": POSE}, True)
        assert each.last("/pick_like/Select")["outputs"] == {"pose": POSE}
        assert close["start_s"] < close["end_s"] and each.active() == []
        until(lambda each=each: each.log, "the warning")
        line = next(line for line in each.log.values() if "fingers" in line["text"])
        assert (line["level"], line["node"]) == ("WARN", "/run_task")
    late.close()


def test_a_task_that_is_killed_is_lost_and_the_next_task_is_shown(task: subprocess.Popen[str], page: Page) -> None:
    until(lambda: page.active() == ["/pick_like/Select"], "the first state runs", 60.0)
    until(lambda: page.drawing, "the drawing")
    task.kill()
    until(lambda: page.task["phase"] == "lost", "the task is lost")


def test_a_plain_smach_machine_is_shown_from_its_introspection_alone(
    ros_session: RosSession, tmp_path: Path, page: Page
) -> None:
    script = tmp_path / "plain.py"
    script.write_text(SMACH)
    process = subprocess.Popen([sys.executable, str(script)], env=ros_session.env)
    try:
        until(lambda: page.active() == ["/PLAIN/WAIT"], "the state runs", 60.0)
        rospy.set_param("/go_on/smach", True)
        until(lambda: page.task["phase"] == "succeeded", "the machine has ended")
        assert page.task["outcome"] == "over" and page.last("/PLAIN/WAIT")["outcome"] == "ready"
    finally:
        process.kill()
        process.wait(10.0)


def test_the_address_of_the_viewer_reaches_the_page(page: Page, launch: Launch) -> None:
    publisher = rospy.Publisher("viewer/page_address", String, queue_size=1, latch=True)
    publisher.publish("http://127.0.0.1:1/token/")
    until(lambda: page.viewer == "http://127.0.0.1:1/token/", "the address")
    publisher.unregister()
    until(lambda: page.viewer == "", "the viewer has gone")


@pytest.fixture
def replay_address(tmp_path: Path) -> Iterator[str]:
    """The page of the record of a task that failed."""
    steps = {"A": (0.0, 1.0, "success", ""), "B": (1.0, 3.0, "fail", FAILURE)}
    states = [
        {"path": path, "started_s": start, "ended_s": end, "outcome": outcome, "failed": bool(reason), "reason": reason}
        for path, (start, end, outcome, reason) in steps.items()
    ]
    transitions = [["success", "A", "B"], ["fail", "A", "gave_up"], ["success", "B", "done"], ["fail", "B", "gave_up"]]
    machine = {"path": "", "children": ["A", "B"], "initial": ["A"], "transitions": transitions}
    end = {"task": "pick_like", "begun": 0.0, "outcome": "gave_up", "succeeded": False, "error": ""}
    file = tmp_path / "record.json"
    file.write_text(json.dumps(end | {"states": states, "machines": [machine | {"outcomes": ["done", "gave_up"]}]}))
    command = ["rosrun", "modular_framework_ui", "page", "--replay", str(file), "--port", str(free_port())]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    found = re.search(r"open (http://\S+/) in a browser", process.stdout.readline())
    assert found
    yield found[1]
    process.kill()
    process.wait(10.0)


def test_a_record_is_replayed_and_scrubbed_in_a_browser(replay_address: str) -> None:
    with Chromium(replay_address) as browser:
        browser.shows("#sentence", f"The task failed with outcome 'gave_up'. B: {FAILURE}")
        browser.shows("#log", "Not shown: the world, the joints, the log.")
        browser.shows("#graph .node.failed", "B")
        slider = "document.querySelector('#moment')"
        browser.evaluate(f"{slider}.value = 0.5; {slider}.dispatchEvent(new Event('input'))")
        browser.shows("#sentence", "At 0.5 s: Running: A.")
        assert (browser.text("#graph .node.active text"), browser.text("#graph .node.failed text")) == ("A", "")
        browser.evaluate("document.querySelector('#play').click()")
        browser.shows("#play", "Pause")
        browser.shows("#play", "Play")  # at the end of the task
        browser.shows("#sentence", "The task failed")
        browser.evaluate("document.querySelector('#failure').click()")
        browser.shows("#sentence", "The task failed")
        browser.shows("#selected", f"B: fail, 1.0 s to 3.0 s. {FAILURE}")
        assert browser.text("#graph .node.failed text") == "B"
        browser.evaluate("document.querySelector('#latest').click()")
        browser.shows("#sentence", "The task failed")


@pytest.fixture
def moving_arm() -> Iterator[None]:
    """An arm that publishes the states of its joints and of its controller, at 20 Hz."""
    joints = rospy.Publisher("joint_states", JointState, queue_size=1)
    controller = rospy.Publisher("arm_controller/state", JointTrajectoryControllerState, queue_size=1)
    error = JointTrajectoryPoint(positions=[0.01, -0.01])

    def publish(_: Any) -> None:
        joints.publish(JointState(name=["pan_joint", "lift_joint"], position=[0.5, -1.5], velocity=[0.1, 0.0]))
        controller.publish(JointTrajectoryControllerState(joint_names=["pan_joint", "lift_joint"], error=error))

    timer = rospy.Timer(rospy.Duration(0.05), publish)
    yield
    timer.shutdown()
    joints.unregister()
    controller.unregister()


def last_sample(page: Page) -> dict[str, Any]:
    return list(page.samples.values())[-1] if page.samples else {}


@pytest.mark.usefixtures("moving_arm")
def test_the_joints_are_plotted_with_the_cursor_of_the_time_line(
    task: subprocess.Popen[str], page: Page, address: str
) -> None:
    until(lambda: last_sample(page).get("error") == [0.01, -0.01], "samples with tracking errors", 60.0)
    assert page.joints == ["pan_joint", "lift_joint"]
    assert (last_sample(page)["position"], last_sample(page)["effort"]) == ([0.5, -1.5], [None, None])
    with Chromium(address) as browser:
        browser.shows("#plots .u-legend", "pan")
        browser.evaluate("""document.querySelector('#quantities [value="error"]').click()""")
        until(lambda: browser.evaluate("document.querySelectorAll('#plots canvas').length") == 2, "two plots")
        browser.evaluate(
            """(() => { const bars = document.querySelector('#time .bars').getBoundingClientRect();
            const middle = { clientX: bars.left + bars.width / 2 };
            document.querySelector('#time').dispatchEvent(new MouseEvent('mousemove', middle)); })()"""
        )
        shown = "document.querySelector('#time').classList.contains('with-cursor')"
        assert browser.evaluate(shown)
        values = "[...document.querySelectorAll('#plots .u-value')].map((value) => value.textContent)"
        until(lambda: {"0.500", "-1.500", "0.010", "-0.010"} <= set(browser.evaluate(values)), "values at the cursor")


def test_a_browser_shows_the_states_the_reason_and_works_with_the_keyboard(
    task: subprocess.Popen[str], page: Page, address: str
) -> None:
    with Chromium(address) as browser:
        browser.shows("#name", "pick_like")
        browser.shows("#graph .node.active", "Select")
        go_on(page, ["Select"], "selected")
        go_on(page, ["Plan", "Plan/PlanGrasp", "Plan/PlanPregrasp"], "planned")
        browser.shows("#graph .node.active", "Close")
        browser.shows("#runs", "PlanPregrasp")
        go_on(page, ["Pick", "Pick/Close"], "closed", "fail")
        browser.shows("#sentence", FAILURE)
        browser.shows("#phase", "failed")
        browser.shows("#runs li.failed .reason", FAILURE)
        browser.shows("#log", "the fingers touch each other")
        assert browser.text("#graph .node.failed text") == "Close"
        browser.evaluate("""document.querySelector('.bar[aria-label^="Pick/Close: fail"]').focus()""")
        browser.press("Enter")
        browser.shows("#selected", "Pick/Close: fail")
        browser.shows("#state .location", "pick_like.yaml, line 23")
        browser.shows("#state tr:nth-child(2)", f"pose{POSE}")
        browser.open(address)  # reloaded
        browser.shows("#sentence", FAILURE)
        browser.shows("#graph .node.failed", "Close")
        fits = "document.documentElement.scrollHeight <= 720 && document.documentElement.scrollWidth <= 1280"
        assert browser.evaluate(fits), "the page fits into 1280 x 720"
