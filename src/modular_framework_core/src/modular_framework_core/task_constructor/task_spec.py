# SPDX-License-Identifier: BSD-3-Clause
"""The parts of a checked task. Templates are filled from these objects and from nothing else."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Union

from modular_framework_core.files.faults import SourceLocation
from modular_framework_core.files.located_yaml import Node
from modular_framework_core.task_constructor.state_catalogue import StateSource
from modular_framework_core.task_constructor.template_catalogue import TemplateSource


@dataclass(frozen=True, slots=True)
class StateSpec:
    """A state of a task.

    Attributes:
        label: Its name in its machine.
        source: The file and class it is made of.
        type: Name of the class in the generated module.
        options: Keyword arguments of the class, as written in the task (outcomes and userdata keys included).
        outcomes: What it may end with, first = positive, last = negative.
        transitions: Outcome -> label or outcome of the machine; empty inside a concurrent machine.
        location: Where it is defined.
        remapping: Userdata key of the state -> key of the machine it is in; keys not named are called the same.
        nodes: The options as read, with the location of every value.
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
    """A state machine of a task: the root, or one nested in another.

    Attributes:
        label: Its name in the machine around it; for the root the name of the task.
        template: The template it is written with.
        type: Name of its class in the generated module, unique there.
        outcomes: What it may end with, first = positive, last = negative.
        states: Its children, in order.
        transitions: Outcome -> label or outcome of the machine around it; empty for the root and in a concurrence.
        shares_userdata: Whether it uses the userdata of the machine around it.
        default_outcome: Outcome of a concurrent machine when no entry of the outcome map is met; else None.
        outcome_map: For a concurrent machine, outcome -> {label: outcome of that child}.
        input_keys: Userdata keys copied from the machine around it.
        output_keys: Userdata keys copied to the machine around it.
        initial_state: Label of the state it begins with; "" for the first one.
        remapping: Userdata key of the machine -> key of the machine around it; keys not named are called the same.
        options: Further header keys, for templates that use them.
        location: Where it is defined.
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
        """Returns the children it begins with: one, or all of a concurrent machine."""
        if self.template.concurrent:
            return self.states
        return tuple(child for child in self.states if child.label == self.initial_state) or self.states[:1]

    def machines(self) -> Iterator[MachineSpec]:
        """Yields the machines nested in this one, innermost first, and this one last."""
        for child in self.states:
            if isinstance(child, MachineSpec):
                yield from child.machines()
        yield self

    def leaf_states(self) -> Iterator[StateSpec]:
        """Yields the states of this machine and of all machines nested in it, in order."""
        for child in self.states:
            if isinstance(child, MachineSpec):
                yield from child.leaf_states()
            else:
                yield child


ChildSpec = Union[StateSpec, MachineSpec]  # noqa: UP007 - the class above refers to it by name


@dataclass(frozen=True, slots=True)
class TaskSpec:
    """A whole task.

    Attributes:
        name: Name of the task and of the generated file, without ``.py``.
        node_name: Name of the ROS node that runs it on its own.
        script: Path of the YAML file it was read from.
        root: The outermost machine.
    """

    name: str
    node_name: str
    script: str
    root: MachineSpec
