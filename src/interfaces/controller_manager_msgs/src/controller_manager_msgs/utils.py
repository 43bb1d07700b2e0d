# SPDX-License-Identifier: BSD-3-Clause
"""Lists controller managers, and filters their controllers by name, type, state, interface or resources.

The functions and classes have the names of the public module, which graphical tools and user scripts import.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import rosgraph
import rospy
import rosservice

from controller_manager_msgs.msg import ControllerState
from controller_manager_msgs.srv import ListControllers

Controllers = Iterable[ControllerState]
LIST_SERVICE = "list_controllers"
MANAGER_SERVICES = {
    LIST_SERVICE: "controller_manager_msgs/ListControllers",
    "list_controller_types": "controller_manager_msgs/ListControllerTypes",
    "load_controller": "controller_manager_msgs/LoadController",
    "unload_controller": "controller_manager_msgs/UnloadController",
    "switch_controller": "controller_manager_msgs/SwitchController",
    "reload_controller_libraries": "controller_manager_msgs/ReloadControllerLibraries",
}
"""Types of the services of a controller manager, by name in the manager's namespace."""


def get_controller_managers(namespace: str = "/", initial_guess: Sequence[str] | None = None) -> list[str]:
    """Returns the sorted namespaces of the running controller managers.

    Args:
        namespace: Namespace to search.
        initial_guess: Result of an earlier call. For these namespaces, only one service is checked, which saves calls
            to the master.
    """
    known = set(initial_guess or ())
    return sorted(
        candidate
        for candidate in _namespaces_that_list_controllers(namespace)
        if candidate in known or is_controller_manager(candidate)
    )


def is_controller_manager(namespace: str) -> bool:
    """Returns whether `namespace` contains all services of a controller manager with the right types."""
    return all(
        rosservice.get_service_type(f"{namespace.rstrip('/')}/{name}") == service_type
        for name, service_type in MANAGER_SERVICES.items()
    )


def _namespaces_that_list_controllers(namespace: str) -> set[str]:
    try:
        services = rosservice.get_service_list(namespace=namespace)
    except rosservice.ROSServiceIOException:  # no master: nothing runs
        return set()
    return {
        service[: -len(LIST_SERVICE)].rstrip("/") or "/"
        for service in services
        if service.rpartition("/")[2] == LIST_SERVICE
    }


class ControllerManagerLister:
    """Callable that returns the namespaces of the running controller managers.

    The last result is cached, so that repeated calls are cheap.

    Args:
        namespace: Namespace to search.
    """

    def __init__(self, namespace: str = "/") -> None:
        self._namespace = namespace
        self._last: list[str] = []

    def __call__(self) -> list[str]:
        self._last = get_controller_managers(self._namespace, self._last)
        return list(self._last)


class ControllerLister:
    """Callable that returns the loaded controllers of a manager; an empty list if the manager does not respond.

    Args:
        namespace: Namespace of the controller manager.
    """

    def __init__(self, namespace: str = "/controller_manager") -> None:
        self._service_name = f"{namespace.rstrip('/')}/{LIST_SERVICE}"
        self._service: Any = None

    def __call__(self) -> list[ControllerState]:
        for _ in range(2):  # the second attempt reconnects, because the manager may have restarted
            try:
                if self._service is None:
                    self._service = rospy.ServiceProxy(self._service_name, ListControllers, persistent=True)
                controllers: list[ControllerState] = self._service().controller
                return controllers
            except (rospy.ServiceException, rospy.ROSException, OSError):
                self.close()
        return []

    def close(self) -> None:
        """Closes the connection; the next call opens a new connection."""
        service, self._service = self._service, None
        if service is not None:
            service.close()


def filter_by_name(ctrl_list: Controllers, ctrl_name: str, match_substring: bool = False) -> list[ControllerState]:
    """Returns the controllers with a name.

    Args:
        ctrl_list: Controllers to choose from.
        ctrl_name: Name of the controller.
        match_substring: Whether a part of the name suffices.
    """
    return _filter(ctrl_list, lambda controller: _matches(controller.name, ctrl_name, match_substring))


def filter_by_type(ctrl_list: Controllers, ctrl_type: str, match_substring: bool = False) -> list[ControllerState]:
    """Returns the controllers of a type.

    Args:
        ctrl_list: Controllers to choose from.
        ctrl_type: Type of the controller.
        match_substring: Whether a part of the type's name suffices.
    """
    return _filter(ctrl_list, lambda controller: _matches(controller.type, ctrl_type, match_substring))


def filter_by_state(ctrl_list: Controllers, ctrl_state: str, match_substring: bool = False) -> list[ControllerState]:
    """Returns the controllers in a state.

    Args:
        ctrl_list: Controllers to choose from.
        ctrl_state: State of the controller.
        match_substring: Whether a part of the state's name suffices.
    """
    return _filter(ctrl_list, lambda controller: _matches(controller.state, ctrl_state, match_substring))


def filter_by_hardware_interface(
    ctrl_list: Controllers, hardware_interface: str, match_substring: bool = False
) -> list[ControllerState]:
    """Returns the controllers that claim resources of a hardware interface.

    Args:
        ctrl_list: Controllers to choose from.
        hardware_interface: Name of the hardware interface.
        match_substring: Whether a part of the name suffices.
    """
    return _filter(
        ctrl_list,
        lambda controller: any(
            _matches(claim.hardware_interface, hardware_interface, match_substring)
            for claim in controller.claimed_resources
        ),
    )


def filter_by_resources(
    ctrl_list: Controllers,
    resources: Iterable[str],
    hardware_interface: str | None = None,
    match_any: bool = False,
) -> list[ControllerState]:
    """Returns the controllers that claim resources of a hardware interface.

    Args:
        ctrl_list: Controllers to choose from.
        resources: Names of joints or other resources.
        hardware_interface: Name of the hardware interface; None for any interface.
        match_any: Whether one claimed resource suffices; otherwise all resources must be claimed.
    """
    wanted = set(resources)

    def claims(controller: ControllerState) -> bool:
        claimed = [
            set(claim.resources)
            for claim in controller.claimed_resources
            if hardware_interface in (None, claim.hardware_interface)
        ]
        return any(wanted & names if match_any else wanted <= names for names in claimed)

    return _filter(ctrl_list, claims)


def _matches(value: str, wanted: str, match_substring: bool) -> bool:
    return wanted in value if match_substring else wanted == value


def _filter(controllers: Controllers, fits: Callable[[ControllerState], bool]) -> list[ControllerState]:
    return [controller for controller in controllers if fits(controller)]


def get_rosparam_controller_names(namespace: str = "/") -> list[str]:
    """Names below `namespace` whose parameters have a `type` of their own, as those of controllers do; sorted."""
    prefix = f"{namespace.rstrip('/')}/"
    names = rosgraph.Master(rospy.get_name()).getParamNames()
    below = [name[len(prefix) :].split("/") for name in names if name.startswith(prefix)]
    return sorted(parts[0] for parts in below if len(parts) == 2 and parts[1] == "type")
