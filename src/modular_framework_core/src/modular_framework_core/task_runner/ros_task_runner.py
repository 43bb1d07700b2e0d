# SPDX-License-Identifier: BSD-3-Clause
"""The node ``run_task``: generates a task's state machine, runs it, publishes its status and exits with its result.

Arguments: optionally the path of a task script (``.yaml``) or of a state machine (``.py``).
Parameters (without an argument):
    ``~task_constructor_script``: Path of the task script, or its name in the API package's scripts folder.
    ``~state_machine_to_load``: Path of an existing state machine, or its name in the folder of generated state
        machines. If nonempty, nothing is generated.
    ``~generated_state_machine_name``: File name of the generated state machine; default: the task's name.
    ``~states_directory``, ``~templates_directory``: Directories, as a list or separated by ":". The framework's own
        directories are searched last.
    ``~config_directory``: Folder with the named messages of the task; if empty, message names are not checked.
    ``/robot_description_semantic``: SRDF with the available postures and planning groups.
    ``/run_id``: Run ID of roslaunch, which contains the launch time.
    ``~services_to_wait_for``: Services that must be advertised before the first state; default: none.
    ``~wait_for_start``: Whether each run waits for a call of ``~start``; default: false.
    ``~record_directory``: Output folder of run records; default: ``$ROS_HOME/modular_framework/task_records``.
Services: ``~stop`` (std_srvs/Trigger) requests a stop like SIGINT and answers at once. With ``~wait_for_start``,
    ``~start`` (std_srvs/Trigger) starts the task and answers at once.
Publishers: ``task_outcome`` (std_msgs/String, latched); ``task_status`` (std_msgs/String, JSON, latched), at every
    start and end of a state and twice a second in between; the topics of ``ros_introspection`` and ``ros_state_text``.
Exit code: 0 for the task's success outcome (its first), 1 for other outcomes, 2 if the task could not be run.
"""

from __future__ import annotations

import json
import logging
import signal
import sys
import threading
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import rospy
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

import smach
from modular_framework_core.commander.ros_planner_names import planners_by_pipeline
from modular_framework_core.files import default_folders
from modular_framework_core.files.faults import TaskFault
from modular_framework_core.task_constructor import generator, loading, pipeline
from modular_framework_core.task_constructor.known_names import MODEL_PATH, KnownNames, PlannerNames, names_of_config
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue
from modular_framework_core.task_runner.record import RunningState, StateRecord, TaskRecorder
from modular_framework_core.task_runner.ros_introspection import TaskIntrospection
from modular_framework_core.task_runner.ros_state_text import StateText
from modular_framework_core.task_runner.task_runner import (
    EXIT_NOT_RUN,
    EXIT_SUCCEEDED,
    TaskResult,
    TaskRun,
    write_record,
)
from modular_framework_ros.calls import CallError, is_advertised
from modular_framework_ros.connections.ros_frozen_nodes import frozen_nodes
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.simulated_time import SimulatedTime
from modular_framework_ros.start_up import start_timeout, wait_for_start

STOP_GRACE_S = 0.6
"""Time for running states to stop before the node exits without them [s]."""

STATUS_PERIOD_S = 0.5
"""Period of status messages about running states [s]."""

PUBLISH_TIME_S = 0.2
"""Delay before the process exits, for the last messages to be sent [s]."""

START_POLL_S = 0.1
"""Period for polling shutdown while the task waits for its start [s]."""

_PROCESS_START = time.time()
_UUID_EPOCH_S = 12219292800
"""Offset of the UUID epoch (1582-10-15) to the Unix epoch [s]."""


class TaskNotRun(Exception):
    """The task cannot be run."""


@dataclass(frozen=True, slots=True)
class RunnableTask:
    """A task that can be run.

    Attributes:
        name: Name of the task.
        factory: Function that creates a new state machine.
        locations: Position of each state's definition, keyed by path; empty if unknown.
    """

    name: str
    factory: Callable[[], smach.Container]
    locations: Mapping[str, str] = field(default_factory=dict)


def launch_time() -> float:
    """Returns the launch time [s since 1970] from roslaunch's run ID, or the start time of this process."""
    try:
        run_id = uuid.UUID(str(rospy.get_param("/run_id")))
    except (KeyError, ValueError):
        return _PROCESS_START
    return run_id.time / 1e7 - _UUID_EPOCH_S if run_id.version == 1 else _PROCESS_START


