# SPDX-License-Identifier: BSD-3-Clause
"""The node that runs a task: makes its state machine, runs it, publishes what it does, and exits with its result.

Node ``run_task``. Arguments: optionally the path of a task script (``.yaml``) or of a state machine (``.py``).
Parameters (used where there is no argument):
    ``~task_constructor_script``: path of the task script, or its name in the API package's folder of scripts.
    ``~state_machine_to_load``: path of an existing state machine, or its name in the folder of generated ones; when it
        is not empty, nothing is generated.
    ``~generated_state_machine_name``: file name of the generated state machine; empty: the task's name.
    ``~states_directory``, ``~templates_directory``: one directory, or several separated by ":" (or a list); the
        framework's own are found after them.
    ``~config_directory``: folder whose files have the names of messages a task may use; empty: these are not checked.
    ``/robot_description_semantic``: has the postures and planning groups it may use.
    ``/run_id``: written by roslaunch; holds the time at which the launch began.
    ``~wait_for_start``: whether the task waits until it is asked to start, and may be started again and again (false).
    ``~record_directory``: where the record of the run is written (default:
        ``$ROS_HOME/modular_framework/task_records``).
Services: ``~stop`` (std_srvs/Trigger) stops the task as SIGINT does, and answers when the request has been passed on;
    with ``~wait_for_start`` ``~start`` (std_srvs/Trigger) starts the task, and answers at once.
Publishers: ``task_outcome`` (std_msgs/String, latched), ``task_status`` (std_msgs/String, JSON, latched: at every start
    and end of a state, and twice a second while states run), for viewers those of ``ros_introspection``.
Exit code: 0 for the task's success outcome (its first), 1 for any other, 2 when the task could not be run.
"""

from __future__ import annotations

import json
import logging
import signal
import sys
import threading
import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rospy
from std_msgs.msg import String
from std_srvs.srv import Trigger, TriggerResponse

import smach
from modular_framework_core.files import default_folders
from modular_framework_core.files.faults import TaskFault
from modular_framework_core.task_constructor import generator, loading, pipeline
from modular_framework_core.task_constructor.known_names import KnownNames, names_of_config
from modular_framework_core.task_constructor.state_catalogue import StateCatalogue
from modular_framework_core.task_runner.record import RunningState, StateRecord, TaskRecorder, write_record
from modular_framework_core.task_runner.ros_introspection import shown
from modular_framework_core.task_runner.task_runner import EXIT_NOT_RUN, EXIT_SUCCEEDED, TaskResult, TaskRun
from modular_framework_ros.declared_parameters import DeclaredParameters
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.ros_frozen_nodes import frozen_nodes
from modular_framework_ros.simulated_time import SimulatedTime

STOP_GRACE_S = 0.6
"""How long running states have to stop [s] before the node gives up on them."""

STATUS_PERIOD_S = 0.5
"""Time between two messages about states that are still running [s]."""

PUBLISH_TIME_S = 0.2
"""Time for the last messages to be sent before the process exits [s]."""

START_POLL_S = 0.1
"""Time between two looks whether the node is to end while the task waits for its start [s]."""

_PROCESS_START = time.time()
_UUID_EPOCH_S = 12219292800
"""Seconds from the start of UUID time (1582-10-15) to that of Unix time."""


class TaskNotRun(Exception):
    """The task cannot be run; the text says why."""


def launch_time() -> float:
    """Returns when the launch began [s since 1970]: the time in roslaunch's run id, else the start of this process."""
    try:
        run_id = uuid.UUID(str(rospy.get_param("/run_id")))
    except (KeyError, ValueError):
        return _PROCESS_START
    return run_id.time / 1e7 - _UUID_EPOCH_S if run_id.version == 1 else _PROCESS_START


