# SPDX-License-Identifier: BSD-3-Clause
"""Provides ros_control's command-line tools for controllers: spawner, unspawner and controller_manager."""

from __future__ import annotations

import argparse
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import rospy
import yaml
from controller_manager_msgs.srv import SwitchControllerRequest
from std_msgs.msg import Bool

from modular_framework_control.ros import controller_manager_interface as interface
from modular_framework_control.ros.controller_manager_client import (
    ControllerManagerClient,
    ControllerManagerClientError,
)
from modular_framework_ros.node_handle import join_names
from modular_framework_ros.shutdown import hold_shutdown

INHIBIT_PERIOD_S = 1.0


def spawner_main() -> int:
    """Load and start controllers until this process ends, then stop and unload them in reverse order.

    If a controller cannot be loaded, the tool logs an error, starts the other controllers, and exits with code 1.
    """
    parser = argparse.ArgumentParser(prog="spawner", description=spawner_main.__doc__)
    parser.add_argument("--stopped", action="store_true", help="load the controllers but do not start them")
    parser.add_argument("--wait-for", metavar="TOPIC", help="wait until this std_msgs/Bool topic publishes True")
    _add_common_arguments(parser)
    return _run(parser, "spawner", _spawn)


def unspawner_main() -> int:
    """Keep controllers stopped, even if another process starts them, until this process ends; then start them again."""
    parser = argparse.ArgumentParser(prog="unspawner", description=unspawner_main.__doc__)
    _add_common_arguments(parser)
    return _run(parser, "unspawner", _unspawn)


def controller_manager_main() -> int:
    """Send one request: load, unload, start, stop, spawn, kill, list, list-types or reload-libraries."""
    parser = argparse.ArgumentParser(prog="controller_manager", description=controller_manager_main.__doc__)
    commands = [*_PER_CONTROLLER, "list", "list-types", "reload-libraries"]
    parser.add_argument(
        "command",
        choices=commands,
        type=lambda word: _SHORT_COMMANDS.get(word, word),
        metavar=f"{{{','.join(commands)}}}",
        help="also lc, lt, sp, kl for list, list-types, spawn, kill",
    )
    parser.add_argument(
        "--restore", action="store_true", help="with reload-libraries: load and start the former controllers again"
    )
    _add_common_arguments(parser, names="*")
    return _run(parser, "controller_manager", _run_command)


def _add_common_arguments(parser: argparse.ArgumentParser, names: str = "+") -> None:
    parser.add_argument("--namespace", default="", help="namespace of the robot")
    parser.add_argument(
        "--timeout", type=float, default=30.0, help="seconds to wait for the controller manager; 0 or less: no limit"
    )
    parser.add_argument("--no-timeout", action="store_true", help="wait without a limit")
    parser.add_argument("--shutdown-timeout", type=float, help="accepted but not used")
    parser.add_argument("controllers", nargs=names, help="names, or YAML files whose keys are names")


def _run(
    parser: argparse.ArgumentParser,
    name: str,
    action: Callable[[ControllerManagerClient, argparse.Namespace, threading.Event], None],
) -> int:
    arguments = parser.parse_args(rospy.myargv(sys.argv)[1:])
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    rospy.init_node(name, anonymous=True, disable_signals=True)
    finished = hold_shutdown(ended)
    timeout_s = math.inf if arguments.no_timeout or arguments.timeout <= 0.0 else arguments.timeout
    try:
        arguments.files = [Path(argument) for argument in arguments.controllers if Path(argument).is_file()]
        arguments.controllers = names_of(arguments.controllers)
        client = ControllerManagerClient(arguments.namespace, timeout_s, ended, await_clock=True)
        action(client, arguments, ended)
    except ControllerManagerClientError as error:
        rospy.logerr("%s", error)
        return 1
    finally:
        finished.set()
        rospy.signal_shutdown("done")
    return 0


def names_of(arguments: Sequence[str]) -> list[str]:
    """Returns controller names: each argument, or the keys or the list of an existing YAML file.

    Raises:
        ControllerManagerClientError: If a file does not contain names.
    """
    names: list[str] = []
    for argument in arguments:
        path = Path(argument)
        if not path.is_file():
            names.append(argument)
            continue
        try:
            content = yaml.safe_load(path.read_text(encoding="utf-8"))
        except (yaml.YAMLError, OSError) as error:
            raise ControllerManagerClientError(f"file {path}: {error}") from error
        if not isinstance(content, (dict, list)) or not all(isinstance(name, str) for name in content):
            raise ControllerManagerClientError(f"file {path}: expected a mapping or a list of controller names")
        names.extend(content)
    return names


