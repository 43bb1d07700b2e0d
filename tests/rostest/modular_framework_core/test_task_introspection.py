# SPDX-License-Identifier: BSD-3-Clause
"""A running task shows its state machine to viewers, and they cannot disturb it."""

from __future__ import annotations

import base64
import pickle
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import rosgraph
import rospy
from smach_msgs.msg import SmachContainerStatus, SmachContainerStructure
from std_srvs.srv import Trigger

from modular_framework_testing.ros_session import RosSession

STAY = """
import rospy

from modular_framework_core.state_api.framework_state import FrameworkState


class Stay(FrameworkState):
    def __init__(self, until: str, outcomes=("success", "fail")):
        super().__init__(outcomes)
        self._until = until

    def execute(self, userdata):
        allowed = self.wait_until(lambda: rospy.has_param(f"/go_on/{self._until}"), 60.0, 0.1)
        return self.succeed() if allowed else self.fail("nobody said go on")
"""

PICK = """
name: pick_like
source: state_machine
node_name: pick_like
outcomes: [done, gave_up]
states:
  - Select: {source: stay, until: selected, transitions: {success: Plan, fail: gave_up}}
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
      outcomes: [done, gave_up]
      transitions: {done: done, gave_up: gave_up}
      states:
        - Close: {source: stay, until: closed, transitions: {success: Lift, fail: gave_up}}
        - Lift: {source: stay, until: lifted, transitions: {success: done, fail: gave_up}}
"""


class Viewer:
    """Keeps the last messages of each container."""

    def __init__(self) -> None:
        self.status: dict[str, SmachContainerStatus] = {}
        self.structure: dict[str, SmachContainerStructure] = {}
        self._subscribers = [
            rospy.Subscriber("/run_task/smach/container_status", SmachContainerStatus, self._on_status),
            rospy.Subscriber("/run_task/smach/container_structure", SmachContainerStructure, self._on_structure),
        ]

    def _on_status(self, message: SmachContainerStatus) -> None:
        self.status[message.path] = message

    def _on_structure(self, message: SmachContainerStructure) -> None:
        self.structure[message.path] = message

    def close(self) -> None:
        for subscriber in self._subscribers:
            subscriber.unregister()

    def active(self, path: str) -> list[str]:
        return sorted(self.status[path].active_states) if path in self.status else ["not seen"]


def until(condition: Callable[[], bool], timeout_s: float = 60.0) -> bool:
    end = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def start_task(ros_session: RosSession, tmp_path: Path, *arguments: str) -> subprocess.Popen[str]:
    (tmp_path / "stay.py").write_text(STAY)
    if rospy.has_param("/go_on"):
        rospy.delete_param("/go_on")
    script = tmp_path / "pick_like.yaml"
    script.write_text(PICK)
    command = ["rosrun", "modular_framework_core", "run_task", str(script), f"_states_directory:={tmp_path}"]
    return subprocess.Popen(
        [*command, *arguments], env=ros_session.env, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


@pytest.fixture()
def task(ros_session: RosSession, tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    process = start_task(ros_session, tmp_path)
    yield process
    if process.poll() is None:
        process.kill()
        process.wait(10.0)


def test_a_run_is_no_longer_shown_beside_the_next_run_of_the_same_node(ros_session, tmp_path) -> None:
    process = start_task(ros_session, tmp_path, "_wait_for_start:=true")
    try:
        rospy.wait_for_service("/run_task/start", 60.0)
        for _ in range(2):
            viewer = Viewer()
            start = rospy.ServiceProxy("/run_task/start", Trigger)
            assert until(lambda start=start: start().success), "the run starts"
            assert until(lambda viewer=viewer: viewer.active("/pick_like") == ["Select"])
            for step in ("selected", "planned", "closed", "lifted"):
                rospy.set_param(f"/go_on/{step}", True)
            assert until(lambda: not [name for name, _ in rospy.get_published_topics() if "/run_task/smach" in name])
            rospy.delete_param("/go_on")
            viewer.close()
    finally:
        rospy.delete_param("/run_task/wait_for_start")  # outlives the node
        process.send_signal(signal.SIGINT)
        process.wait(20.0)


def test_a_viewer_follows_the_active_states_of_a_nested_task_to_its_end(task) -> None:
    viewer = Viewer()

    def step(path: str, active: list[str], done: str) -> None:
        assert until(lambda: viewer.active(path) == active), f"{path}: {viewer.active(path)} instead of {active}"
        rospy.set_param(f"/go_on/{done}", True)

    assert until(lambda: viewer.active("/pick_like") == ["Select"]), viewer.active("/pick_like")
    assert until(lambda: set(viewer.structure) == {"/pick_like", "/pick_like/Plan", "/pick_like/Pick"})
    assert viewer.structure["/pick_like"].children == ["Select", "Plan", "Pick"]
    assert viewer.structure["/pick_like/Plan"].children == ["PlanPregrasp", "PlanGrasp"]
    step("/pick_like", ["Select"], "selected")
    step("/pick_like/Plan", ["PlanGrasp", "PlanPregrasp"], "planned")
    assert until(lambda: viewer.active("/pick_like/Pick") == ["Close"])
    assert until(lambda: viewer.active("/pick_like") == ["Pick"])
    step("/pick_like/Pick", ["Close"], "closed")
    assert isinstance(pickle.loads(base64.b64decode(viewer.status["/pick_like"].local_data)), dict)
    step("/pick_like/Pick", ["Lift"], "lifted")
    assert until(lambda: viewer.active("/pick_like") == [])
    assert task.wait(60.0) == 0, task.stdout.read()


def test_a_viewer_cannot_change_a_task_and_a_shown_task_stops_at_once(task) -> None:
    viewer = Viewer()
    assert until(lambda: viewer.active("/pick_like") == ["Select"])
    _, subscribed, _ = rosgraph.Master("/test").getSystemState()
    assert not [topic for topic, _ in subscribed if topic.endswith("/smach/container_init")]
    asked = time.monotonic()
    task.send_signal(signal.SIGINT)
    assert task.wait(60.0) == 1
    assert time.monotonic() - asked < 10.0  # the state would stay for a minute
    output = task.stdout.read()
    assert "Traceback" not in output, output
    assert "not published for viewers" not in output
