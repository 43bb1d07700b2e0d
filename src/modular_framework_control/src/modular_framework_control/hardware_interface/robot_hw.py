# SPDX-License-Identifier: BSD-3-Clause
"""Base class of every robot, simulated or real, that controllers drive.

Hardware is one subclass: a constructor without parameters, `init` that registers its interfaces, `read`
that fills the joint states and `write` that sends the commands. The owner of the loop calls once per cycle:
`hw.read(t, dt)`, `controller_manager.update(t, dt)`, `hw.write(t, dt)`. A joint that no controller has commanded yet is
commanded to stay where it was measured first.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar, TypeVar, cast

from modular_framework_control.hardware_interface.handles import SpeedScalingHandle
from modular_framework_control.hardware_interface.interfaces import (
    ControllerInfo,
    HardwareInterface,
    HardwareInterfaceError,
    InterfaceResources,
    SpeedScalingInterface,
)
from modular_framework_ros.node_handle import NodeHandle

InterfaceT = TypeVar("InterfaceT", bound=HardwareInterface[Any])


class SwitchState(Enum):
    """State of the hardware's mode change for a switch of controllers."""

    ONGOING = "ongoing"
    DONE = "done"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class HardwareFault:
    """The reason why some joints cannot be moved at the moment.

    Attributes:
        reason: for a human: "protective stop", "link to 10.0.0.2 lost".
        joints: the joints concerned.
    """

    reason: str
    joints: frozenset[str]


class RobotHW:
    """Base of all robot hardware, without joints.

    Attributes:
        announces_ready: whether this hardware itself publishes True on its `topic_to_wait_for`; if not, the node that
            runs it publishes it once its loop runs.

    `init`, `close`, `prepare_switch` and `check_for_conflict` run on a thread that may wait; `read`, `write`, `fault`,
    `do_switch` and `switch_result` run in the control loop and must neither block nor raise for an expected condition.
    Threads and processes started there inherit the priority of the loop, so start them in `init`.
    """

    announces_ready: ClassVar[bool] = False

    def __init__(self) -> None:
        self._interfaces: dict[type[HardwareInterface[Any]], HardwareInterface[Any]] = {}

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        """Reads parameters, connects, and registers the interfaces.

        Args:
            root_nh: the namespace of the robot (robot_description is found there).
            robot_hw_nh: the namespace of this hardware's own parameters.

        Returns:
            Whether the hardware can be used; the reason of a False is logged by the hardware.
        """
        del root_nh, robot_hw_nh
        return True

    def register_interface(self, interface: HardwareInterface[Any]) -> None:
        """Offers `interface` to the controllers; called from `init`.

        Raises:
            HardwareInterfaceError: an interface of this class is already registered.
        """
        if type(interface) in self._interfaces:
            raise HardwareInterfaceError(f"{type(self).__name__}: {interface.type_name} is registered twice")
        self._interfaces[type(interface)] = interface

    def get(self, interface_class: type[InterfaceT]) -> InterfaceT:
        """The registered interface of that class.

        Raises:
            HardwareInterfaceError: this hardware has none; the message lists those it has.
        """
        interface = self.find(interface_class)
        if interface is None:
            known = ", ".join(self.interface_names) or "none"
            raise HardwareInterfaceError(f"{type(self).__name__} has no {interface_class.type_name}; it has: {known}")
        return interface

    def find(self, interface_class: type[InterfaceT]) -> InterfaceT | None:
        """The registered interface of that class, or None."""
        return cast("InterfaceT | None", self._interfaces.get(interface_class))

    @property
    def interfaces(self) -> list[HardwareInterface[Any]]:
        """All registered interfaces."""
        return list(self._interfaces.values())

    @property
    def interface_names(self) -> list[str]:
        """Type names of the registered interfaces, sorted."""
        return sorted(interface.type_name for interface in self._interfaces.values())

    def read(self, time_s: float, period_s: float) -> None:
        """Fills the joint states with what is measured at `time_s` [s], `period_s` [s] after the last call."""

    def seed_commands(self) -> None:
        """Commands joints without a command to rest, where they are measured; the owner of the loop calls it."""
        for interface in self._interfaces.values():
            interface.seed_commands()

    def write(self, time_s: float, period_s: float) -> None:
        """Sends the commands of the joint handles; `period_s` [s] is the time since the last call."""

    def close(self) -> None:
        """Disconnects, and ends what `init` began, once the control loop has ended. May be called twice."""

    def fault(self) -> str:
        """Returns why this hardware cannot follow commands (a lost link, a protective stop); "" if it can.

        Called in every cycle, after `read`. The manager notifies the controllers that command its joints: their goals
        end with this reason, and they hold until it is "" again.
        """
        return ""

    @property
    def initialised(self) -> bool:
        """Whether what `init` began (a calibration) is done; controllers are loaded from then on."""
        return True

    def warning(self) -> str:
        """Returns what may keep joints from following though they are commanded (a slow link); "" for nothing."""
        return ""

    def faults(self) -> Sequence[HardwareFault]:
        """Returns the fault with its joints; hardware made of several parts has one entry per part with a fault."""
        reason = self.fault()
        return (HardwareFault(reason, self.commanded_joints),) if reason else ()

    @property
    def command_handles(self) -> list[tuple[HardwareInterface[Any], Any]]:
        """The handles that controllers command, each with its interface."""
        return [
            (interface, handle)
            for interface in self._interfaces.values()
            if interface.claims_resources
            for handle in interface.handles
        ]

    @property
    def commanded_joints(self) -> frozenset[str]:
        """Names of the joints that controllers can command."""
        return frozenset(handle.name for _, handle in self.command_handles)

    def check_for_conflict(self, controllers: Iterable[ControllerInfo]) -> str:
        """Returns why these controllers may not run together; "" when they may.

        The rule of the base class: a joint may be claimed once, by one controller through one interface. Hardware with
        another rule overrides this.
        """
        owners: dict[str, tuple[str, str]] = {}
        conflicts: dict[str, None] = {}
        for controller in controllers:
            for claim in controller.claimed_resources:
                for joint in claim.resources:
                    owner, interface = owners.setdefault(joint, (controller.name, claim.hardware_interface))
                    if owner != controller.name:
                        conflicts[
                            f"joint '{joint}' is claimed by '{owner}' and by '{controller.name}'; stop one of "
                            "them in the same request"
                        ] = None
                    elif interface != claim.hardware_interface:
                        conflicts[
                            f"joint '{joint}' is claimed by '{owner}' through {interface} and through "
                            f"{claim.hardware_interface}; a controller may claim a joint through one interface "
                            "only, change its parameters"
                        ] = None
        return "; ".join(conflicts)

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> bool:
        """Prepares a switch, on a thread that may wait; False refuses it."""
        del start, stop
        return True

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Begins the switch, in the control loop, before controllers are stopped and started."""

    def switch_result(self, controller: ControllerInfo | None = None) -> SwitchState:
        """State of the switch begun by `do_switch`, of all controllers or of one that is to start."""
        del controller
        return SwitchState.DONE


def speed_scaling_handles(robot_hw: RobotHW, joints: Iterable[str]) -> tuple[SpeedScalingHandle, ...]:
    """Returns the speed scaling handles of these joints; none if nothing scales their speed."""
    interface = robot_hw.find(SpeedScalingInterface)
    wanted = set(joints)
    return () if interface is None else tuple(h for h in interface.handles if not wanted.isdisjoint(h.joints))


__all__ = ["ControllerInfo", "HardwareFault", "InterfaceResources", "RobotHW", "SwitchState", "speed_scaling_handles"]