class TaskReporter:
    """Reports to other nodes and the log what the task does."""

    def __init__(self, name: str) -> None:
        """Advertises the topics."""
        self._name = name
        self._lock = threading.Lock()
        self._first_seen = False
        self._started = time.monotonic()
        self._status = rospy.Publisher("task_status", String, queue_size=100, latch=True)
        self._outcome = rospy.Publisher("task_outcome", String, queue_size=1, latch=True)

    def on_state(self, record: StateRecord, active: tuple[str, ...]) -> None:
        """Publishes the start or end of a state; logs the first start."""
        with self._lock:
            first, self._first_seen = not self._first_seen, True
        if first:
            begun = launch_time()
            clock = time.strftime("%H:%M:%S", time.localtime(begun))
            rospy.loginfo(f"first state running: {record.path} after {time.time() - begun:.1f} s since {clock}")
        ended = record.ended_s is not None
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
            }
        )
        if ended:
            rospy.loginfo(f"state {record.path} ended with '{record.outcome}'")

    def on_running(self, states: tuple[RunningState, ...]) -> None:
        """Publishes for how long the states that run now have been running, and what they say they are doing."""
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
            }
        )

    def _publish(self, status: dict[str, Any]) -> None:
        self._status.publish(String(json.dumps(status)))

    def on_end(self, result: TaskResult, frozen: str = "") -> None:
        """Publishes and prints how the task ended.

        Args:
            result: Result of the task.
            frozen: Description of the nodes that are frozen at its end; empty if there are none.
        """
        self._outcome.publish(String(result.outcome))
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
        if not result.succeeded:  # run_framework reads this and prints it last, so it is not printed twice
            reasons = "; ".join([*map(str, result.failures), *([result.error] if result.error else [])])
            logging.getLogger("modular_framework_core.task").critical(
                "outcome '%s'%s", result.outcome, f": {reasons}" if reasons else ""
            )


def run_machine(name: str, factory: Callable[[], smach.Container], on_signal: Callable[[], None] = lambda: None) -> int:
    """Runs a task to its end, or until SIGINT, SIGTERM or the shutdown of ROS; returns the exit code.

    Args:
        name: Name of the task.
        factory: Makes its state machine; called in the task's thread.
        on_signal: Called when SIGINT or SIGTERM arrives.
    """
    asked_by: list[str] = []

    def on_stop(received: int, frame: Any) -> None:
        asked_by.append(signal.Signals(received).name)
        on_signal()

    previous = {number: signal.signal(number, on_stop) for number in (signal.SIGINT, signal.SIGTERM)}
    reporter, begun = TaskReporter(name), time.time()
    recorder = TaskRecorder(reporter.on_state, ros_clock=rospy.get_time)
    run = TaskRun(name, shown(name, factory), recorder)
    stop = rospy.Service("~stop", Trigger, lambda request: _asked(asked_by))
    try:
        with SimulatedTime().held(f"task '{name}'"):  # nothing of it passes while states compute
            run.start()
            _wait(run, asked_by, lambda: reporter.on_running(recorder.running()))
    finally:
        stop.shutdown("the task has ended")
        for number, handler in previous.items():
            signal.signal(number, handler)
    result = run.result()
    _keep_record(name, begun, result, recorder)
    reporter.on_end(result, frozen_nodes())
    time.sleep(PUBLISH_TIME_S)
    return result.exit_code


def _asked(asked_by: list[str]) -> TriggerResponse:
    asked_by.append("the service ~stop")
    return TriggerResponse(success=True, message="the running states have been asked to stop")


def _keep_record(name: str, begun: float, result: TaskResult, recorder: TaskRecorder) -> None:
    try:
        folder = Path(_parameter("~record_directory") or default_folders.framework_home() / "task_records")
        path = write_record(folder, name, begun, result.outcome, result.succeeded, result.error, recorder.records())
    except (OSError, TaskNotRun) as error:
        rospy.logwarn(f"the record of the run is not kept: {error}; set ~record_directory to a folder to write to")
        return
    rospy.loginfo(f"record of the run: {path}")


def _wait(run: TaskRun, asked_by: list[str], report_status: Callable[[], None]) -> None:
    """Waits for the end of a run; passes a request to stop on to it, and gives up a little later."""
    give_up: float | None = None
    next_status = time.monotonic() + STATUS_PERIOD_S
    while not run.wait(0.02):
        if time.monotonic() > next_status:
            next_status = time.monotonic() + STATUS_PERIOD_S
            report_status()
            if frozen := frozen_nodes():
                asked_by.append(f"the watch of the nodes: {frozen}")
        if give_up is None and (asked_by or rospy.is_shutdown()):
            run.request_stop(asked_by[0] if asked_by else "the shutdown of ROS")
            give_up = time.monotonic() + STOP_GRACE_S
        if give_up is not None and time.monotonic() > give_up:
            return


def _start_node(name: str) -> None:
    rospy.init_node(name, disable_signals=True)
    smach.set_loggers(rospy.loginfo, rospy.logwarn, rospy.logdebug, rospy.logerr)


def _finish(exit_code: int) -> int:
    rospy.signal_shutdown("the task has ended")
    sys.stdout.flush()
    sys.stderr.flush()
    return exit_code


def run_as_node(node_name: str, task_name: str, factory: Callable[[], smach.Container]) -> int:
    """Runs one state machine as a ROS node: the main block of generated modules; returns the exit code."""
    _start_node(node_name)
    return _finish(run_machine(task_name, factory))


