# SPDX-License-Identifier: BSD-3-Clause
"""The controllers that a config package names: those MoveIt sends goals to, and those of the hardware."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from modular_framework_core.files.faults import FaultList, SourceLocation
from modular_framework_core.files.located_yaml import Mapping, Node, Sequence, kind_of
from modular_framework_setup.config_files.yaml_files import is_open, mappings, plain_text, read_truth, texts

Located = tuple[str, SourceLocation]
SIMPLE = "moveit_simple_controller_manager"
MOTION_TYPES = ("JointTrajectoryController", "GripperActionController", "ParallelGripperActionController")


@dataclass(frozen=True, slots=True)
class NamedController:
    """A controller that a file names.

    Attributes:
        location: of its entry in the file.
        joints: it moves, each where the file names it.
    """

    name: str
    location: SourceLocation
    joints: tuple[Located, ...]


@dataclass(frozen=True, slots=True)
class MoveItController(NamedController):
    """A controller that motions are sent to.

    Attributes:
        kind: its type; empty when none is given.
        action_ns: name of its action; None when none is given.
        is_default: whether MoveIt prefers it to others of the same joints.
    """

    kind: Located
    action_ns: Located | None
    is_default: bool


@dataclass(frozen=True, slots=True)
class HardwareController(NamedController):
    """A controller of ros_control or ros2_control; `kind` is its type."""

    kind: str

    @property
    def moves(self) -> bool:
        """Whether it executes motions."""
        return self.kind.endswith(MOTION_TYPES)


def names_moveit_controllers(top: Mapping) -> bool:
    """Whether a file lists controllers for MoveIt."""
    return "controller_list" in top.entries or SIMPLE in top.entries


def moveit_controllers(top: Mapping, faults: FaultList) -> list[MoveItController]:
    """Returns the controllers of a file of MoveIt 1 (controller_list) or MoveIt 2 (controller_names)."""
    if "controller_list" in top.entries:
        return list(_of_list(top.entries["controller_list"], faults))
    section = top.entries[SIMPLE]
    return list(_of_names(section, faults)) if isinstance(section, Mapping) else []


def _of_list(node: Node, faults: FaultList) -> Iterator[MoveItController]:
    if not isinstance(node, Sequence):
        faults.add(node.location, f"controller_list is {kind_of(node)}; expected a list with name, joints and type")
        return
    for number, entry in enumerate(node.items):
        if isinstance(entry, Mapping) and "name" in entry.entries:  # "" stands for a controller of the root namespace
            yield _controller(plain_text(entry.entries["name"]), entry.location, entry, faults)
        else:
            faults.add(entry.location, f"controller_list[{number}] has no name; add it")


def _of_names(section: Mapping, faults: FaultList) -> Iterator[MoveItController]:
    found = {key: value for key, _, value in mappings(section)}
    named = texts(section.entries.get("controller_names"))
    for name, where in named:
        if name in found:
            yield _controller(name, section.keys[name], found[name], faults)
        else:
            faults.add_unknown(where, "controller_names: controller", name, found)
    for name in found.keys() - {name for name, _ in named}:
        faults.add_unknown(
            section.keys[name], "controller_names leaves out this controller:", name, [item for item, _ in named]
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
    """Returns the controllers of a file of ros_control, or of ros2_control (ros__parameters)."""
    manager = top.entries.get("controller_manager")
    parameters = manager.entries.get("ros__parameters") if isinstance(manager, Mapping) else None
    if isinstance(parameters, Mapping):
        return [
            HardwareController(name, where, _joints(_settings(top, name)), plain_text(entry.entries["type"]))
            for name, where, entry in mappings(parameters)
            if "type" in entry.entries
        ]
    found = []
    for name, where, entry in mappings(top):
        if "/" in plain_text(entry.entries.get("type")):
            found.append(HardwareController(name, where, _joints(entry), plain_text(entry.entries["type"])))
        else:  # controllers in the namespace of a robot
            found += [
                HardwareController(inner, at, _joints(below), plain_text(below.entries["type"]))
                for inner, at, below in mappings(entry)
                if "/" in plain_text(below.entries.get("type"))
            ]
    return found


def _settings(top: Mapping, name: str) -> Mapping | None:
    entry = top.entries.get(name)
    below = entry.entries.get("ros__parameters") if isinstance(entry, Mapping) else None
    return below if isinstance(below, Mapping) else None


def _joints(entry: Mapping | None) -> tuple[Located, ...]:
    if entry is None:
        return ()
    found = texts(entry.entries.get("joints")) + texts(entry.entries.get("joint"))
    return tuple((name, where) for name, where in found if not is_open(name))
