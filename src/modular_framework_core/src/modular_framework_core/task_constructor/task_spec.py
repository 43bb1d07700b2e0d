# SPDX-License-Identifier: BSD-3-Clause
"""What a checked task consists of. Templates are filled from these objects and from nothing else."""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Union

from modular_framework_core.files.faults import Place
from modular_framework_core.files.located_yaml import Node
from modular_framework_core.task_constructor.state_catalogue import StateSource
from modular_framework_core.task_constructor.template_catalogue import TemplateSource


@dataclass(frozen=True, slots=True)
class StateSpec:
    """A state of a task.

    Attributes:
        label: its name in its machine.
        source: the file and class it is made of.
        type: name of the class in the generated module.
        options: keyword arguments of the class, as written in the task (outcomes and userdata keys included).
        outcomes: what it may end with, first = positive, last = negative.
        transitions: outcome -> label or outcome of the machine; empty inside a concurrent machine.
        place: where it is defined.
        remapping: userdata key of the state -> key of the machine it is in; keys not named are called the same.
        nodes: the options as read, with the place of every value.
    """

    label: str
    source: StateSource
    type: str
    options: dict[str, Any]
    outcomes: tuple[str, ...]
    transitions: dict[str, str]
    place: Place
    remapping: dict[str, str] = field(default_factory=dict)
    nodes: dict[str, Node] = field(default_factory=dict, repr=False)


@dataclass(frozen=True, slots=True)
class MachineSpec:
    """A state machine of a task: the root, or one nested in another.

    Attributes:
        label: its name in the machine around it; for the root the name of the task.
        template: the template it is written with.
        type: name of its class in the generated module, unique there.
        outcomes: what it may end with, first = positive, last = negative.
        states: its children, in order.
        transitions: outcome -> label or outcome of the machine around it; empty for the root and in a concurrence.
        shares_userdata: whether it uses the userdata of the machine around it.
        default_outcome: outcome of a concurrent machine when no entry of the outcome map is met; else None.
        outcome_map: for a concurrent machine, outcome -> {label: outcome of that child}.
        input_keys: userdata keys copied from the machine around it.
        output_keys: userdata keys copied to the machine around it.
        initial_state: label of the state it begins with; "" for the first one.
        remapping: userdata key of the machine -> key of the machine around it; keys not named are called the same.
        options: further header keys, for templates that use them.
        place: where it is defined.
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
    place: Place
    is_machine: bool = field(default=True, init=False)

    def first_states(self) -> tuple[ChildSpec, ...]:
        """Return the children it begins with: one, or all of a concurrent machine."""
        if self.template.concurrent:
            return self.states
        return tuple(child for child in self.states if child.label == self.initial_state) or self.states[:1]

    def machines(self) -> Iterator[MachineSpec]:
        """Yield the machines nested in this one, innermost first, and this one last."""
        for child in self.states:
            if isinstance(child, MachineSpec):
                yield from child.machines()
        yield self

    def leaf_states(self) -> Iterator[StateSpec]:
        """Yield the states of this machine and of all machines nested in it, in order."""
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
        name: name of the task and of the generated file, without ``.py``.
        node_name: name of the ROS node that runs it on its own.
        script: path of the YAML file it was read from.
        root: the outermost machine.
    """

    name: str
    node_name: str
    script: str
    root: MachineSpec