def main() -> int:
    """Body of the node ``run_task``."""
    _start_node("run_task")
    try:
        name, factory = prepare(rospy.myargv()[1:])
        waits = _parameter("~wait_for_start")
    except TaskNotRun as error:
        rospy.logfatal("The task could not be run: %s", error)
        return _finish(EXIT_NOT_RUN)
    if waits:
        return _finish(StartedRuns(name, factory).serve())
    return _finish(run_machine(name, factory))


def _parameter(name: str) -> Any:
    """Returns a parameter of the node.

    Raises:
        TaskNotRun: Its value is not allowed.
    """
    try:
        return DeclaredParameters("modular_framework_core", "run_task").value(name)
    except ParameterError as error:
        raise TaskNotRun(str(error)) from error


class StartedRuns:
    """Runs a task whenever it is asked to, until SIGINT, SIGTERM or the shutdown of ROS."""

    def __init__(self, name: str, factory: Callable[[], smach.Container]) -> None:
        """Stores what to run.

        Args:
            name: Name of the task.
            factory: Makes its state machine, for each run a new one.
        """
        self._name, self._factory = name, factory
        self._asked, self._running, self._ended = threading.Event(), threading.Lock(), threading.Event()

    def serve(self) -> int:
        """Runs the task each time the service ``~start`` is called; returns the exit code of the last run."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda received, frame: self._ended.set())
        service = rospy.Service("~start", Trigger, lambda request: self._start())
        exit_code = EXIT_SUCCEEDED
        while not self._ended.is_set() and not rospy.is_shutdown():
            if not self._asked.wait(START_POLL_S):
                continue
            with self._running:
                self._asked.clear()
                exit_code = run_machine(self._name, self._factory, self._ended.set)
        service.shutdown("the node ends")
        return exit_code

    def _start(self) -> TriggerResponse:
        if self._running.locked() or self._asked.is_set():
            return TriggerResponse(success=False, message=f"task '{self._name}' runs already; wait for its end")
        self._asked.set()
        return TriggerResponse(success=True, message=f"task '{self._name}' starts")


def prepare(arguments: list[str]) -> tuple[str, Callable[[], smach.Container]]:
    """Finds out what is to be run, from the arguments or the parameters.

    Returns:
        The name of the task, and the function that makes its state machine.

    Raises:
        TaskNotRun: There is nothing to run, or it is faulty.
    """
    given = Path(arguments[0]) if arguments else None
    machine = _parameter("~state_machine_to_load").strip() if given is None else ""
    if given is None:
        given = Path(machine or _parameter("~task_constructor_script"))
    if not given.name:
        raise TaskNotRun(
            "nothing to run was given; give a task script or a state machine as argument, or as parameter "
            "~task_constructor_script or ~state_machine_to_load"
        )
    if machine or given.suffix == ".py":
        return _prepare_machine(given)
    return _prepare_task(default_folders.task_script(given))


def _prepare_machine(path: Path) -> tuple[str, Callable[[], smach.Container]]:
    if not path.is_absolute() and not path.is_file():
        path = generator.default_output_directory() / path
    try:
        module = loading.load_module(path)
        factory = loading.machine_factory(module)
    except loading.LoadingError as error:
        raise TaskNotRun(str(error)) from error
    return str(getattr(module, "TASK_NAME", path.stem)), factory


def _prepare_task(script: Path) -> tuple[str, Callable[[], smach.Container]]:
    try:
        states = default_folders.states_folders(_directories("states_directory"))
        templates = default_folders.templates_folders(_directories("templates_directory"))
        for folder in StateCatalogue(states).empty_directories:
            rospy.logwarn(pipeline.no_states_in(folder))
        output = generator.default_output_directory()
        file_name = _parameter("~generated_state_machine_name")
        task, path = pipeline.construct_task(script, states, templates, output, _known_names(), file_name)
    except (TaskFault, generator.GenerationError, OSError, ValueError) as error:
        raise TaskNotRun(str(error)) from error
    rospy.loginfo(f"state machine of task '{task.name}' written to {path}")
    return _prepare_machine(path)


def _known_names() -> KnownNames:
    """Returns the names that the configuration files of the launch and the robot have."""
    config = _parameter("~config_directory")
    names = names_of_config(Path(config)) if config else KnownNames()
    srdf = str(rospy.get_param("/robot_description_semantic", "") or "")
    return names.with_robot(srdf, "the parameter /robot_description_semantic") if srdf else names


def _directories(parameter: str) -> list[Path]:
    """Returns the directories of a parameter."""
    value = _parameter(f"~{parameter}")
    return [Path(str(item)) for item in value] if isinstance(value, list) else pipeline.directories_from(str(value))
