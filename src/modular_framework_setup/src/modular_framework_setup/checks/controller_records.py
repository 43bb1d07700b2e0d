# SPDX-License-Identifier: BSD-3-Clause
"""Reads the controllers of MoveIt and of the hardware in a config package."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, Sequence, kind_of
from modular_framework_setup.config_files.yaml_files import has_argument, mappings, plain_text, read_truth, texts

Located = tuple[str, SourceLocation]
SIMPLE = "moveit_simple_controller_manager"
MOTION_TYPES = ("JointTrajectoryController", "GripperActionController", "ParallelGripperActionController")


@dataclass(frozen=True, slots=True)
class NamedController:
    """A controller in a file.

    Attributes:
        name: Name of the controller.
        location: Location of the file entry.
        joints: Joint names with their locations.
    """

    name: str
    location: SourceLocation
    joints: tuple[Located, ...]


@dataclass(frozen=True, slots=True)
class MoveItController(NamedController):
    """A controller that receives motions from MoveIt.

    Attributes:
        kind: Type and its location; "" without a type.
        action_ns: Name of the action and its location, or None.
        is_default: Whether MoveIt prefers this controller for its joints.
    """

    kind: Located
    action_ns: Located | None
    is_default: bool


@dataclass(frozen=True, slots=True)
class HardwareController(NamedController):
    """A controller of ros_control or ros2_control.

    Attributes:
        kind: Controller type.
    """

    kind: str

    @property
    def moves(self) -> bool:
        """Whether the controller executes motions."""
        return self.kind.endswith(MOTION_TYPES)


def names_moveit_controllers(top: Mapping) -> bool:
    """Returns whether a file lists MoveIt controllers."""
    return "controller_list" in top.entries or SIMPLE in top.entries


def moveit_controllers(top: Mapping, faults: FaultList) -> list[MoveItController]:
    """Returns the controllers in a file of MoveIt 1 (controller_list) or MoveIt 2 (controller_names)."""
    if "controller_list" in top.entries:
        return list(_of_list(top.entries["controller_list"], faults))
    section = top.entries[SIMPLE]
    return list(_of_names(section, faults)) if isinstance(section, Mapping) else []


def _of_list(node: Node, faults: FaultList) -> Iterator[MoveItController]:
    if not isinstance(node, Sequence):
        faults.add(node.location, f"controller_list is {kind_of(node)}; expected a list with name, joints and type")
        return
    for index, entry in enumerate(node.items):
        if isinstance(entry, Mapping) and "name" in entry.entries:  # "" is a controller in the root namespace
            yield _controller(plain_text(entry.entries["name"]), entry.location, entry, faults)
        else:
            faults.add(entry.location, f"controller_list[{index}] has no name; add it")


def _of_names(section: Mapping, faults: FaultList) -> Iterator[MoveItController]:
    entries = {key: value for key, _, value in mappings(section)}
    listed = texts(section.entries.get("controller_names"))
    for name, where in listed:
        if name in entries:
            yield _controller(name, section.keys[name], entries[name], faults)
        else:
            faults.add_unknown(where, "controller_names: controller", name, entries)
    for name in entries.keys() - {name for name, _ in listed}:
        faults.add_unknown(
            section.keys[name], "controller_names omits this controller:", name, [item for item, _ in listed]
        )


def _controller(name: str, where: SourceLocation, entry: Mapping, faults: FaultList) -> MoveItController:
    joints = tuple(texts(entry.entries.get("joints")))
    if not joints:
        faults.add(where, f"controller '{name}' has no joints; add the list 'joints'")
    kind = entry.entries.get("type")
    action, default = entry.entries.get("action_ns"), entry.entries.get("default")
    return MoveItController(
        name,
        where,
        joints,
        (plain_text(kind), kind.location if kind else where),
        (plain_text(action), action.location) if action else None,
        default is not None and read_truth(default, f"controller '{name}': default", faults) is True,
    )


def hardware_controllers(top: Mapping) -> list[HardwareController]:
    """Returns the controllers in a file of ros_control, or of ros2_control (ros__parameters)."""
    manager = top.entries.get("controller_manager")
    parameters = manager.entries.get("ros__parameters") if isinstance(manager, Mapping) else None
    if isinstance(parameters, Mapping):
        return [
            HardwareController(name, where, _joints(_settings(top, name)), plain_text(entry.entries["type"]))
            for name, where, entry in mappings(parameters)
            if "type" in entry.entries
        ]
    controllers = []
    for name, where, entry in mappings(top):
        if "/" in plain_text(entry.entries.get("type")):
            controllers.append(HardwareController(name, where, _joints(entry), plain_text(entry.entries["type"])))
        else:  # controllers in a robot's namespace
            controllers += [
                HardwareController(key, location, _joints(settings), plain_text(settings.entries["type"]))
                for key, location, settings in mappings(entry)
                if "/" in plain_text(settings.entries.get("type"))
            ]
    return controllers


def _settings(top: Mapping, name: str) -> Mapping | None:
    entry = top.entries.get(name)
    parameters = entry.entries.get("ros__parameters") if isinstance(entry, Mapping) else None
    return parameters if isinstance(parameters, Mapping) else None


def _joints(entry: Mapping | None) -> tuple[Located, ...]:
    if entry is None:
        return ()
    joints = texts(entry.entries.get("joints")) + texts(entry.entries.get("joint"))
    return tuple((name, where) for name, where in joints if not has_argument(name))