class TaskReporter:
    """Publishes and logs the progress of a task."""

    def __init__(self, name: str) -> None:
        """Advertises the topics."""
        self._name = name
        self._lock = threading.Lock()
        self._has_started_state = False
        self._started = time.monotonic()
        self._status = rospy.Publisher("task_status", String, queue_size=100, latch=True)
        self._outcome = rospy.Publisher("task_outcome", String, queue_size=1, latch=True)
        self._text = StateText(name)

    def on_state(self, record: StateRecord, active: tuple[str, ...]) -> None:
        """Publishes the start or end of a state; logs the first start. The state machine logs the transitions."""
        with self._lock:
            is_first, self._has_started_state = not self._has_started_state, True
        if is_first:
            launched = launch_time()
            clock = time.strftime("%H:%M:%S", time.localtime(launched))
            rospy.loginfo(f"first state running: {record.path} after {time.time() - launched:.1f} s since {clock}")
        ended = record.ended_s is not None
        if not ended:
            self._text.show_state(record.path)
        self._publish(
            {
                "task": self._name,
                "event": "end" if ended else "start",
                "state": record.path,
                "active": list(active),
                "elapsed_s": round(time.monotonic() - self._started, 3),
                "state_elapsed_s": round((record.ended_s or record.started_s) - record.started_s, 3),
                "outcome": record.outcome,
                "reason": record.reason,
                "location": record.location,
                "inputs": dict(record.inputs),
                "outputs": dict(record.outputs),
            }
        )

    def on_running(self, states: tuple[RunningState, ...]) -> None:
        """Publishes the elapsed times and feedback of the running states."""
        if not states:
            return
        self._publish(
            {
                "task": self._name,
                "event": "running",
                "state": states[-1].path,
                "active": [state.path for state in states],
                "elapsed_s": round(time.monotonic() - self._started, 3),
                "state_elapsed_s": round(states[-1].elapsed_s, 3),
                "feedback": {state.path: state.feedback for state in states if state.feedback},
                "location": states[-1].location,
                "inputs": dict(states[-1].inputs),
            }
        )

    def _publish(self, status: dict[str, Any]) -> None:
        self._status.publish(String(json.dumps(status)))

    def on_end(self, result: TaskResult, frozen: str = "") -> None:
        """Publishes and prints the result of the task.

        Args:
            result: Result of the task.
            frozen: Description of the nodes that are frozen at the end of the task; "" if there are none.
        """
        self._outcome.publish(String(result.outcome))
        self._text.show_result(result)
        self._publish(
            {
                "task": self._name,
                "event": "task_end",
                "state": "",
                "active": [],
                "elapsed_s": round(time.monotonic() - self._started, 3),
                "outcome": result.outcome,
                "succeeded": result.succeeded,
                "frozen": frozen,
                "reason": "; ".join([*map(str, result.failures), *([result.error] if result.error else [])]),
            }
        )
        print("\n".join(result.lines()), flush=True)
        if not result.succeeded:  # run_framework reads this log message and prints it last
            reasons = "; ".join([*map(str, result.failures), *([result.error] if result.error else [])])
            logging.getLogger("modular_framework_core.task").critical(
                "outcome '%s'%s", result.outcome, f": {reasons}" if reasons else ""
            )


def run_machine(task: RunnableTask, on_signal: Callable[[], None] = lambda: None) -> int:
    """Runs a task until it ends or is stopped by SIGINT, SIGTERM or the shutdown of ROS; returns the exit code.

    Args:
        task: Task; its state machine is created in the thread of the run.
        on_signal: Function called on SIGINT or SIGTERM.
    """
    stop_causes: list[str] = []

    def on_stop(signal_number: int, frame: Any) -> None:
        stop_causes.append(signal.Signals(signal_number).name)
        on_signal()

    previous_handlers = {item: signal.signal(item, on_stop) for item in (signal.SIGINT, signal.SIGTERM)}
    reporter, started = TaskReporter(task.name), time.time()
    recorder = TaskRecorder(reporter.on_state, ros_clock=rospy.get_time, locations=task.locations)
    introspection = TaskIntrospection(task.name, task.factory)
    run = TaskRun(task.name, introspection.make_machine, recorder)
    stop = rospy.Service("~stop", Trigger, lambda request: _on_stop_request(stop_causes))
    try:
        with SimulatedTime().held(f"task '{task.name}'"):  # simulated time stands still while states compute
            run.start()
            _wait(run, stop_causes, lambda: reporter.on_running(recorder.running()))
    finally:
        stop.shutdown("the task has ended")
        for signal_number, handler in previous_handlers.items():
            signal.signal(signal_number, handler)
    result = run.result()
    _write_record(started, result, recorder)
    reporter.on_end(result, frozen_nodes())
    time.sleep(PUBLISH_TIME_S)
    introspection.stop()
    return result.exit_code


