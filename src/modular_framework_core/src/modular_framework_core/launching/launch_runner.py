# SPDX-License-Identifier: BSD-3-Clause
"""Runs a launch file and exits with the task's exit code or names the node that died.

roslaunch itself always exits with 0, but scripts need the result of the task.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import rosgraph
import roslaunch
import roslaunch.config
import roslaunch.core
import roslaunch.loader
import roslaunch.parent
import roslaunch.pmon
import roslaunch.rlutil
import rospkg

from modular_framework_core.launching.launch_arguments import argument_values, check_arguments, load_error_text

EXIT_NODE_DIED = 3
EXIT_BAD_LAUNCH = 2
ENDING_OF_EXIT_CODE = {0: "the task succeeded", 1: "the task did not succeed", 2: "the task could not be run"}
"""Results by exit code of the task."""


@dataclass
class EndWatcher(roslaunch.pmon.ProcessListener):
    """Process listener that ends the launch with the task or with the first node that dies.

    Attributes:
        task_name: Name of the task's node.
        ends_with_task: Whether the end of the task ends the launch.
        task_exit_code: Exit code of the task's node; None while running.
        dead_node: Name and exit code of the first other node that died, or None.
        last_process: roslaunch's name of the process that ended the launch.
        parent: roslaunch's parent process; None before the launch starts.
        at_end: Function called at the end of the launch instead of stopping the other nodes, or None.
    """

    task_name: str
    ends_with_task: bool
    task_exit_code: int | None = None
    dead_node: tuple[str, int | None] | None = None
    last_process: str = ""
    parent: roslaunch.parent.ROSLaunchParent | None = field(default=None, repr=False)
    at_end: Callable[[], None] | None = field(default=None, repr=False)

    def process_died(self, process_name: str, exit_code: int | None) -> None:
        """Handles the end of a process; called by roslaunch with a name such as `move_group-5`."""
        name = process_name.rpartition("-")[0] or process_name
        if self.task_exit_code is not None or self.dead_node is not None:
            return
        if name == self.task_name and exit_code is not None and exit_code >= 0:
            self.task_exit_code = exit_code
            if not self.ends_with_task:
                return
        elif self._ends_launch(name, exit_code):
            self.dead_node = (name, exit_code)
        else:
            return
        self.last_process = process_name
        self._end_launch()

    def _ends_launch(self, name: str, exit_code: int | None) -> bool:
        """Returns whether the end of a node ends the launch: it failed or is required, and is not respawned."""
        nodes = self.parent.config.nodes if self.parent is not None and self.parent.config is not None else []
        matches = [node for node in nodes if node.name == name]
        return not any(node.respawn for node in matches) and (exit_code != 0 or any(node.required for node in matches))

    def _end_launch(self) -> None:
        if self.at_end is not None:
            self.at_end()
        if self.parent is not None and self.parent.pm is not None:
            self.parent.pm.is_shutdown = True


@dataclass(frozen=True, slots=True)
class LaunchSpec:
    """A launch file with its arguments.

    Attributes:
        package: ROS package of the launch file; "" for a path.
        launch_file: File name in the package's folder `launch`, or path.
        arguments: Launch arguments, `name:=value`. The launch file must have the argument `end_with_task`.
        later_files: Launch files loaded afterwards, whose parameters override those of the launch file.
    """

    package: str
    launch_file: str
    arguments: list[str]
    later_files: Sequence[Path] = ()


def run_launch(
    spec: LaunchSpec,
    *,
    task_name: str,
    leaves_nodes: bool = False,
    faults: Callable[[str, list[str]], Sequence[str]] = lambda path, arguments: (),
    prepare: Callable[[roslaunch.core.Node], None] = lambda node: None,
) -> int:
    """Runs a launch file until its task ends or a node dies, and prints the reason at the end.

    Args:
        spec: Launch file with its arguments.
        task_name: Name of the node that runs the task; "" if the end of every node ends the launch.
        leaves_nodes: Whether to exit at once at the end, so that the caller must stop the remaining nodes.
        faults: Function that returns the faults of the names in a launch file and its arguments. Faults prevent the
            start.
        prepare: Function that may change each node of the launch file before the start.

    Returns:
        The task's exit code, EXIT_NODE_DIED if another node died first, or EXIT_BAD_LAUNCH for an invalid launch file
        or argument.
    """
    path, arguments = "", spec.arguments
    try:
        path = roslaunch.rlutil.resolve_launch_arguments([*filter(None, (spec.package, spec.launch_file))])[0]
        check_arguments(path, arguments)
        texts = faults(path, arguments)
        if texts:
            raise roslaunch.core.RLException(f"{path}: {len(texts)} faults:" + "".join(f"\n  {text}" for text in texts))
        ends_with_task = argument_values(path, arguments)["end_with_task"]
        watcher = EndWatcher(task_name, bool(roslaunch.loader.convert_value(ends_with_task, "bool")))
        uuid = roslaunch.rlutil.get_or_generate_uuid(None, False)
        if leaves_nodes:
            watcher.at_end = lambda: _exit_with(_report_end(watcher, uuid))
        roslaunch.configure_logging(uuid)
        # The watcher ends the launch with the task; a required node would make roslaunch print its error banner.
        launch_arguments = [*arguments, "end_with_task:=false"]
        files = [(path, launch_arguments), *((str(file), []) for file in spec.later_files)]
        parent = roslaunch.parent.ROSLaunchParent(
            uuid, files, process_listeners=[watcher], port=_master_port(), show_summary=False
        )
        parent.config = roslaunch.config.load_config_default(files, parent.port)
        for node in parent.config.nodes:
            prepare(node)
        watcher.parent = parent
        parent.start()
        parent.spin()
    except (roslaunch.core.RLException, rospkg.ResourceNotFound, ValueError) as error:  # ValueError: invalid value
        print(f"run_framework: {load_error_text(error, path, arguments)}", file=sys.stderr)
        return EXIT_BAD_LAUNCH
    return _report_end(watcher, uuid)


def _report_end(watcher: EndWatcher, uuid: str) -> int:
    log_file = Path(rospkg.get_log_dir()) / uuid / f"{watcher.last_process}.log"
    return verdict(watcher, cause_of_death(log_file))


def _exit_with(code: int) -> None:
    """Exits at once, because stopping the nodes one by one takes seconds."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _master_port() -> int | None:
    return rosgraph.network.parse_http_host_and_port(rosgraph.get_master_uri())[1]


