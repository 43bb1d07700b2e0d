# SPDX-License-Identifier: BSD-3-Clause
"""Provides the functions of ros_control's module controller_manager.controller_manager_interface.

Each function waits for its service without a timeout, prints the text of the public tool and returns whether the
request succeeded. The cause of a failure is logged.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import rospy

from modular_framework_control.ros.controller_manager_client import ControllerManagerClient, RefusedError

Client = ControllerManagerClient | None
"""Controller manager to call; None for the manager in the namespace of the node."""


def _client_or_default(client: Client) -> ControllerManagerClient:
    return client if client is not None else ControllerManagerClient(timeout_s=math.inf)


def list_controller_types(client: Client = None) -> None:
    """Prints the known controller types, one per line."""
    for name in _client_or_default(client).list_controller_types():
        print(name)


def list_controllers(client: Client = None) -> None:
    """Prints the loaded controllers, one per line."""
    states = _client_or_default(client).list_controllers()
    if not states:
        print("No controllers are loaded in mechanism control")
    for state in states:
        interfaces = "+".join(dict.fromkeys(claim.hardware_interface for claim in state.claimed_resources))
        print(f"'{state.name}' - '{interfaces}' ( {state.state} )")


def load_controller(name: str, client: Client = None) -> bool:
    """Loads a controller."""
    return _has_succeeded(
        lambda: _client_or_default(client).load(name), f"Loaded '{name}'", f"Error when loading '{name}'"
    )


def unload_controller(name: str, client: Client = None) -> bool:
    """Unloads a controller."""
    return _has_succeeded(
        lambda: _client_or_default(client).unload(name),
        f"Unloaded '{name}' successfully",
        f"Error when unloading '{name}'",
    )


def start_controller(name: str, client: Client = None) -> bool:
    """Starts a controller."""
    return start_stop_controllers(start_controllers=[name], client=client)


def start_controllers(names: Sequence[str], client: Client = None) -> bool:
    """Starts all named controllers or none."""
    return start_stop_controllers(start_controllers=names, client=client)


def stop_controller(name: str, client: Client = None) -> bool:
    """Stops a controller."""
    return start_stop_controllers(stop_controllers=[name], client=client)


def stop_controllers(names: Sequence[str], client: Client = None) -> bool:
    """Stops all named controllers or none."""
    return start_stop_controllers(stop_controllers=names, client=client)


def start_stop_controllers(
    start_controllers: Sequence[str] = (), stop_controllers: Sequence[str] = (), client: Client = None
) -> bool:
    """Starts and stops controllers in one switch: all of them or none.

    Args:
        start_controllers: Controllers to start.
        stop_controllers: Controllers to stop.
        client: Controller manager to call.
    """
    start, stop = list(start_controllers), list(stop_controllers)
    success_text = [f"{word} {names} successfully" for word, names in (("Started", start), ("Stopped", stop)) if names]
    return _has_succeeded(
        lambda: _client_or_default(client).switch(start, stop),
        "\n".join(success_text),
        f"Error when starting {start} and stopping {stop}",
    )


def reload_libraries(force_kill: bool, restore: bool = False, client: Client = None) -> bool:
    """Reloads the controller classes.

    Args:
        force_kill: Whether to stop and unload the loaded controllers, which otherwise prevent the reload.
        restore: Whether to load and start the former controllers again.
        client: Controller manager to call.
    """
    manager = _client_or_default(client)
    print("Restore:", restore)
    former_states = manager.list_controllers() if restore else []
    if not _has_succeeded(
        lambda: manager.reload_libraries(force_kill),
        "Successfully reloaded libraries",
        "Failed to reload libraries. Do you still have controllers loaded?",
    ):
        return False
    if not restore:
        return True

    def restore_controllers() -> None:
        for state in former_states:
            manager.load(state.name)
        manager.switch([state.name for state in former_states if state.state == "running"], [])

    return _has_succeeded(
        restore_controllers,
        "Controllers restored to original state",
        "Failed to restore the controllers to their original state",
    )


def _has_succeeded(action: Callable[[], None], success_text: str, failure_text: str) -> bool:
    try:
        action()
    except RefusedError as error:
        print(failure_text)
        rospy.logerr("%s", error)
        return False
    if success_text:
        print(success_text)
    return True