def _spawn(client: ControllerManagerClient, arguments: argparse.Namespace, ended: threading.Event) -> None:
    rospy.loginfo(
        "Controller Spawner: Waiting for service %s", join_names(client.namespace, "controller_manager/load_controller")
    )
    client.list_controllers()
    if arguments.wait_for:
        _wait_for_topic(arguments.wait_for, arguments.timeout, ended)
    for path in arguments.files:
        _set_parameters(path, arguments.namespace)
    loaded: list[str] = []
    failed: list[str] = []
    try:
        for name in arguments.controllers if not ended.is_set() else ():
            rospy.loginfo("Loading controller: %s", name)
            if _has_succeeded(lambda name=name: client.load(name), f"Failed to load {name}"):
                loaded.append(name)
            else:
                failed.append(name)
        rospy.loginfo("Controller Spawner: Loaded controllers: %s", ", ".join(loaded))
        if loaded and not arguments.stopped:
            if _has_succeeded(lambda: client.switch(loaded, []), f"Failed to start controllers: {', '.join(loaded)}"):
                rospy.loginfo("Started controllers: %s", ", ".join(loaded))
            else:
                failed += loaded
        ended.wait()
    finally:
        _clean_up(client.last_calls(), loaded)
    if failed:
        raise ControllerManagerClientError(f"not spawned: {', '.join(failed)}")


def _has_succeeded(action: Callable[[], None], failure: str) -> bool:
    try:
        action()
    except ControllerManagerClientError as error:
        rospy.logerr("%s: %s", failure, error)
        return False
    return True


def _set_parameters(path: Path, namespace: str) -> None:
    """Sets the parameters that a file contains for its controllers."""
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    for name, parameters in content.items() if isinstance(content, dict) else ():
        if isinstance(parameters, dict) and parameters:
            rospy.set_param(join_names(rospy.resolve_name(namespace), name), parameters)


def _clean_up(client: ControllerManagerClient, loaded: Sequence[str]) -> None:
    """Stops and unloads the controllers, unless the manager has already ended."""
    if not loaded:
        return
    rospy.loginfo("Shutting down spawner. Stopping and unloading controllers...")
    try:
        states = {entry.name: entry.state for entry in client.list_controllers()}
        rospy.loginfo("Stopping all controllers...")
        client.switch([], [name for name in loaded if states.get(name) == "running"])
        rospy.loginfo("Unloading all loaded controllers...")
        for name in reversed(loaded):
            rospy.loginfo("Trying to unload %s", name)
            client.unload(name)
            rospy.loginfo("Succeeded in unloading %s", name)
    except ControllerManagerClientError as error:
        rospy.logwarn("controllers not unloaded: %s", error)


def _unspawn(client: ControllerManagerClient, arguments: argparse.Namespace, ended: threading.Event) -> None:
    inhibited: dict[str, None] = {}
    try:
        while not ended.is_set():
            running = [
                entry.name
                for entry in client.list_controllers()
                if entry.name in arguments.controllers and entry.state == "running"
            ]
            if running:
                rospy.loginfo("Inhibiting controllers: %s", ", ".join(running))
                client.switch([], running, SwitchControllerRequest.BEST_EFFORT)
                inhibited |= dict.fromkeys(running)
            ended.wait(INHIBIT_PERIOD_S)
    finally:
        if inhibited:
            client.last_calls().switch(list(inhibited), [], SwitchControllerRequest.BEST_EFFORT)


def _wait_for_topic(topic: str, warn_after_s: float, ended: threading.Event) -> None:
    """Waits until the topic publishes True or `ended` is set; warns once after `warn_after_s` [s]."""
    ready = threading.Event()
    subscriber = rospy.Subscriber(topic, Bool, lambda message: ready.set() if message.data else None)
    warn_at_s = time.monotonic() + warn_after_s
    while not ready.wait(0.1) and not ended.is_set():
        if time.monotonic() > warn_at_s:
            rospy.logwarn(
                "Controller Spawner: topic %s has not published True for %.0f s; still waiting",
                rospy.resolve_name(topic),
                warn_after_s,
            )
            warn_at_s = math.inf
    subscriber.unregister()


_SHORT_COMMANDS = {"lc": "list", "lt": "list-types", "sp": "spawn", "kl": "kill"}
_Step = Callable[[str, ControllerManagerClient], bool]
_PER_CONTROLLER: dict[str, tuple[_Step, ...]] = {
    "load": (interface.load_controller,),
    "unload": (interface.unload_controller,),
    "start": (interface.start_controller,),
    "stop": (interface.stop_controller,),
    "spawn": (interface.load_controller, interface.start_controller),
    "kill": (interface.stop_controller, interface.unload_controller),
}


def _run_command(client: ControllerManagerClient, arguments: argparse.Namespace, ended: threading.Event) -> None:
    del ended
    if arguments.command in _PER_CONTROLLER:
        if not arguments.controllers:
            raise ControllerManagerClientError(f"{arguments.command}: name at least one controller")
        successes = [
            step(name, client) for step in _PER_CONTROLLER[arguments.command] for name in arguments.controllers
        ]
        if not all(successes):
            raise ControllerManagerClientError(
                f"{arguments.command}: failed for at least one of: {', '.join(arguments.controllers)}"
            )
    elif arguments.command == "list":
        interface.list_controllers(client)
    elif arguments.command == "list-types":
        interface.list_controller_types(client)
    elif not interface.reload_libraries(True, arguments.restore, client):
        raise ControllerManagerClientError("reload-libraries: failed")
