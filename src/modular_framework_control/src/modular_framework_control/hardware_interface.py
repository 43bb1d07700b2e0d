# SPDX-License-Identifier: BSD-3-Clause
"""Joint handles and the interfaces that hand them out: what a controller may see and command of a robot.

The words are those of ros_control. A `RobotHW` makes one handle per joint and keeps it; controllers ask an interface
for the handle by name, once, and afterwards read and write plain attributes. Interfaces that command a joint note who
asked (a *claim*), so that two controllers never command the same joint through interfaces that exclude each other.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Generic, TypeVar


class HardwareInterfaceError(Exception):
    """A resource of the hardware was asked for that it does not have, or was registered twice."""


class JointStateHandle:
    """Measured state of one joint; the `RobotHW` writes it in `read()`, everybody else reads it.

    Attributes:
        name: joint name as in the robot description.
        position: [rad] or [m].
        velocity: [rad/s] or [m/s].
        effort: [Nm] or [N].
    """

    __slots__ = ("name", "position", "velocity", "effort")

    def __init__(self, name: str, position: float = 0.0, velocity: float = 0.0, effort: float = 0.0) -> None:
        self.name = name
        self.position = position
        self.velocity = velocity
        self.effort = effort

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, position={self.position:.6g})"


class JointHandle:
    """A joint that can be commanded: the measured state seen through `state`, and one command beside it.

    Attributes:
        state: the handle registered with the JointStateInterface (shared, not copied).
        command: in the unit of the interface: position [rad|m], velocity [rad/s|m/s] or effort [Nm|N].
        max_effort: upper bound of the effort used to follow the command [Nm|N]; 0 means the hardware's default.
            Only hardware that says so (`supports_max_effort`) heeds it.
        supports_max_effort: set by the RobotHW when it can bound the effort of this joint.
    """

    __slots__ = ("state", "command", "max_effort", "supports_max_effort")

    def __init__(self, state: JointStateHandle, command: float = 0.0, supports_max_effort: bool = False) -> None:
        self.state = state
        self.command = command
        self.max_effort = 0.0
        self.supports_max_effort = supports_max_effort

    @property
    def name(self) -> str:
        return self.state.name

    @property
    def position(self) -> float:
        return self.state.position

    @property
    def velocity(self) -> float:
        return self.state.velocity

    @property
    def effort(self) -> float:
        return self.state.effort

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r}, command={self.command:.6g})"


HandleT = TypeVar("HandleT", JointStateHandle, JointHandle)


class HardwareInterface(Generic[HandleT]):
    """A set of handles of one kind, found by joint name.

    Attributes:
        type_name: the name written in URDF transmissions and in `ControllerState.claimed_resources`.
        claims_resources: whether getting a handle claims its joint.
    """

    type_name: ClassVar[str] = "hardware_interface/HardwareInterface"
    claims_resources: ClassVar[bool] = False

    def __init__(self) -> None:
        self._handles: dict[str, HandleT] = {}
        self._claims: set[str] = set()

    def register_handle(self, handle: HandleT) -> HandleT:
        """Add a handle; returns it for chaining.

        Raises:
            HardwareInterfaceError: a handle of that name is already registered.
        """
        if handle.name in self._handles:
            raise HardwareInterfaceError(f"{self.type_name}: joint '{handle.name}' is registered twice; "
                                         "register each joint once per interface")
        self._handles[handle.name] = handle
        return handle

    def get_handle(self, name: str) -> HandleT:
        """The handle of joint `name`; claims the joint if this interface claims.

        Raises:
            HardwareInterfaceError: no such joint; the message lists those there are.
        """
        try:
            handle = self._handles[name]
        except KeyError:
            known = ", ".join(sorted(self._handles)) or "none"
            raise HardwareInterfaceError(f"{self.type_name}: no joint '{name}'; it has: {known}") from None
        if self.claims_resources:
            self._claims.add(name)
        return handle

    @property
    def names(self) -> list[str]:
        """Joint names in the order of registration."""
        return list(self._handles)

    @property
    def handles(self) -> list[HandleT]:
        """All handles in the order of registration; reading them claims nothing (for the RobotHW itself)."""
        return list(self._handles.values())

    def take_claims(self) -> frozenset[str]:
        """Joints claimed since the last call; forgets them."""
        claims = frozenset(self._claims)
        self._claims.clear()
        return claims


class JointStateInterface(HardwareInterface[JointStateHandle]):
    """Read access to joint states; any number of controllers may share it."""

    type_name = "hardware_interface/JointStateInterface"


class _JointCommandInterface(HardwareInterface[JointHandle]):
    """Handles with a command; a joint belongs to one running controller at a time."""

    claims_resources = True


class PositionJointInterface(_JointCommandInterface):
    """Joints commanded by position [rad|m]."""

    type_name = "hardware_interface/PositionJointInterface"


class VelocityJointInterface(_JointCommandInterface):
    """Joints commanded by velocity [rad/s|m/s]."""

    type_name = "hardware_interface/VelocityJointInterface"


class EffortJointInterface(_JointCommandInterface):
    """Joints commanded by effort [Nm|N]."""

    type_name = "hardware_interface/EffortJointInterface"


AnyInterface = JointStateInterface | PositionJointInterface | VelocityJointInterface | EffortJointInterface

INTERFACES_BY_NAME: dict[str, type[AnyInterface]] = {
    interface.type_name: interface
    for interface in (JointStateInterface, PositionJointInterface, VelocityJointInterface, EffortJointInterface)
}


def interface_from_name(type_name: str) -> type[AnyInterface]:
    """The interface class for a name as written in a URDF transmission, with or without the package part.

    Raises:
        HardwareInterfaceError: unknown name; the message lists the known ones.
    """
    full_name = type_name if "/" in type_name else f"hardware_interface/{type_name}"
    if full_name not in INTERFACES_BY_NAME:
        known = ", ".join(sorted(INTERFACES_BY_NAME))
        raise HardwareInterfaceError(f"unknown hardware interface '{type_name}'; known: {known}")
    return INTERFACES_BY_NAME[full_name]


@dataclass(frozen=True, slots=True)
class InterfaceResources:
    """The joints a controller claims of one interface."""

    hardware_interface: str
    resources: frozenset[str]


@dataclass(frozen=True, slots=True)
class ControllerInfo:
    """What the hardware is told of a controller when it is asked about a switch."""

    name: str
    type: str
    claimed_resources: tuple[InterfaceResources, ...]
