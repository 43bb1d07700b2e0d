# SPDX-License-Identifier: BSD-3-Clause
"""Draws the state machine of a task or of a running smach container with Graphviz."""

from __future__ import annotations

import subprocess
from dataclasses import dataclass

import graphviz

RENDER_TIMEOUT_S = 60.0
_FIRST_COLOUR, _LAST_COLOUR, _OTHER_COLOUR = "#2e7d32", "#c62828", "#455a64"


class GraphError(Exception):
    """The graph cannot be drawn."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StateBox:
    """A state without children.

    Attributes:
        label: Label of the state.
        tooltip: Text shown under the pointer.
    """

    label: str
    tooltip: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Transition:
    """A transition between two states of a machine, or from a state to an outcome of the machine.

    Attributes:
        start: Label of the state.
        outcome: Outcome of the state.
        target: Label of the next state, or outcome of the machine.
    """

    start: str
    outcome: str
    target: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MachineFrame:
    """A machine with its states.

    Attributes:
        label: Label of the machine.
        outcomes: Outcomes, the first for success and the last for failure.
        children: States and nested machines.
        initial: Labels of the initial states.
        transitions: Transitions of a sequential machine, or the outcome map of a concurrent machine.
        is_concurrent: Whether all states run at the same time.
        default_outcome: Outcome of a concurrent machine if no entry of the outcome map applies; None if unknown.
        tooltip: Text shown under the pointer.
    """

    label: str
    outcomes: tuple[str, ...]
    children: tuple[StateBox | MachineFrame, ...]
    initial: tuple[str, ...]
    transitions: tuple[Transition, ...]
    is_concurrent: bool = False
    default_outcome: str | None = None
    tooltip: str = ""

    def child(self, label: str) -> StateBox | MachineFrame | None:
        """Returns the state or nested machine with a label, or None."""
        return next((child for child in self.children if child.label == label), None)


def draw(machine: MachineFrame) -> graphviz.Digraph:
    """Returns the graph of a machine, with nested machines as nested frames.

    State machines have a solid frame, concurrences a dashed frame. Outcomes are ovals; the first outcome is green, the
    last outcome is red. In SVG, the id of a state or frame is its path, such as "task/Machine/State". The id of an
    arrow is the path of the state, a space and the outcome.
    """
    graph = graphviz.Digraph(
        machine.label,
        graph_attr={"compound": "true", "fontname": "sans-serif", "rankdir": "TB"},
        node_attr={"fontname": "sans-serif", "fontsize": "11"},
        edge_attr={"fontname": "sans-serif", "fontsize": "9"},
    )
    _draw_machine(graph, machine, machine.label, is_root=True)
    return graph


def render(source: str, file_format: str) -> bytes:
    """Returns a drawing of a graph.

    Args:
        source: Graph in the language of Graphviz.
        file_format: Output format of Graphviz, such as "svg".

    Raises:
        GraphError: Graphviz is not installed or fails.
    """
    try:
        return subprocess.run(
            ["dot", f"-T{file_format}"],
            input=source.encode(),
            capture_output=True,
            check=True,
            timeout=RENDER_TIMEOUT_S,
        ).stdout
    except FileNotFoundError as error:
        raise GraphError(
            "the program 'dot' is not installed; install Debian's package graphviz, or write a .dot file"
        ) from error
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
        raise GraphError(f"Graphviz failed: {error}") from error


def _draw_machine(graph: graphviz.Digraph, machine: MachineFrame, path: str, *, is_root: bool) -> None:
    style = "dashed,rounded" if machine.is_concurrent else "rounded"
    timing = " (at the same time)" if machine.is_concurrent else ""
    with graph.subgraph(name=f"cluster_{_node(path)}") as frame:
        frame.attr(label=_text(f"{machine.label}{timing}"), style=style, tooltip=_text(machine.tooltip), id=_text(path))
        for index, outcome in enumerate(machine.outcomes):
            is_last = index == len(machine.outcomes) - 1
            colour = _FIRST_COLOUR if index == 0 else _LAST_COLOUR if is_last else _OTHER_COLOUR
            oval = _outcome(path, outcome)
            frame.node(_node(oval), _text(outcome), shape="oval", color=colour, fontcolor=colour, id=_text(oval))
        for child in machine.children:
            _draw_child(frame, child, f"{path}/{child.label}")
        if machine.children and is_root:
            start = _outcome(path, "start")
            frame.node(_node(start), "", shape="point", width="0.15", id=_text(start))
            for label in machine.initial:
                head, attributes = _head(machine, path, label)
                frame.edge(_node(start), _node(head), **attributes)
        for transition in machine.transitions:
            _draw_transition(frame, machine, path, transition)
        if machine.default_outcome is not None and machine.children:
            otherwise = _outcome(path, "else")
            frame.node(_node(otherwise), "otherwise", shape="plaintext", fontsize="9", id=_text(otherwise))
            frame.edge(_node(otherwise), _node(_outcome(path, machine.default_outcome)), style="dashed")


def _draw_child(frame: graphviz.Digraph, child: StateBox | MachineFrame, path: str) -> None:
    if isinstance(child, MachineFrame):
        _draw_machine(frame, child, path, is_root=False)
        return
    frame.node(
        _node(path),
        _text(child.label),
        shape="box",
        style="rounded,filled",
        fillcolor="#eceff1",
        tooltip=_text(child.tooltip),
        id=_text(path),
    )


def _draw_transition(frame: graphviz.Digraph, machine: MachineFrame, path: str, transition: Transition) -> None:
    """Draws a transition. The arrow of a nested machine has no label and starts at the oval of the outcome."""
    start = f"{path}/{transition.start}"
    is_nested = isinstance(machine.child(transition.start), MachineFrame)
    tail = _outcome(start, transition.outcome) if is_nested else start
    head, attributes = _head(machine, path, transition.target)
    frame.edge(
        _node(tail),
        _node(head),
        label="" if is_nested else _text(transition.outcome),
        id=_text(f"{start} {transition.outcome}"),
        style="dashed" if machine.is_concurrent else "solid",
        **attributes,
    )


def _head(machine: MachineFrame, path: str, target: str) -> tuple[str, dict[str, str]]:
    """Returns the node at which an arrow ends, and the arrow's attributes.

    Args:
        machine: Machine of the transition.
        path: Path of the machine.
        target: Label of a state, or outcome of the machine. An arrow to a nested machine ends at its frame.
    """
    child = machine.child(target)
    if child is None:
        return _outcome(path, target), {}
    node = f"{path}/{target}"
    attributes = {"lhead": f"cluster_{_node(node)}"} if isinstance(child, MachineFrame) else {}
    while isinstance(child, MachineFrame):
        node, child = f"{node}/{child.initial[0]}", child.child(child.initial[0])
    return node, attributes


def _node(path: str) -> str:
    """Returns the node name of a path without colons, because Graphviz reads a colon as the start of a port."""
    return path.replace(":", "\N{RATIO}")


def _outcome(path: str, outcome: str) -> str:
    return f"{path}|{outcome}"


def _text(text: str) -> str:
    return str(graphviz.escape(text))
