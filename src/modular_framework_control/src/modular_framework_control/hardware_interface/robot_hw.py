# SPDX-License-Identifier: BSD-3-Clause
"""Base class of simulated and real robots for controllers.

A hardware class has a constructor without parameters, `init` to register its interfaces, `read` to update the joint
states, and `write` to send the commands. The owner of the loop calls once per cycle: `hw.read(t, dt)`,
`controller_manager.update(t, dt)`, `hw.write(t, dt)`. A joint that no controller has commanded yet is commanded to stay
at its first measured position.
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
    """The reason why joints cannot be moved currently.

    Attributes:
        reason: Reason for users, such as "protective stop" or "link to 10.0.0.2 lost".
        joints: Names of the affected joints.
    """

    reason: str
    joints: frozenset[str]


class RobotHW:
    """Base class of robot hardware, without joints.

    `init`, `close`, `prepare_switch` and `check_for_conflict` run on a thread that may wait; `read`, `write`, `fault`,
    `do_switch` and `switch_result` run in the control loop and must neither block nor raise for an expected condition.
    Start threads and processes in `init`, because threads started in the control loop inherit its priority.

    Attributes:
        announces_ready: Whether the hardware itself publishes True on its `topic_to_wait_for`; otherwise the node
            publishes it once the control loop runs.
    """

    announces_ready: ClassVar[bool] = False

    def __init__(self) -> None:
        self._interfaces: dict[type[HardwareInterface[Any]], HardwareInterface[Any]] = {}

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        """Reads parameters, connects, and registers the interfaces.

        Args:
            root_nh: Namespace of the robot, with robot_description.
            robot_hw_nh: Namespace of the hardware's own parameters.

        Returns:
            Whether the hardware can be used; before returning False, the hardware logs the reason.
        """
        del root_nh, robot_hw_nh
        return True

    def register_interface(self, interface: HardwareInterface[Any]) -> None:
        """Registers an interface for controllers, during `init`.

        Raises:
            HardwareInterfaceError: An interface of this class is already registered.
        """
        if type(interface) in self._interfaces:
            raise HardwareInterfaceError(f"{type(self).__name__}: {interface.type_name} is registered twice")
        self._interfaces[type(interface)] = interface

    def get(self, interface_class: type[InterfaceT]) -> InterfaceT:
        """Returns the registered interface of a class.

        Raises:
            HardwareInterfaceError: The interface is not registered; the message lists registered interfaces.
        """
        interface = self.find(interface_class)
        if interface is None:
            known = ", ".join(self.interface_names) or "none"
            raise HardwareInterfaceError(f"{type(self).__name__} has no {interface_class.type_name}; it has: {known}")
        return interface

    def find(self, interface_class: type[InterfaceT]) -> InterfaceT | None:
        """Returns the registered interface of a class, or None."""
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
        """Updates the joint states with measurements at `time_s`, `period_s` after the last call."""

    def seed_commands(self) -> None:
        """Commands joints without a command to rest at their measured positions; called by the owner of the loop."""
        for interface in self._interfaces.values():
            interface.seed_commands()

    def write(self, time_s: float, period_s: float) -> None:
        """Sends the commands of the joint handles; `period_s` is the time since the last call."""

    def close(self) -> None:
        """Disconnects and stops threads and processes after the control loop has ended; may be called twice."""

    def fault(self) -> str:
        """Returns the reason why the hardware cannot follow commands (lost link, protective stop), or "".

        This method runs in every cycle after `read`. The manager notifies the controllers of the joints. These
        controllers end their goals with this reason and hold the joints until the reason is "".
        """
        return ""

    @property
    def initialised(self) -> bool:
        """Whether work started by `init` (such as a calibration) is done, so that controllers can be loaded."""
        return True

    def warning(self) -> str:
        """Returns a possible cause of joints not following their commands (such as a slow link), or ""."""
        return ""

    def faults(self) -> Sequence[HardwareFault]:
        """Returns the fault with its joints; combined hardware returns one fault per faulty part."""
        reason = self.fault()
        return (HardwareFault(reason, self.commanded_joints),) if reason else ()

    @property
    def command_handles(self) -> list[tuple[HardwareInterface[Any], Any]]:
        """Command handles with their interfaces."""
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
        """Returns the reason why controllers may not run together, or "".

        By default, only one controller may claim a joint, through one interface. Hardware with a different rule
        overrides this method.
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
        """Prepares a switch on a thread that may wait; returns False to refuse the switch."""
        del start, stop
        return True

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        """Starts the switch in the control loop, before controllers are stopped and started."""

    def switch_result(self, controller: ControllerInfo | None = None) -> SwitchState:
        """Returns the state of the switch started by `do_switch`, of all controllers or of one starting controller."""
        del controller
        return SwitchState.DONE


def speed_scaling_handles(robot_hw: RobotHW, joints: Iterable[str]) -> tuple[SpeedScalingHandle, ...]:
    """Returns the speed scaling handles of joints; empty without speed scaling."""
    interface = robot_hw.find(SpeedScalingInterface)
    names = set(joints)
    return () if interface is None else tuple(h for h in interface.handles if not names.isdisjoint(h.joints))


__all__ = ["ControllerInfo", "HardwareFault", "InterfaceResources", "RobotHW", "SwitchState", "speed_scaling_handles"]
