# SPDX-License-Identifier: BSD-3-Clause
"""Process beside a stack that runs its episodes: spawns the objects, starts the task, records, checks the result.

    python3 -m modular_framework_benchmark.episodes.ros_episode_recorder LAUNCH

LAUNCH is the process id of the stack's launch. Standard input carries requests and standard output carries answers, one
line of JSON each.
`{"folder": ..., "objects": [...], ...}` runs an episode, see `EpisodeRequest`; `{"abort": true}` aborts the episode.
"""

from __future__ import annotations

import contextlib
import json
import queue
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import rosgraph
import rospy
from controller_manager_msgs.srv import ListControllers
from simulation_time_msgs.srv import AdvanceTime, AdvanceTimeRequest
from std_srvs.srv import Trigger

from modular_framework_benchmark.episodes.bag import NODE as BAG_NODE
from modular_framework_benchmark.episodes.bag import BagRecording
from modular_framework_benchmark.episodes.errors import BagError, EpisodeAbortedError
from modular_framework_benchmark.episodes.process_times import processor_time_s
from modular_framework_benchmark.episodes.ros_recording import write_parameters, write_recording
from modular_framework_benchmark.episodes.ros_running_stack import running_stack
from modular_framework_benchmark.episodes.ros_samples import Samples
from modular_framework_benchmark.episodes.ros_shake import ShakeError, shake
from modular_framework_benchmark.episodes.ros_world import (
    SPAWN_SERVICE,
    InterferenceError,
    WorldError,
    aborted_interference,
    begin_world_record,
    end_world_record,
    judge,
    spawn,
    wait_for_rest,
)
from modular_framework_benchmark.records.episode_settings import PlacedObject, from_json
from modular_framework_core.task_runner.ros_episode import (
    GENERATE_SERVICE,
    EpisodeError,
    begin_episode,
    generate_grasps,
)
from modular_framework_ros.calls import CallError, request_service, wait_until
from modular_framework_ros.connections.ros_frozen_nodes import frozen_nodes
from modular_framework_ros.simulated_time import ADVANCE_SERVICE, SimulatedTime
from modular_framework_ros.stop_requests import stoppable

LIST_CONTROLLERS = "/controller_manager/list_controllers"
JOINT_STATE_CONTROLLER, JOINT_STATE_RATE = "joint_state_controller/JointStateController", 50.0
"""Controller type, and its default publish rate [Hz]."""
GENERATION_SIGNAL = "/grasp_generated"
GENERATION_SERVICE_S = 30.0
"""Wait for a method's service after its signal [s]; on a busy machine the connection takes seconds."""
POLL_S = 0.02
SETTLE_S, MAX_SETTLE_S = 0.5, 10.0
"""Shortest and longest time in which spawned objects come to rest [s, simulated time]."""
SAMPLE_S, SAMPLES_TIMEOUT_S = 0.02, 2.0
SERVICE_TIMEOUT_S, STOP_TIMEOUT_S = 60.0, 3.0
START_SERVICE, STOP_SERVICE = "/task/start", "/task/stop"


@dataclass(frozen=True, slots=True)
class EpisodeRequest:
    """Request to run an episode.

    Attributes:
        folder: Folder of the recording.
        objects: Objects to spawn.
        target: Name of the object in the success criteria; "" for none.
        hold_s: Simulated time between the end of the task and the check [s].
        shake_s: Simulated duration of the shake after the check [s].
        bag: Whether to record all topics to a bag.
        method_nodes: Absolute names of the grasp generation method's nodes; empty without a method.
        controllers: Names of the controllers that must run before the task starts.
        parameters: ROS parameters to set before the episode.
        begun: Start time of the episode by the machine's monotonic clock [s].
    """

    folder: str
    objects: tuple[PlacedObject, ...]
    target: str
    hold_s: float
    shake_s: float
    bag: bool
    method_nodes: tuple[str, ...]
    controllers: tuple[str, ...]
    parameters: dict[str, Any]
    begun: float