def verdict(watcher: EndWatcher, cause: str) -> int:
    """Prints the result of the launch and returns the exit code.

    Args:
        watcher: Watcher of the launch.
        cause: Reason for the end of the last process; "" if unknown.
    """
    because = f": {cause.removeprefix('The task could not be run: ')}" if cause else ""
    if watcher.dead_node is not None:
        name, exit_code = watcher.dead_node
        killed = exit_code is not None and exit_code < 0
        ending = f"was killed by signal {-exit_code}" if killed else f"exited with {exit_code}"
        print(f"run_framework: node '{name}' died ({ending}), and everything was stopped{because}", file=sys.stderr)
        return EXIT_NODE_DIED
    if watcher.task_exit_code is None:
        print("run_framework: stopped before the task ended", file=sys.stderr)
        return 1
    result = ENDING_OF_EXIT_CODE.get(
        watcher.task_exit_code, f"the task's node ended with exit code {watcher.task_exit_code}"
    )
    failed = watcher.task_exit_code != 0
    print(f"run_framework: {result}{because if failed else ''}", file=sys.stderr if failed else sys.stdout, flush=True)
    return watcher.task_exit_code


_LOG_RECORD = re.compile(r"^\[[\w.]+\]\[(\w+)\] [\d-]+ [\d:,]+: ")


def cause_of_death(log_file: Path) -> str:
    """Returns the last fatal message in a log file of rospy, or "" without a message or file."""
    try:
        lines = log_file.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    message: list[str] = []
    in_fatal = False
    for line in lines:
        record = _LOG_RECORD.match(line)
        if record is not None:
            in_fatal = record[1] == "CRITICAL"
            if in_fatal:
                message = []
        if in_fatal:
            message.append(line[record.end() :] if record is not None else line)
    return "\n".join(message).strip()
