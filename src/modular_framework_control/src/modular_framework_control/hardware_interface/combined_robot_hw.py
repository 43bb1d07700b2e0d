# SPDX-License-Identifier: BSD-3-Clause
"""Several hardware parts, such as an arm and a gripper, combined into one robot for controllers."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from modular_framework_control.hardware_interface.interfaces import (
    ControllerInfo,
    HardwareInterface,
    HardwareInterfaceError,
    InterfaceResources,
)
from modular_framework_control.hardware_interface.plugins import ROBOT_HW_BASE, PluginError, PluginIndex
from modular_framework_control.hardware_interface.robot_hw import HardwareFault, RobotHW, SwitchState
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names
from modular_framework_ros.parameter_declarations import parameters_below

LOGGER = logging.getLogger("rosout.combined_robot_hw")


@dataclass(frozen=True, slots=True)
class HardwarePart:
    """One entry of `robot_hardware`.

    Attributes:
        name: Name in the list, and namespace of the part's parameters.
        hardware: Hardware of the class in the parameter `type`.
        resources: Joints by type name of the interface.
    """

    name: str
    hardware: RobotHW
    resources: dict[str, frozenset[str]]

    def claims_of(self, controllers: Iterable[ControllerInfo]) -> list[ControllerInfo]:
        """Returns the controllers with claims on this part, without their other claims."""
        result: list[ControllerInfo] = []
        for controller in controllers:
            claims = [
                InterfaceResources(
                    claim.hardware_interface,
                    tuple(name for name in claim.resources if name in self.resources.get(claim.hardware_interface, ())),
                )
                for claim in controller.claimed_resources
            ]
            own_claims = tuple(claim for claim in claims if claim.resources)
            if own_claims:
                result.append(ControllerInfo(controller.name, controller.type, own_claims))
        return result


class CombinedRobotHW(RobotHW):
    """Several hardware parts as one robot.

    Parameters, in the namespace given to `init`: `robot_hardware`, a list of names; for each name a namespace with
    `type` (package/Class, see plugins.py) and the parameters of this part.

    The interfaces of all parts are combined by class. A joint may be in different interfaces of different parts, but
    two parts must not command it through the same interface. If two parts measure a joint, the state of the later part
    is used, with a warning. Each part decides on claims on its own joints; if several parts command a joint, one
    controller may claim it through one interface.

    Args:
        make: Function that creates hardware of a type name; by default from the plugins of the workspace.
    """

    def __init__(self, make: Callable[[str], RobotHW] | None = None) -> None:
        super().__init__()
        self._make = make if make is not None else robot_hw_of_type
        self._parts: list[HardwarePart] = []
        self._raised_errors: dict[tuple[str, str], str] = {}

    @property
    def parts(self) -> tuple[HardwarePart, ...]:
        """The parts, in the order of the list."""
        return tuple(self._parts)

    def init(self, root_nh: NodeHandle, robot_hw_nh: NodeHandle) -> bool:
        try:
            parameters = parameters_below("modular_framework_control", "robot_hw", robot_hw_nh, robot_hw_nh)
            for name in parameters.values("robot_hardware", required=("robot_hardware",))[0]:
                self._parts.append(self._make_part(name, root_nh, robot_hw_nh.child(name)))
            self._combine_interfaces()
        except (ParameterError, HardwareInterfaceError) as error:
            LOGGER.error("%s", error)
            self.close()
            return False
        return True

    def close(self) -> None:
        for part in reversed(self._parts):
            try:
                part.hardware.close()
            except Exception as error:  # a user's hardware may raise anything; the other parts must still be closed
                LOGGER.exception("hardware '%s': close() raised %s: %s", part.name, type(error).__name__, error)

    @property
    def initialised(self) -> bool:
        return all(part.hardware.initialised for part in self._parts)

    def warning(self) -> str:
        return "; ".join(filter(None, (part.hardware.warning() for part in self._parts)))

    def fault(self) -> str:
        return "; ".join(fault.reason for fault in self.faults())

    def faults(self) -> Sequence[HardwareFault]:
        if self._raised_errors:
            return [*self._raised_faults(), *self._reported_faults()]
        return self._reported_faults()

    def _raised_faults(self) -> Iterator[HardwareFault]:
        for part in self._parts:
            for step_name in ("read", "write"):
                if (part.name, step_name) in self._raised_errors:
                    yield HardwareFault(
                        f"hardware '{part.name}': {self._raised_errors[part.name, step_name]}",
                        part.hardware.commanded_joints,
                    )

    def _reported_faults(self) -> list[HardwareFault]:
        return [
            HardwareFault(f"hardware '{part.name}': {fault.reason}", fault.joints)
            for part in self._parts
            for fault in part.hardware.faults()
        ]

    def _make_part(self, name: str, root_nh: NodeHandle, part_nh: NodeHandle) -> HardwarePart:
        location = f"entry '{name}' of robot_hardware"
        type_name = part_nh.get_param("type")
        if not isinstance(type_name, str) or not type_name:
            raise ParameterError(
                f"{location}: parameter {join_names(part_nh.namespace, 'type')} is {type_name!r}; "
                "expected the name of a hardware class, package/Class"
            )
        try:
            hardware = self._make(type_name)
            initialised = hardware.init(root_nh, part_nh)
        except PluginError as error:
            raise ParameterError(f"{location}: type '{type_name}': {error}") from error
        except Exception as error:  # a user's hardware may raise anything
            raise ParameterError(f"{location}: type '{type_name}' raised {type(error).__name__}: {error}") from error
        if initialised is not True:
            raise ParameterError(f"{location}: type '{type_name}' did not initialise; see its own message above")
        resources = {interface.type_name: frozenset(interface.names) for interface in hardware.interfaces}
        return HardwarePart(name, hardware, resources)

    def _combine_interfaces(self) -> None:
        offered: dict[type[HardwareInterface[Any]], list[tuple[HardwarePart, HardwareInterface[Any]]]] = {}
        for part in self._parts:
            for interface in part.hardware.interfaces:
                offered.setdefault(type(interface), []).append((part, interface))
        for interface_class, offers in offered.items():
            if len(offers) == 1:
                self.register_interface(offers[0][1])
            else:
                self.register_interface(_combined_interface(interface_class, offers))

    def read(self, time_s: float, period_s: float) -> None:
        for part in self._parts:
            self._cycle(part, "read", part.hardware.read, time_s, period_s)

    def write(self, time_s: float, period_s: float) -> None:
        for part in self._parts:
            self._cycle(part, "write", part.hardware.write, time_s, period_s)

    def _cycle(
        self, part: HardwarePart, step_name: str, step: Callable[[float, float], None], time_s: float, period_s: float
    ) -> None:
        """Reads or writes one part; an exception is a fault of this part until the same step succeeds."""
        try:
            step(time_s, period_s)
        except Exception as error:  # a user's hardware may raise anything; the other parts must continue
            self._raised_errors[part.name, step_name] = f"{step_name}() raised {type(error).__name__}: {error}"
        else:
            if self._raised_errors:
                self._raised_errors.pop((part.name, step_name), None)

    def check_for_conflict(self, controllers: Iterable[ControllerInfo]) -> str:
        infos = list(controllers)
        conflicts = ((part.name, part.hardware.check_for_conflict(part.claims_of(infos))) for part in self._parts)
        within_parts = "; ".join(f"{name}: {conflict}" for name, conflict in conflicts if conflict)
        return within_parts or super().check_for_conflict(self._claims_on_shared_joints(infos))

    def _claims_on_shared_joints(self, controllers: Iterable[ControllerInfo]) -> Iterator[ControllerInfo]:
        """Yields the controllers with their claims on joints that several parts command, which no part checks."""
        commanded = Counter(name for part in self._parts for name in part.hardware.commanded_joints)
        for controller in controllers:
            yield ControllerInfo(
                controller.name,
                controller.type,
                tuple(
                    InterfaceResources(claim.hardware_interface, tuple(n for n in claim.resources if commanded[n] > 1))
                    for claim in controller.claimed_resources
                ),
            )

    def prepare_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> bool:
        for part, claims_of_part in self._parts_with_claims(start, stop):
            if part.hardware.prepare_switch(*claims_of_part) is not True:
                LOGGER.error(
                    "hardware '%s' refused to prepare a switch (start: %s; stop: %s)",
                    part.name,
                    *(", ".join(controller.name for controller in side) or "none" for side in claims_of_part),
                )
                return False
        return True

    def do_switch(self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]) -> None:
        for part, claims_of_part in self._parts_with_claims(start, stop):
            part.hardware.do_switch(*claims_of_part)

    def _parts_with_claims(
        self, start: Sequence[ControllerInfo], stop: Sequence[ControllerInfo]
    ) -> Iterator[tuple[HardwarePart, tuple[list[ControllerInfo], list[ControllerInfo]]]]:
        for part in self._parts:
            claims_of_part = part.claims_of(start), part.claims_of(stop)
            if any(claims_of_part):
                yield part, claims_of_part

    def switch_result(self, controller: ControllerInfo | None = None) -> SwitchState:
        results: set[SwitchState] = set()
        for part in self._parts:
            if controller is None:
                results.add(part.hardware.switch_result())
            else:
                results.update(
                    part.hardware.switch_result(claims_of_part) for claims_of_part in part.claims_of([controller])
                )
        for state in (SwitchState.ERROR, SwitchState.ONGOING):
            if state in results:
                return state
        return SwitchState.DONE


def _combined_interface(
    interface_class: type[HardwareInterface[Any]], offers: Sequence[tuple[HardwarePart, HardwareInterface[Any]]]
) -> HardwareInterface[Any]:
    """Returns one interface with the handles of several parts."""
    handles: dict[str, Any] = {}
    owners: dict[str, str] = {}
    for part, interface in offers:
        for handle in interface.handles:
            if handle.name in owners:
                conflict = (
                    f"{interface_class.type_name}: joint '{handle.name}' is in hardware '{owners[handle.name]}' "
                    f"and in '{part.name}'"
                )
                if interface_class.claims_resources:
                    raise HardwareInterfaceError(f"robot_hardware: {conflict}; only one part may command it")
                LOGGER.warning("%s; the latter is used", conflict)
            owners[handle.name] = part.name
            handles[handle.name] = handle
    combined = interface_class()
    for handle in handles.values():
        combined.register_handle(handle)
    return combined


def robot_hw_of_type(type_name: str, index: PluginIndex | None = None) -> RobotHW:
    """Returns new, uninitialized hardware of a plugin class.

    Raises:
        PluginError: The class is unknown or cannot be loaded.
    """
    hardware: RobotHW = (index or PluginIndex(ROBOT_HW_BASE)).load(type_name, RobotHW)()
    return hardware