class EpisodeRecorder:
    """Runs the episodes of a stack."""

    def __init__(self, aborted: threading.Event, launch: int) -> None:
        """Stores the arguments without connecting.

        Args:
            aborted: Event that aborts the episode.
            launch: Process id of the stack's launch.
        """
        self._aborted, self._launch = aborted, launch
        self._samples = Samples()
        self._time = SimulatedTime()

    def connect(self) -> None:
        """Waits for the master and registers a node."""
        self._wait(lambda: rosgraph.is_master_online() and _has_clock_parameter())
        rospy.init_node("episode_recorder", anonymous=True, disable_signals=True)

    def run(self, request: EpisodeRequest) -> dict[str, Any]:
        """Runs an episode and returns the outcome of the task and the state of the object."""
        answer: dict[str, Any] = {"parts": {}, "zero": 0.0, "outcome": "", "reason": ""}
        for name, value in request.parameters.items():
            rospy.set_param(name, value)
        self._wait_for_stack(request)
        self._store_part_end(request, answer, "up")
        rate_hz = _joint_state_rate_hz() if self._time.enabled and request.controllers else None
        self._samples.connect()
        folder = Path(request.folder)
        with self._bag(folder, request.bag), self._time.held("episode"):
            try:
                with stoppable(self._aborted.is_set):
                    self._begin(request, answer)
                    self._run_task(request, answer)
                    self._check(request, answer)
            except (EpisodeAbortedError, EpisodeError, CallError):
                if not self._aborted.is_set():
                    raise
                answer["aborted"] = True
                self._stop_task()
                judged = aborted_interference(answer["interventions"]) if "interventions" in answer else ""
                answer["foul"] = judged or self._samples.interference()
            except InterferenceError as error:
                answer["foul"] = str(error)
                if not self._samples.ends:
                    self._stop_task()
            world = end_world_record(must_answer=not {"aborted", "foul"} & set(answer))
            answer |= write_recording(
                folder, self._samples, world, spawned=request.objects, answer=answer, rate_hz=rate_hz
            )
        parameters, answer["parameters_digest"] = write_parameters(folder)
        controllers = _running_controllers() if request.controllers else {}
        plans = [report for _, report in self._samples.planning]
        models = [placed.model for placed in request.objects]
        generators, methods = _publishers(GENERATION_SIGNAL), self._samples.process_methods()
        ran = running_stack(parameters, controllers, generators, plans, models, process_methods=methods)
        answer["ran"] = asdict(ran)
        self._store_part_end(request, answer, "recorded")
        return answer

    @contextlib.contextmanager
    def _bag(self, folder: Path, is_requested: bool) -> Iterator[None]:
        """Records a bag within the context, which starts once rosbag has subscribed to the topics."""
        if not is_requested:
            yield
            return
        with contextlib.closing(BagRecording(folder)) as bag:

            def is_subscribed() -> bool:
                bag.check()
                return _is_subscribed("/joint_states", f"/{BAG_NODE}")

            self._wait(is_subscribed)
            yield
            bag.check()

    @staticmethod
    def _store_part_end(request: EpisodeRequest, answer: dict[str, Any], part: str) -> None:
        """Stores the end time of a part of the episode [s since the start of the episode]."""
        answer["parts"][part] = time.monotonic() - request.begun

    def _begin(self, request: EpisodeRequest, answer: dict[str, Any]) -> None:
        """Spawns the objects, after a reset if simulated time can be held, and requests grasps."""

        def spawn_all() -> None:
            self._samples.clear()
            begin_world_record()
            answer["zero"] = self._now()
            for placed in request.objects:
                spawn(placed)
            answer["interventions"] = judge().number

        answer["processor_before_s"] = processor_time_s(self._launch)
        if self._time.enabled:
            begin_episode(spawn_all, SETTLE_S)
        else:
            spawn_all()
            self._time.sleep(SETTLE_S)
        wait_for_rest([placed.name for placed in request.objects], MAX_SETTLE_S - SETTLE_S, self._time.sleep)
        answer["requested_s"], answer["requested_wall"] = self._now() - answer["zero"], time.monotonic()
        if self._time.enabled and generate_grasps():
            answer["generation_s"] = time.monotonic() - answer["requested_wall"]
        self._store_part_end(request, answer, "ready")

    def _run_task(self, request: EpisodeRequest, answer: dict[str, Any]) -> None:
        """Runs the task until its end."""
        self._samples.ends.clear()
        answer["begin_poses"] = judge().poses
        answer["task_started_s"] = self._now() - answer["zero"]
        started = request_service(START_SERVICE, Trigger, Trigger._request_class(), 30.0)
        if not started.success:
            raise WorldError(f"the task did not start: {started.message}")
        try:
            self._wait(lambda: bool(self._samples.ends))
        finally:  # also of an episode that is aborted at its time limit
            answer["method_processor_s"] = processor_time_s(self._launch) - answer["processor_before_s"]
        end = self._samples.ends[-1]
        if end["frozen"]:
            raise InterferenceError(end["frozen"])
        answer |= {
            "outcome": end["outcome"],
            "reason": end["reason"],
            "task_succeeded": end["succeeded"],
            "task_wall_s": time.monotonic() - answer["requested_wall"],
            "task_s": self._now() - answer["zero"] - answer["requested_s"],
        }
        self._store_part_end(request, answer, "task")

    def _check(self, request: EpisodeRequest, answer: dict[str, Any]) -> None:
        """Checks after the hold time which object is held, and shakes it if requested."""
        self._time.sleep(request.hold_s)
        answer["checked_s"] = self._now() - answer["zero"]
        judged, begin = judge(), answer.pop("begin_poses")
        answer["held"] = bool(request.target) and request.target in judged.held
        answer["lifted"] = {name: judged.poses[name][2] - begin[name][2] for name in begin if name in judged.poses}
        if request.shake_s > 0.0 and answer["held"]:
            try:
                started_s = shake(self._samples, request.shake_s) - answer["zero"]
                answer["shake"] = {"started_s": started_s, "duration_s": request.shake_s}
            except (ShakeError, CallError) as error:
                answer["shake_fault"] = str(error)
        answer["simulated_s"] = self._now() - answer["zero"]
        latest_s = answer["zero"] + answer["simulated_s"] - SAMPLE_S
        samples = self._samples
        wait_until(lambda: samples.latest_s() >= latest_s and samples.actions_ended(), SAMPLES_TIMEOUT_S)
        answer["foul"] = judge().interference(answer["interventions"]) or self._samples.interference()
        self._store_part_end(request, answer, "checked")

    def _now(self) -> float:
        """Returns the time of the simulation [s]; while time is held, from a service because the clock topic lags."""
        if not self._time.enabled:
            return rospy.get_time()
        answer = request_service(ADVANCE_SERVICE, AdvanceTime, AdvanceTimeRequest(), SERVICE_TIMEOUT_S)
        return float(answer.stamp.to_sec())

    def _stop_task(self) -> None:
        """Stops the task, so that it writes the record of its states."""
        try:
            request_service(STOP_SERVICE, Trigger, Trigger._request_class(), STOP_TIMEOUT_S)
        except CallError:
            return
        wait_until(lambda: bool(self._samples.ends), STOP_TIMEOUT_S)

    def _wait_for_stack(self, request: EpisodeRequest) -> None:
        """Waits until the task can start: task node, simulation, controllers and method are available."""
        services = {START_SERVICE, *([SPAWN_SERVICE] if request.objects else [])}
        services |= {LIST_CONTROLLERS} if request.controllers else set()
        self._wait(lambda: services <= _services())
        self._wait(lambda: set(request.controllers) <= _running_controllers().keys())
        if request.method_nodes:
            self._wait(lambda: bool(_publishers(GENERATION_SIGNAL)))
            # A method offers the service soon after its signal, or lacks it.
            until = time.monotonic() + GENERATION_SERVICE_S
            self._wait(lambda: rospy.resolve_name(GENERATE_SERVICE) in _services() or time.monotonic() > until)

    def _wait(self, condition: Callable[[], bool]) -> None:
        while not condition():
            if self._aborted.wait(POLL_S):
                raise EpisodeAbortedError
            if frozen := frozen_nodes():
                raise InterferenceError(frozen)