def _on_stop_request(stop_causes: list[str]) -> TriggerResponse:
    stop_causes.append("the service ~stop")
    return TriggerResponse(success=True, message="the running states have been asked to stop")


def _write_record(started: float, result: TaskResult, recorder: TaskRecorder) -> None:
    try:
        folder = Path(_parameter("~record_directory") or default_folders.framework_home() / "task_records")
        path = write_record(folder, started, result, recorder.records(), recorder.machines())
    except (OSError, TaskNotRun) as error:
        rospy.logwarn(f"the record of the run is not written: {error}; set ~record_directory to a writable folder")
        return
    rospy.loginfo(f"record of the run: {path}")


def _wait(run: TaskRun, stop_causes: list[str], report_status: Callable[[], None]) -> None:
    """Waits for the end of a run. After a stop request, waits at most ``STOP_GRACE_S``."""
    deadline: float | None = None
    next_status = time.monotonic() + STATUS_PERIOD_S
    while not run.wait(0.02):
        if time.monotonic() > next_status:
            next_status = time.monotonic() + STATUS_PERIOD_S
            report_status()
            if frozen := frozen_nodes():
                stop_causes.append(f"the watch of the nodes: {frozen}")
        if deadline is None and (stop_causes or rospy.is_shutdown()):
            run.request_stop(stop_causes[0] if stop_causes else "the shutdown of ROS")
            deadline = time.monotonic() + STOP_GRACE_S
        if deadline is not None and time.monotonic() > deadline:
            return


def _start_node(name: str) -> None:
    rospy.init_node(name, disable_signals=True)
    smach.set_loggers(rospy.loginfo, rospy.logwarn, rospy.logdebug, rospy.logerr)


def _finish(exit_code: int) -> int:
    rospy.signal_shutdown("the task has ended")
    sys.stdout.flush()
    sys.stderr.flush()
    return exit_code


def run_as_node(
    node_name: str,
    task_name: str,
    factory: Callable[[], smach.Container],
    locations: Mapping[str, str] | None = None,
) -> int:
    """Runs a state machine as a ROS node and returns the exit code. Generated modules call this function.

    Args:
        node_name: Name of the ROS node.
        task_name: Name of the task.
        factory: Function that creates the state machine.
        locations: Position of each state's definition in the task, keyed by path.
    """
    _start_node(node_name)
    return _finish(run_machine(RunnableTask(task_name, factory, locations or {})))


def main() -> int:
    """Body of the node ``run_task``."""
    _start_node("run_task")
    try:
        task = prepare(rospy.myargv()[1:])
        waits_for_start = _parameter("~wait_for_start")
        _await_services(_parameter("~services_to_wait_for"))
    except TaskNotRun as error:
        rospy.logfatal("The task could not be run: %s", error)
        return _finish(EXIT_NOT_RUN)
    if waits_for_start:
        return _finish(StartedRuns(task).serve())
    return _finish(run_machine(task))


def _parameter(name: str) -> Any:
    """Returns a parameter of the node.

    Raises:
        TaskNotRun: The value is not allowed.
    """
    try:
        return DeclaredParameters("modular_framework_core", "run_task").value(name)
    except ParameterError as error:
        raise TaskNotRun(str(error)) from error


def _await_services(names: Sequence[str]) -> None:
    """Waits for services of other nodes.

    Raises:
        TaskNotRun: A service was not advertised in time, or ROS is shut down.
    """
    for name in map(rospy.resolve_name, names):
        if not wait_for_start(partial(is_advertised, name), f"service '{name}'"):
            raise TaskNotRun(f"service '{name}' of ~services_to_wait_for was not advertised; see the log of its node")


