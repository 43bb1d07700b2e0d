# SPDX-License-Identifier: BSD-3-Clause
"""The functions of ros_control's module controller_manager.controller_manager_interface: ask, and print the answer.

Each waits for its service without a timeout, prints the text of the public tool and returns whether the manager did
it. Why it refused is on the log.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import rospy

from modular_framework_control.ros.controller_manager_client import ControllerManagerClient, RefusedError

Client = ControllerManagerClient | None
"""The manager to ask; None is that of the node's namespace."""


def _client_or_default(client: Client) -> ControllerManagerClient:
    return client if client is not None else ControllerManagerClient(timeout_s=math.inf)


def list_controller_types(client: Client = None) -> None:
    """Prints the known types of controllers, one a line."""
    for name in _client_or_default(client).list_controller_types():
        print(name)


def list_controllers(client: Client = None) -> None:
    """Prints the loaded controllers, one a line."""
    states = _client_or_default(client).list_controllers()
    if not states:
        print("No controllers are loaded in mechanism control")
    for state in states:
        interfaces = "+".join(dict.fromkeys(claim.hardware_interface for claim in state.claimed_resources))
        print(f"'{state.name}' - '{interfaces}' ( {state.state} )")


def load_controller(name: str, client: Client = None) -> bool:
    """Loads a controller."""
    return _answer(lambda: _client_or_default(client).load(name), f"Loaded '{name}'", f"Error when loading '{name}'")


def unload_controller(name: str, client: Client = None) -> bool:
    """Unloads a controller."""
    return _answer(
        lambda: _client_or_default(client).unload(name),
        f"Unloaded '{name}' successfully",
        f"Error when unloading '{name}'",
    )


def start_controller(name: str, client: Client = None) -> bool:
    """Starts a controller."""
    return start_stop_controllers(start_controllers=[name], client=client)


def start_controllers(names: Sequence[str], client: Client = None) -> bool:
    """Starts controllers, all of them or none."""
    return start_stop_controllers(start_controllers=names, client=client)


def stop_controller(name: str, client: Client = None) -> bool:
    """Stops a controller."""
    return start_stop_controllers(stop_controllers=[name], client=client)


def stop_controllers(names: Sequence[str], client: Client = None) -> bool:
    """Stops controllers, all of them or none."""
    return start_stop_controllers(stop_controllers=names, client=client)


def start_stop_controllers(
    start_controllers: Sequence[str] = (), stop_controllers: Sequence[str] = (), client: Client = None
) -> bool:
    """Starts and stops controllers in one switch, all of them or none."""
    start, stop = list(start_controllers), list(stop_controllers)
    done = [f"{word} {names} successfully" for word, names in (("Started", start), ("Stopped", stop)) if names]
    return _answer(
        lambda: _client_or_default(client).switch(start, stop),
        "\n".join(done),
        f"Error when starting {start} and stopping {stop}",
    )


def reload_libraries(force_kill: bool, restore: bool = False, client: Client = None) -> bool:
    """Searches again for controller classes.

    Args:
        force_kill: stop and unload the controllers that are loaded, which otherwise prevent it.
        restore: load and start again what was there before.
        client: the manager to ask.
    """
    manager = _client_or_default(client)
    print("Restore:", restore)
    before = manager.list_controllers() if restore else []
    if not _answer(
        lambda: manager.reload_libraries(force_kill),
        "Successfully reloaded libraries",
        "Failed to reload libraries. Do you still have controllers loaded?",
    ):
        return False
    if not restore:
        return True

    def bring_back() -> None:
        for state in before:
            manager.load(state.name)
        manager.switch([state.name for state in before if state.state == "running"], [])

    return _answer(
        bring_back,
        "Controllers restored to original state",
        "Failed to restore the controllers to their original state",
    )


def _answer(action: Callable[[], None], done: str, failed: str) -> bool:
    try:
        action()
    except RefusedError as error:
        print(failed)
        rospy.logerr("%s", error)
        return False
    if done:
        print(done)
    return True