def _services() -> set[str]:
    return {name for name, _ in rosgraph.Master(rospy.get_name()).getSystemState()[2]}


def _publishers(topic: str) -> list[str]:
    published = rosgraph.Master(rospy.get_name()).getSystemState()[0]
    return [node for name, nodes in published if name == topic for node in nodes]


def _is_subscribed(topic: str, node: str) -> bool:
    return any(name == topic and node in nodes for name, nodes in rosgraph.Master(rospy.get_name()).getSystemState()[1])


def _running_controllers() -> dict[str, str]:
    """Returns the types of the running controllers, keyed by name."""
    answer = request_service(LIST_CONTROLLERS, ListControllers, ListControllers._request_class(), timeout_s=30.0)
    return {controller.name: controller.type for controller in answer.controller if controller.state == "running"}


def _joint_state_rate_hz() -> float | None:
    """Returns the publish rate of the joint states [Hz]; None without a joint state controller."""
    names = [name for name, kind in _running_controllers().items() if kind == JOINT_STATE_CONTROLLER]
    return float(rospy.get_param(f"/{names[0]}/publish_rate", JOINT_STATE_RATE)) if names else None


def _has_clock_parameter() -> bool:
    try:
        return bool(rosgraph.Master("/episode_recorder").hasParam("/use_sim_time"))
    except (OSError, rosgraph.MasterException):
        return False


def main() -> int:
    """Serves requests until standard input ends."""
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
    recorder, connected = EpisodeRecorder(aborted, launch=int(sys.argv[1])), False
    while (request := requests.get()) is not None:
        try:
            if not connected:
                recorder.connect()
                connected = True
            answer = recorder.run(from_json(EpisodeRequest, request))
        except EpisodeAbortedError:
            answer = {"aborted": True}
        except (WorldError, EpisodeError, BagError, CallError, rospy.ROSException) as error:
            frozen = frozen_nodes()
            answer = {"foul": frozen} if frozen else {"fault": str(error)}
        print(json.dumps(answer), flush=True)
        aborted.clear()
    return 0


if __name__ == "__main__":
    sys.exit(main())