class StartedRuns:
    """Runs a task on request, until SIGINT, SIGTERM or the shutdown of ROS."""

    def __init__(self, task: RunnableTask) -> None:
        """Stores the task."""
        self._task = task
        self._requested, self._running, self._ended = threading.Event(), threading.Lock(), threading.Event()

    def serve(self) -> int:
        """Runs the task each time the service ``~start`` is called; returns the exit code of the last run."""
        for stop_signal in (signal.SIGINT, signal.SIGTERM):
            signal.signal(stop_signal, lambda signal_number, frame: self._ended.set())
        service = rospy.Service("~start", Trigger, lambda request: self._start())
        exit_code = EXIT_SUCCEEDED
        while not self._ended.is_set() and not rospy.is_shutdown():
            if not self._requested.wait(START_POLL_S):
                continue
            with self._running:
                self._requested.clear()
                exit_code = run_machine(self._task, self._ended.set)
        service.shutdown("the node ends")
        return exit_code

    def _start(self) -> TriggerResponse:
        if self._running.locked() or self._requested.is_set():
            return TriggerResponse(success=False, message=f"task '{self._task.name}' runs already; wait for its end")
        self._requested.set()
        return TriggerResponse(success=True, message=f"task '{self._task.name}' starts")


def prepare(arguments: list[str]) -> RunnableTask:
    """Returns the task to run.

    Args:
        arguments: Command-line arguments. Without arguments, the parameters select the task.

    Raises:
        TaskNotRun: No task is given, or the task has faults.
    """
    path = Path(arguments[0]) if arguments else None
    machine = _parameter("~state_machine_to_load").strip() if path is None else ""
    if path is None:
        path = Path(machine or _parameter("~task_constructor_script"))
    if not path.name:
        raise TaskNotRun(
            "no task is given; give a task script or a state machine as argument, or as parameter "
            "~task_constructor_script or ~state_machine_to_load"
        )
    if machine or path.suffix == ".py":
        return _prepare_machine(path)
    return _prepare_task(default_folders.task_script(path))


def _prepare_machine(path: Path) -> RunnableTask:
    if not path.is_absolute() and not path.is_file():
        path = generator.default_output_directory() / path
    try:
        module = loading.load_module(path)
        factory = loading.machine_factory(module)
    except loading.LoadingError as error:
        raise TaskNotRun(str(error)) from error
    locations = getattr(module, "LOCATIONS", {})
    return RunnableTask(str(getattr(module, "TASK_NAME", path.stem)), factory, locations)


def _prepare_task(script: Path) -> RunnableTask:
    try:
        states = default_folders.states_folders(_directories("states_directory"))
        templates = default_folders.templates_folders(_directories("templates_directory"))
        for folder in StateCatalogue(states).empty_directories:
            rospy.logwarn(pipeline.no_states_in(folder))
        output = generator.default_output_directory()
        file_name = _parameter("~generated_state_machine_name")
        task, path = pipeline.construct_task(
            script, states, templates, output, known=_known_names(), file_name=file_name
        )
    except (TaskFault, generator.GenerationError, OSError, ValueError) as error:
        raise TaskNotRun(str(error)) from error
    rospy.loginfo(f"state machine of task '{task.name}' written to {path}")
    return _prepare_machine(path)


def _known_names() -> KnownNames:
    """Returns the names in the configuration folder, in the robot's SRDF and of move_group."""
    config = _parameter("~config_directory")
    names = names_of_config(Path(config)) if config else KnownNames()
    srdf = str(rospy.get_param("/robot_description_semantic", "") or "")
    names = names.with_robot(srdf, "the parameter /robot_description_semantic") if srdf else names
    names = names.with_object_types(str(rospy.get_param(MODEL_PATH, "") or ""))
    return names.with_planners(_planners)


def _planners() -> PlannerNames:
    """Returns the planners of move_group.

    Raises:
        TaskNotRun: move_group does not answer.
    """
    try:
        return PlannerNames(planners_by_pipeline(start_timeout()))
    except CallError as error:
        raise TaskNotRun(f"the planners that the task names cannot be checked: {error}") from error


def _directories(parameter: str) -> list[Path]:
    """Returns the directories in a parameter, given as a list or separated by ":"."""
    value = _parameter(f"~{parameter}")
    return [Path(str(item)) for item in value] if isinstance(value, list) else pipeline.directories_from(str(value))
