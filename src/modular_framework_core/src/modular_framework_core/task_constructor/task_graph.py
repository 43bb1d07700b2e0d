# SPDX-License-Identifier: BSD-3-Clause
"""Draws the states, transitions and outcomes of a checked task; nested machines are nested frames."""

from __future__ import annotations

from pathlib import Path

import graphviz

from modular_framework_core.task_constructor import machine_graph
from modular_framework_core.task_constructor.machine_graph import GraphError, MachineFrame, StateBox, Transition
from modular_framework_core.task_constructor.task_spec import ChildSpec, MachineSpec, TaskSpec

FORMATS = ("svg", "pdf", "png", "dot")

__all__ = ["FORMATS", "GraphError", "draw", "write"]


def draw(task: TaskSpec) -> graphviz.Digraph:
    """Returns the graph of a task; see `machine_graph.draw`."""
    return machine_graph.draw(_frame(task.root))


def write(task: TaskSpec, file: Path) -> None:
    """Draws a task into a file in the format of the file's suffix.

    Raises:
        GraphError: The suffix is not in ``FORMATS``, or Graphviz is not installed or fails.
    """
    file_format = file.suffix.removeprefix(".").lower()
    if file_format not in FORMATS:
        raise GraphError(
            f"{file}: the format '{file_format}' is unknown; allowed suffixes: "
            + ", ".join(f".{name}" for name in FORMATS)
        )
    source = draw(task).source
    try:
        content = source.encode() if file_format == "dot" else machine_graph.render(source, file_format)
    except GraphError as error:
        raise GraphError(f"{file}: {error}") from error
    try:
        file.write_bytes(content)
    except OSError as error:
        reason = f"{file} cannot be written: {error.strerror}; name a file in an existing folder"
        raise GraphError(reason) from error


def _frame(machine: MachineSpec) -> MachineFrame:
    return MachineFrame(
        label=machine.label,
        outcomes=tuple(machine.outcomes),
        children=tuple(_child(child) for child in machine.states),
        initial=tuple(child.label for child in machine.first_states()) if machine.states else (),
        transitions=tuple(_outcome_map(machine) if machine.template.concurrent else _transitions(machine)),
        is_concurrent=machine.template.concurrent,
        default_outcome=machine.default_outcome if machine.template.concurrent else None,
        tooltip=machine.template.name,
    )


def _child(child: ChildSpec) -> StateBox | MachineFrame:
    if isinstance(child, MachineSpec):
        return _frame(child)
    return StateBox(label=child.label, tooltip=f"{child.source.name}, {child.location}")


def _transitions(machine: MachineSpec) -> list[Transition]:
    transitions = []
    for child in machine.states:
        implicit = {name: name for name in child.outcomes if name in machine.outcomes}
        for outcome, target in {**implicit, **child.transitions}.items():
            transitions.append(Transition(start=child.label, outcome=outcome, target=target))
    return transitions


def _outcome_map(machine: MachineSpec) -> list[Transition]:
    return [
        Transition(start=label, outcome=child_outcome, target=outcome)
        for outcome, conditions in machine.outcome_map.items()
        for label, child_outcome in conditions.items()
    ]
