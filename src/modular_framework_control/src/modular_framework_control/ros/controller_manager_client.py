# SPDX-License-Identifier: BSD-3-Clause
"""Asks a controller manager for something over ROS, and says which service failed when it does not answer."""

from __future__ import annotations

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

from modular_framework_ros.node_handle import join_names


class ControllerManagerClientError(Exception):
    """The controller manager is not there, does not answer, or refused."""


class RefusedError(ControllerManagerClientError):
    """The controller manager refused a request."""


class ControllerManagerClient:
    """The services of one controller manager.

    Args:
        namespace: namespace of the robot; "" for that of the node.
        timeout_s: how long to wait for a service [s of real time]; infinite waits for ever, 0 not at all.
        ended: set to end all waits.
        await_clock: whether the time counts only from when the simulated clock, if it is to be used, has begun.
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
        """A client for clean-up at shutdown; it does not wait for a service that has gone."""
        return ControllerManagerClient(self.namespace, timeout_s=0.0)

    def load(self, name: str) -> None:
        """Loads a controller."""
        self._ask("load_controller", LoadController, f"controller '{name}' was not loaded", name)

    def unload(self, name: str) -> None:
        """Unloads a controller."""
        self._ask("unload_controller", UnloadController, f"controller '{name}' was not unloaded", name)

    def switch(
        self, start: Sequence[str], stop: Sequence[str], strictness: int = SwitchControllerRequest.STRICT
    ) -> None:
        """Stops and starts controllers."""
        self._ask(
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
        """All loaded controllers."""
        controllers: list[ControllerState] = self._call("list_controllers", ListControllers).controller
        return controllers

    def list_controller_types(self) -> list[str]:
        """Known controller types."""
        types: list[str] = self._call("list_controller_types", ListControllerTypes).types
        return types

    def reload_libraries(self, force_kill: bool) -> None:
        """Searches again for controller classes."""
        self._ask(
            "reload_controller_libraries",
            ReloadControllerLibraries,
            "controller libraries were not reloaded",
            force_kill,
        )

    def _ask(self, service: str, kind: Any, failure: str, *arguments: Any) -> None:
        if not self._call(service, kind, *arguments).ok:
            raise RefusedError(f"{failure}; the log of the controller manager says why")

    def _call(self, service: str, kind: Any, *arguments: Any) -> Any:
        name = join_names(self.namespace, f"controller_manager/{service}")
        proxy = rospy.ServiceProxy(name, kind)
        if self._timeout_s > 0.0:
            self._wait_for(proxy, name)
        try:
            return proxy(*arguments)
        except rospy.ServiceException as error:
            raise ControllerManagerClientError(f"service {name} failed: {error}") from error

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
    """Whether there is no simulated time yet: a simulation that loads a large world takes a while."""
    return not rospy.rostime.is_wallclock() and rospy.get_rostime().is_zero()
