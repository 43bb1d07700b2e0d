# SPDX-License-Identifier: BSD-3-Clause
"""The process beside a stack that runs episodes on it: sets the scene, starts the task, records, looks at the end.

It takes requests from its standard input and writes its answers to its standard output, a line of JSON each:
`{"folder": ..., "objects": [...], ...}` runs an episode, see `EpisodeRequest`; `{"abort": true}` ends it.
"""

from __future__ import annotations

import json
import queue
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import rosgraph
import rospy
from controller_manager_msgs.srv import ListControllers
from std_msgs.msg import String
from std_srvs.srv import Trigger

from modular_framework_benchmark.episodes.ros_recording import write_parameters, write_recording
from modular_framework_benchmark.episodes.ros_samples import Samples
from modular_framework_benchmark.episodes.ros_world import SPAWN_SERVICE, WorldError, spawn
from modular_framework_ros.calls import CallError, request_service

POLL_S = 0.02
START_SERVICE = "/task/start"
LIST_CONTROLLERS = "/controller_manager/list_controllers"
GENERATION_SIGNAL = "/grasp_generated"


class EpisodeAbortedError(RuntimeError):
    """The episode was ended from outside."""


@dataclass(frozen=True, slots=True)
class EpisodeRequest:
    """What the recorder is asked to run.

    Attributes:
        folder: Where to write the recording.
        objects: What to put into the world: `name`, `model`, `position`, `rpy`.
        target: Object that success is about; "" for none.
        hold_s: Simulated time after the end of the task when the world is looked at [s].
        method: Whether the launch has a method that generates grasps.
        controllers: Names of the controllers that must run before the task starts.
        parameters: ROS parameters to set before.
        begun: When the episode began, by the machine's monotonic clock [s].
    """

    folder: str
    objects: list[dict[str, Any]]
    target: str
    hold_s: float
    method: bool
    controllers: list[str]
    parameters: dict[str, Any]
    begun: float


class EpisodeRecorder:
    """Runs the episodes of one stack."""

    def __init__(self, aborted: threading.Event) -> None:
        """Connects to nothing yet.

        Args:
            aborted: Set when the episode is to end.
        """
        self._aborted = aborted
        self._samples = Samples()
        self._ends: queue.Queue[dict[str, Any]] = queue.Queue()

    def connect(self) -> None:
        """Waits for the master and becomes a node on it."""
        self._wait(lambda: rosgraph.is_master_online() and _has_clock_parameter())
        rospy.init_node("episode_recorder", anonymous=True, disable_signals=True)
        rospy.Subscriber("task_status", String, self._on_status)

    def run(self, request: EpisodeRequest) -> dict[str, Any]:
        """Runs an episode, and returns how the task ended and what became of the object."""
        parts = {"start": time.monotonic() - request.begun}
        for name, value in request.parameters.items():
            rospy.set_param(name, value)
        self._wait_for_stack(request)
        while not self._ends.empty():
            self._ends.get_nowait()
        self._samples.connect()
        self._samples.clear()
        for entry in request.objects:
            spawn(entry)
        self._samples.clear()
        zero = rospy.get_time()
        parts["ready"] = time.monotonic() - request.begun
        answer: dict[str, Any] = {"parts": parts, "zero": zero, "outcome": "", "reason": ""}
        try:
            self._run_task(request, answer)
        except EpisodeAbortedError:
            answer["aborted"] = True
        answer |= write_recording(Path(request.folder), self._samples, request, zero)
        answer["parameters_digest"] = write_parameters(Path(request.folder))
        parts["recorded"] = time.monotonic() - request.begun
        return answer

    def _run_task(self, request: EpisodeRequest, answer: dict[str, Any]) -> None:
        started = request_service(START_SERVICE, Trigger, Trigger._request_class(), timeout_s=30.0)
        if not started.success:
            raise WorldError(f"the task did not start: {started.message}")
        begin = time.monotonic()
        end = self._next_end()
        answer |= {
            "outcome": end["outcome"],
            "reason": end["reason"],
            "task_succeeded": end["succeeded"],
            "task_wall_s": time.monotonic() - begin,
            "task_s": rospy.get_time() - answer["zero"],
        }
        answer["parts"]["task"] = time.monotonic() - request.begun
        until = rospy.get_time() + (request.hold_s if request.target else 0.0)
        self._wait(lambda: rospy.get_time() >= until)
        answer["simulated_s"] = rospy.get_time() - answer["zero"]

    def _wait_for_stack(self, request: EpisodeRequest) -> None:
        master = rosgraph.Master(rospy.get_name())
        wanted = [START_SERVICE, *([SPAWN_SERVICE] if request.objects else [])]
        wanted += [LIST_CONTROLLERS] if request.controllers else []

        def is_up() -> bool:
            publishers, _, services = master.getSystemState()
            names = {name for name, _ in services}
            signals = not request.method or any(topic == GENERATION_SIGNAL for topic, _ in publishers)
            return signals and all(name in names for name in wanted)

        self._wait(is_up)
        self._wait(lambda: set(request.controllers) <= _running_controllers())

    def _next_end(self) -> dict[str, Any]:
        self._wait(lambda: not self._ends.empty())
        return self._ends.get_nowait()

    def _on_status(self, message: String) -> None:
        status = json.loads(message.data)
        if status["event"] == "task_end":
            self._ends.put(status)

    def _wait(self, condition: Callable[[], bool]) -> None:
        while not condition():
            if self._aborted.wait(POLL_S):
                raise EpisodeAbortedError


def _running_controllers() -> set[str]:
    answer = request_service(LIST_CONTROLLERS, ListControllers, ListControllers._request_class(), timeout_s=30.0)
    return {controller.name for controller in answer.controller if controller.state == "running"}


def _has_clock_parameter() -> bool:
    try:
        return bool(rosgraph.Master("/episode_recorder").hasParam("/use_sim_time"))
    except (OSError, rosgraph.MasterException):
        return False


def main() -> int:
    """Serves requests until the standard input ends."""
    aborted, requests = threading.Event(), queue.Queue[dict[str, Any] | None]()

    def read() -> None:
        for line in sys.stdin:
            request = json.loads(line)
            if request.get("abort"):
                aborted.set()
            else:
                requests.put(request)
        requests.put(None)
        aborted.set()

    threading.Thread(target=read, daemon=True).start()
    recorder, connected = EpisodeRecorder(aborted), False
    while (request := requests.get()) is not None:
        try:
            if not connected:
                recorder.connect()
                connected = True
            answer = recorder.run(EpisodeRequest(**request))
        except EpisodeAbortedError:
            answer = {"aborted": True}
        except (WorldError, CallError, rospy.ROSException) as error:
            answer = {"fault": str(error)}
        print(json.dumps(answer), flush=True)
        aborted.clear()
    return 0


if __name__ == "__main__":
    sys.exit(main())
