# SPDX-License-Identifier: BSD-3-Clause
"""Calls the services of a controller manager, and names the service in each error."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Sequence
from typing import Any

import rospy
from controller_manager_msgs.msg import ControllerState
from controller_manager_msgs.srv import (
    ListControllers,
    ListControllerTypes,
    LoadController,
    ReloadControllerLibraries,
    SwitchController,
    SwitchControllerRequest,
    UnloadController,
)

from modular_framework_ros.calls import CallError, call_service
from modular_framework_ros.node_handle import join_names


class ControllerManagerClientError(Exception):
    """Raised if the controller manager is absent, does not respond or refuses a request."""


class RefusedError(ControllerManagerClientError):
    """Raised if the controller manager refuses a request."""


class ControllerManagerClient:
    """Calls the services of one controller manager.

    Args:
        namespace: Namespace of the robot; "" for the namespace of the node.
        timeout_s: Maximum wait for a service in real time [s]; may be infinite, 0 for no wait.
        ended: Event that ends all waits.
        await_clock: Whether the timeout starts only once a simulated clock, if used, has started.
    """

    def __init__(
        self,
        namespace: str = "",
        timeout_s: float = 30.0,
        ended: threading.Event | None = None,
        await_clock: bool = False,
    ) -> None:
        self.namespace = rospy.resolve_name(namespace) if namespace else rospy.get_namespace()
        self._timeout_s = timeout_s
        self._ended = ended if ended is not None else threading.Event()
        self._await_clock = await_clock

    def last_calls(self) -> ControllerManagerClient:
        """Returns a client for the shutdown, which does not wait for a missing service."""
        return ControllerManagerClient(self.namespace, timeout_s=0.0)

    def load(self, name: str) -> None:
        """Loads a controller."""
        self._request("load_controller", LoadController, f"controller '{name}' was not loaded", name)

    def unload(self, name: str) -> None:
        """Unloads a controller."""
        self._request("unload_controller", UnloadController, f"controller '{name}' was not unloaded", name)

    def switch(
        self, start: Sequence[str], stop: Sequence[str], strictness: int = SwitchControllerRequest.STRICT
    ) -> None:
        """Stops and starts controllers.

        Args:
            start: Controllers to start.
            stop: Controllers to stop.
            strictness: STRICT or BEST_EFFORT of SwitchControllerRequest.
        """
        self._request(
            "switch_controller",
            SwitchController,
            f"controllers were not switched (start {list(start)}, stop {list(stop)})",
            list(start),
            list(stop),
            strictness,
            False,
            0.0,
        )

    def list_controllers(self) -> list[ControllerState]:
        """Returns all loaded controllers."""
        controllers: list[ControllerState] = self._call("list_controllers", ListControllers).controller
        return controllers

    def list_controller_types(self) -> list[str]:
        """Returns the known controller types."""
        types: list[str] = self._call("list_controller_types", ListControllerTypes).types
        return types

    def reload_libraries(self, force_kill: bool) -> None:
        """Reloads the controller classes; `force_kill` unloads the loaded controllers first."""
        self._request(
            "reload_controller_libraries",
            ReloadControllerLibraries,
            "controller libraries were not reloaded",
            force_kill,
        )

    def _request(self, service: str, service_class: Any, failure: str, *arguments: Any) -> None:
        if not self._call(service, service_class, *arguments).ok:
            raise RefusedError(f"{failure}; see the log of the controller manager")

    def _call(self, service: str, service_class: Any, *arguments: Any) -> Any:
        name = join_names(self.namespace, f"controller_manager/{service}")
        proxy = rospy.ServiceProxy(name, service_class)
        if self._timeout_s > 0.0:
            self._wait_for(proxy, name)
        try:
            return call_service(proxy, service_class._request_class(*arguments), math.inf)
        except CallError as error:
            raise ControllerManagerClientError(str(error)) from error

    def _wait_for(self, proxy: rospy.ServiceProxy, name: str) -> None:
        begun_s = deadline_s = time.monotonic()
        deadline_s += self._timeout_s
        while True:
            try:
                proxy.wait_for_service(timeout=0.2)
                return
            except rospy.ROSException as error:
                now_s = time.monotonic()
                if self._ended.is_set() or rospy.is_shutdown():
                    raise ControllerManagerClientError(
                        f"ended while waiting for service {name}, after {now_s - begun_s:.0f} s"
                    ) from error
                if self._await_clock and _simulation_is_starting():
                    deadline_s = now_s + self._timeout_s
                elif now_s > deadline_s:
                    raise ControllerManagerClientError(
                        f"waited {now_s - begun_s:.0f} s for service {name} in vain; is "
                        "the simulation or the hardware's node running?"
                    ) from error


def _simulation_is_starting() -> bool:
    """Returns whether simulated time has not started yet, for example while a large world is loaded."""
    return not rospy.rostime.is_wallclock() and rospy.get_rostime().is_zero()
