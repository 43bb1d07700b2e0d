# SPDX-License-Identifier: BSD-3-Clause
"""Specification of a checked task. Templates are rendered from these objects alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Union

from modular_framework_core.files.faults import SourceLocation
from modular_framework_core.files.located_yaml import Node
from modular_framework_core.task_constructor.state_catalogue import StateSource
from modular_framework_core.task_constructor.template_catalogue import TemplateSource


@dataclass(frozen=True, slots=True, kw_only=True)
class StateSpec:
    """A state of a task.

    Attributes:
        label: Name in the enclosing machine.
        source: File and class of the state.
        type: Class name in the generated module.
        options: Keyword arguments of the class, including outcomes and userdata keys, as written in the task.
        outcomes: Possible outcomes; the first is positive, the last negative.
        transitions: Outcome -> label or outcome of the enclosing machine; empty inside a concurrence.
        location: Position of the definition.
        remapping: Userdata key of the state -> key of the enclosing machine. Other keys keep their names.
        nodes: YAML nodes of the options, with the location of every value.
    """

    label: str
    source: StateSource
    type: str
    options: dict[str, Any]
    outcomes: tuple[str, ...]
    transitions: dict[str, str]
    location: SourceLocation
    remapping: dict[str, str] = field(default_factory=dict)
    nodes: dict[str, Node] = field(default_factory=dict, repr=False)


@dataclass(frozen=True, slots=True)
class MachineSpec:
    """A state machine of a task: the root machine or a nested machine.

    Attributes:
        label: Name in the enclosing machine; the task name for the root.
        template: Template that generates the machine.
        type: Class name, unique in the generated module.
        outcomes: Possible outcomes; the first is positive, the last negative.
        states: Child states and machines, in order.
        transitions: Outcome -> label or outcome of the enclosing machine; empty for the root and in a concurrence.
        shares_userdata: Whether the machine uses the enclosing machine's userdata.
        default_outcome: Outcome of a concurrence if no entry of the outcome map matches; None for other machines.
        outcome_map: For a concurrence, outcome -> {child label: child outcome}.
        input_keys: Userdata keys copied from the enclosing machine.
        output_keys: Userdata keys copied to the enclosing machine.
        initial_state: Label of the initial state; "" for the first child.
        remapping: Userdata key of the machine -> key of the enclosing machine. Other keys keep their names.
        options: Header keys that only the template uses.
        location: Position of the definition.
    """

    label: str
    template: TemplateSource
    type: str
    outcomes: tuple[str, ...]
    states: tuple[ChildSpec, ...]
    transitions: dict[str, str]
    shares_userdata: bool
    default_outcome: str | None
    outcome_map: dict[str, dict[str, str]]
    input_keys: tuple[str, ...]
    output_keys: tuple[str, ...]
    initial_state: str
    remapping: dict[str, str]
    options: dict[str, Any]
    location: SourceLocation
    is_machine: bool = field(default=True, init=False)

    def first_states(self) -> tuple[ChildSpec, ...]:
        """Returns the initial state in a tuple, or all children of a concurrence."""
        if self.template.concurrent:
            return self.states
        return tuple(child for child in self.states if child.label == self.initial_state) or self.states[:1]

    def machines(self) -> Iterator[MachineSpec]:
        """Yields the nested machines, innermost first, and then this machine."""
        for child in self.states:
            if isinstance(child, MachineSpec):
                yield from child.machines()
        yield self

    def leaf_states(self) -> Iterator[StateSpec]:
        """Yields the states of this machine and of all nested machines, in order."""
        for child in self.states:
            if isinstance(child, MachineSpec):
                yield from child.leaf_states()
            else:
                yield child

    def state_locations(self) -> Iterator[tuple[str, SourceLocation]]:
        """Yields the path of each state and nested machine, relative to this machine, and its position in the task."""
        for child in self.states:
            yield child.label, child.location
            if isinstance(child, MachineSpec):
                yield from ((f"{child.label}/{path}", location) for path, location in child.state_locations())


ChildSpec = Union[StateSpec, MachineSpec]  # noqa: UP007 - the class above refers to it by name


@dataclass(frozen=True, slots=True)
class TaskSpec:
    """A checked task.

    Attributes:
        name: Name of the task and of the generated file, without ``.py``.
        node_name: Name of the ROS node if the generated file is run directly.
        script: Path of the YAML file.
        root: Outermost machine.
        external_names: Names that other nodes add, by kind.
    """

    name: str
    node_name: str
    script: str
    root: MachineSpec
    external_names: Mapping[str, frozenset[str]] = field(default_factory=dict)
