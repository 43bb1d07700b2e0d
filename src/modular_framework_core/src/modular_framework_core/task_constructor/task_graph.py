# SPDX-License-Identifier: BSD-3-Clause
"""Draws the states, transitions and outcomes of a checked task with Graphviz; nested machines are nested frames."""

from __future__ import annotations

import subprocess
from pathlib import Path

import graphviz

from modular_framework_core.task_constructor.task_spec import ChildSpec, MachineSpec, TaskSpec

FORMATS = ("svg", "pdf", "png", "dot")
RENDER_TIMEOUT_S = 60.0
_FIRST_COLOUR, _LAST_COLOUR, _OTHER_COLOUR = "#2e7d32", "#c62828", "#455a64"


class GraphError(Exception):
    """The task cannot be drawn."""


def draw(task: TaskSpec) -> graphviz.Digraph:
    """Returns the graph of a task.

    State machines have a solid frame, concurrences a dashed frame. Outcomes are ovals; the first outcome is green, the
    last red.
    """
    graph = graphviz.Digraph(
        task.name,
        graph_attr={"compound": "true", "fontname": "sans-serif", "rankdir": "TB"},
        node_attr={"fontname": "sans-serif", "fontsize": "11"},
        edge_attr={"fontname": "sans-serif", "fontsize": "9"},
    )
    _machine(graph, task.root, task.root.label, None)
    return graph


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
    if file_format != "dot":
        try:
            result = subprocess.run(
                ["dot", f"-T{file_format}"],
                input=source.encode(),
                capture_output=True,
                check=True,
                timeout=RENDER_TIMEOUT_S,
            )
        except FileNotFoundError as error:
            raise GraphError(
                f"{file}: the program 'dot' is not installed; install Debian's package graphviz, or write a .dot file"
            ) from error
        except (subprocess.CalledProcessError, subprocess.TimeoutExpired) as error:
            raise GraphError(f"{file}: Graphviz failed: {error}") from error
        content = result.stdout
    else:
        content = source.encode()
    try:
        file.write_bytes(content)
    except OSError as error:
        reason = f"{file} cannot be written: {error.strerror}; name a file in an existing folder"
        raise GraphError(reason) from error


def _machine(graph: graphviz.Digraph, machine: MachineSpec, path: str, parent: str | None) -> None:
    style = "dashed,rounded" if machine.template.concurrent else "rounded"
    timing = " (at the same time)" if machine.template.concurrent else ""
    with graph.subgraph(name=f"cluster_{path}") as frame:
        frame.attr(label=_text(f"{machine.label}{timing}"), style=style, tooltip=machine.template.name)
        for index, outcome in enumerate(machine.outcomes):
            is_last = index == len(machine.outcomes) - 1
            colour = _FIRST_COLOUR if index == 0 else _LAST_COLOUR if is_last else _OTHER_COLOUR
            frame.node(_outcome(path, outcome), _text(outcome), shape="oval", color=colour, fontcolor=colour)
        if machine.states and parent is None:
            frame.node(f"{path}|start", "", shape="point", width="0.15")
        for child in machine.states:
            child_path = f"{path}/{child.label}"
            if isinstance(child, MachineSpec):
                _machine(frame, child, child_path, path)
            else:
                frame.node(
                    child_path,
                    _text(child.label),
                    shape="box",
                    style="rounded,filled",
                    fillcolor="#eceff1",
                    tooltip=f"{child.source.name}, {child.location}",
                )
        if parent is None:
            for child in machine.first_states():
                _edge(frame, f"{path}|start", "", child, f"{path}/{child.label}")
        if machine.template.concurrent:
            _concurrent_edges(frame, machine, path)
        else:
            _sequential_edges(frame, machine, path)


def _sequential_edges(graph: graphviz.Digraph, machine: MachineSpec, path: str) -> None:
    by_label = {child.label: child for child in machine.states}
    for child in machine.states:
        implicit = {name: name for name in child.outcomes if name in machine.outcomes}
        for outcome, target in {**implicit, **child.transitions}.items():
            start, label = _edge_source(child, f"{path}/{child.label}", outcome)
            if target in by_label:
                _edge(graph, start, label, by_label[target], f"{path}/{target}")
            else:
                graph.edge(start, _outcome(path, target), label=_text(label))


def _concurrent_edges(graph: graphviz.Digraph, machine: MachineSpec, path: str) -> None:
    by_label = {child.label: child for child in machine.states}
    for outcome, conditions in machine.outcome_map.items():
        for label, child_outcome in conditions.items():
            start, text = _edge_source(by_label[label], f"{path}/{label}", child_outcome)
            graph.edge(start, _outcome(path, outcome), label=_text(text), style="dashed")
    if machine.default_outcome is not None and machine.states:
        graph.node(f"{path}|else", "otherwise", shape="plaintext", fontsize="9")
        graph.edge(f"{path}|else", _outcome(path, machine.default_outcome), style="dashed")


def _edge_source(child: ChildSpec, path: str, outcome: str) -> tuple[str, str]:
    """Returns the graph node where the edge of a child's outcome starts, and the edge label."""
    return (_outcome(path, outcome), "") if isinstance(child, MachineSpec) else (path, outcome)


def _edge(graph: graphviz.Digraph, start: str, label: str, target: ChildSpec, path: str) -> None:
    """Draws an edge to a child. An edge to a machine ends at the machine's frame."""
    first, frame = path, {"lhead": f"cluster_{path}"} if isinstance(target, MachineSpec) else {}
    while isinstance(target, MachineSpec):
        target = target.first_states()[0]
        first = f"{first}/{target.label}"
    graph.edge(start, first, label=_text(label), **frame)


def _outcome(path: str, outcome: str) -> str:
    return f"{path}|{outcome}"


def _text(text: str) -> str:
    return str(graphviz.escape(text))
