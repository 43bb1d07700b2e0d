# SPDX-License-Identifier: BSD-3-Clause
"""Hardware interfaces as in ros_control, whose handles let controllers read and command a robot.

A `RobotHW` creates one handle per joint. A controller gets the handle from an interface once, by name, and then reads
and writes plain attributes. Command interfaces record requested handles as *claims*, so that two controllers never
command the same joint through conflicting interfaces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Generic, Protocol, TypeVar

from modular_framework_control.hardware_interface.handles import (
    ForceTorqueSensorHandle,
    ImuSensorHandle,
    JointHandle,
    JointStateHandle,
    PosVelAccJointHandle,
    PosVelJointHandle,
    SpeedScalingHandle,
)
from modular_framework_ros.allowed_names import nearest


class HardwareInterfaceError(Exception):
    """A resource is unknown to the hardware, or was registered twice."""


class _NamedHandle(Protocol):
    """Protocol of every handle."""

    @property
    def name(self) -> str:
        """Name of the handle."""


HandleT = TypeVar("HandleT", bound=_NamedHandle)


class HardwareInterface(Generic[HandleT]):
    """Handles of one type, by joint name.

    Attributes:
        type_name: Name in URDF transmissions and in `ControllerState.claimed_resources`.
        claims_resources: Whether getting a handle claims its joint.
        noun: Noun for a handle in messages.
    """

    type_name: ClassVar[str] = "hardware_interface/HardwareInterface"
    claims_resources: ClassVar[bool] = False
    noun: ClassVar[str] = "joint"

    def __init__(self) -> None:
        self._handles: dict[str, HandleT] = {}
        self._claims: dict[str, None] = {}

    def register_handle(self, handle: HandleT) -> HandleT:
        """Registers a handle and returns it.

        Raises:
            HardwareInterfaceError: A handle with the same name is already registered.
        """
        if handle.name in self._handles:
            raise HardwareInterfaceError(
                f"{self.type_name}: {self.noun} '{handle.name}' is registered twice; "
                f"register each {self.noun} once per interface"
            )
        self._handles[handle.name] = handle
        return handle

    def get_handle(self, name: str) -> HandleT:
        """Returns the handle of a joint, and claims the joint if `claims_resources` is set.

        Raises:
            HardwareInterfaceError: The joint is unknown; the message lists known joints.
        """
        try:
            handle = self._handles[name]
        except KeyError:
            known = ", ".join(sorted(self._handles)) or "none"
            raise HardwareInterfaceError(f"{self.type_name}: no {self.noun} '{name}'; it has: {known}") from None
        if self.claims_resources:
            self._claims[name] = None
        return handle

    @property
    def names(self) -> list[str]:
        """Joint names in the order of registration."""
        return list(self._handles)

    @property
    def handles(self) -> list[HandleT]:
        """All handles in the order of registration, without claims (for the RobotHW itself)."""
        return list(self._handles.values())

    def take_claims(self) -> tuple[str, ...]:
        """Returns and clears the joints claimed since the last call, in the order of the claims."""
        claims = tuple(self._claims)
        self._claims.clear()
        return claims

    def seed_commands(self) -> None:
        """Sets a command of rest for every joint without a command."""


class JointStateInterface(HardwareInterface[JointStateHandle]):
    """Read access to joint states, which any number of controllers may share."""

    type_name = "hardware_interface/JointStateInterface"


class _JointCommandInterface(HardwareInterface[JointHandle]):
    """Handles with a command; only one running controller may claim a joint.

    Attributes:
        handle_class: Class of the handles.
        commands_positions: Whether commands are positions; velocity and effort commands are 0 at rest.
    """

    claims_resources = True
    handle_class: ClassVar[type[JointHandle]] = JointHandle
    commands_positions: ClassVar[bool] = True

    def seed_commands(self) -> None:
        for handle in self._handles.values():
            if handle.command != handle.command:
                handle.command = handle.position if self.commands_positions else 0.0


class PositionJointInterface(_JointCommandInterface):
    """Joints commanded by position [rad|m]."""

    type_name = "hardware_interface/PositionJointInterface"


class VelocityJointInterface(_JointCommandInterface):
    """Joints commanded by velocity [rad/s|m/s]."""

    type_name = "hardware_interface/VelocityJointInterface"
    commands_positions = False


class EffortJointInterface(_JointCommandInterface):
    """Joints commanded by effort [Nm|N]."""

    type_name = "hardware_interface/EffortJointInterface"
    commands_positions = False


class PosVelJointInterface(_JointCommandInterface):
    """Joints commanded by position [rad|m] and velocity [rad/s|m/s]."""

    type_name = "hardware_interface/PosVelJointInterface"
    handle_class = PosVelJointHandle


class PosVelAccJointInterface(_JointCommandInterface):
    """Joints commanded by position [rad|m], velocity [rad/s|m/s] and acceleration [rad/s^2|m/s^2]."""

    type_name = "hardware_interface/PosVelAccJointInterface"
    handle_class = PosVelAccJointHandle


class SpeedScalingInterface(HardwareInterface[SpeedScalingHandle]):
    """Speed scaling of robots, for controllers that slow their trajectory clocks accordingly."""

    type_name = "scaled_controllers/SpeedScalingInterface"
    noun = "speed scaling"


class ForceTorqueSensorInterface(HardwareInterface[ForceTorqueSensorHandle]):
    """Force-torque sensors."""

    type_name = "hardware_interface/ForceTorqueSensorInterface"
    noun = "sensor"


class ImuSensorInterface(HardwareInterface[ImuSensorHandle]):
    """Inertial measurement units."""

    type_name = "hardware_interface/ImuSensorInterface"
    noun = "sensor"


CommandInterface = (
    PositionJointInterface
    | VelocityJointInterface
    | EffortJointInterface
    | PosVelJointInterface
    | PosVelAccJointInterface
)
AnyInterface = JointStateInterface | CommandInterface

COMMAND_INTERFACES: tuple[type[CommandInterface], ...] = (
    PositionJointInterface,
    VelocityJointInterface,
    EffortJointInterface,
    PosVelJointInterface,
    PosVelAccJointInterface,
)
INTERFACES_BY_NAME: dict[str, type[AnyInterface]] = {
    interface.type_name: interface for interface in (JointStateInterface, *COMMAND_INTERFACES)
}


def interface_from_name(type_name: str) -> type[AnyInterface]:
    """Returns the interface class for a name in a URDF transmission, with or without package prefix.

    Raises:
        HardwareInterfaceError: The name is unknown; the message lists known names.
    """
    full_name = type_name if "/" in type_name else f"hardware_interface/{type_name}"
    if full_name not in INTERFACES_BY_NAME:
        known = sorted(INTERFACES_BY_NAME)
        raise HardwareInterfaceError(
            f"unknown hardware interface '{type_name}'; known: {', '.join(known)}{nearest(full_name, known)}"
        )
    return INTERFACES_BY_NAME[full_name]


@dataclass(frozen=True, slots=True)
class InterfaceResources:
    """Joints that a controller claims in one interface, in the order of the claims."""

    hardware_interface: str
    resources: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ControllerInfo:
    """Description of a controller for the hardware in a switch."""

    name: str
    type: str
    claimed_resources: tuple[InterfaceResources, ...]
