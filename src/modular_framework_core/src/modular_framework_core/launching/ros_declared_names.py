# SPDX-License-Identifier: BSD-3-Clause
"""Checks the parameters of a launch against what its nodes declare, before anything starts."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from modular_framework_core.files.faults import closest, nearest
from modular_framework_core.launching.ros_launch_preview import LaunchedNode, LaunchPreview, leaves
from modular_framework_ros.parameter_declarations import Declaration, NodeDeclaration, node_declaration

ROSLAUNCH_NAMES = ("/rosdistro", "/rosversion", "/run_id", "/roslaunch")


@dataclass(frozen=True, slots=True)
class LaunchFault:
    """What is wrong with a launch.

    Attributes:
        name: Whole name of a parameter, or name of an argument; empty if it is about neither.
        text: A sentence.
        key: Key of an experiment file that it is about: parameters, arguments or task.
    """

    name: str
    text: str
    key: str = "parameters"


class DeclaredNames:
    """The parameters that the nodes of a launch declare.

    Args:
        launch: The launch.
    """

    def __init__(self, launch: LaunchPreview) -> None:
        self._launch = launch
        self.known: dict[str, list[tuple[LaunchedNode, Declaration]]] = {}
        self._open: list[str] = []
        self._closed: list[str] = []
        for node, declared in self._declarations():
            if declared is None:
                self._open.append(f"{node.name}/")
                continue
            if declared.closed:
                self._closed.append(f"{node.name}/")
            for item in declared.parameters.values():
                self.known.setdefault(_whole_name(item.name, node), []).append((node, item))
        self._trees = [f"{name}/" for name, users in self.known.items() if any(item.tree for _, item in users)]

    def _declarations(self) -> Iterator[tuple[LaunchedNode, NodeDeclaration | None]]:
        """Yields nodes with their declarations, and their hardware, named by its namespace, with that of its class."""
        for node in self._launch.nodes:
            declared = node_declaration(node.package, node.executable)
            yield node, declared
            for name, item in (declared.parameters if declared else {}).items():
                value = self._given(node, name) if item.names == "hardware" else None
                for part in [f"{node.namespace}{entry}" for entry in value] if isinstance(value, list) else [node.name]:
                    package, _, kind = str(self._launch.parameters.get(f"{part}/type", "")).partition("/")
                    found = node_declaration(package, kind) if value and kind else None
                    if found is not None:
                        yield replace(node, name=part), found

    def unread(self, names: Mapping[str, Any], extra: Container[str] = ()) -> Iterator[LaunchFault]:
        """Yields a fault for each name that no node reads.

        Args:
            names: Parameters by whole name.
            extra: Names that something else reads.
        """
        for name in leaves(names):
            if name in extra or name in self.known or name.startswith((*self._trees, *self._open)):
                continue
            text = f"no node of the launch reads the parameter '{name}'{self._meant(name)}"
            yield LaunchFault(name, f"{text}; list it in extra_parameters if a node of your own reads it")

    def misspelt(self, without: Container[str] = ()) -> Iterator[LaunchFault]:
        """Yields a fault for each parameter of the launch, without some, below a node that does not read it."""
        for name in self._launch.parameters:
            is_read = name in self.known or name.startswith(tuple(self._trees))
            if name.startswith(tuple(self._closed)) and not is_read and name not in without:
                node = name.rpartition("/")[0]
                yield LaunchFault(name, f"node '{node}' does not read the parameter '{name}'{self._meant(name)}")

    def wrong_values(self) -> Iterator[LaunchFault]:
        """Yields a fault for each value that a node does not take, and each required parameter that is not set."""
        for name, users in self.known.items():
            if name in ROSLAUNCH_NAMES or any(item.tree for _, item in users):
                continue
            for node, declared in users:
                item = declared.beside(partial(self._given, node))
                value = self._launch.parameters.get(name, item.default)
                if value is None and item.required:
                    yield LaunchFault(name, f"node '{node.name}' needs the parameter '{name}'; {item.doc}")
                elif value is not None and item.fault(value):
                    yield LaunchFault(name, f"parameter '{name}' {item.fault(value)}")
                    break

    def _given(self, node: LaunchedNode, name: str) -> Any:
        """Returns the value of a parameter of a node by its declared name; None if it is not set."""
        return self._launch.parameters.get(_whole_name(name, node))

    def naming(self, kind: str) -> Iterator[tuple[str, str]]:
        """Yields the whole name and the value of each parameter that names something of a kind."""
        for name, users in self.known.items():
            if any(item.names == kind for _, item in users):
                value = self._launch.parameters.get(name, users[0][1].default)
                if isinstance(value, str) and value:
                    yield name, value

    def _meant(self, name: str) -> str:
        """Returns a hint at the parameter that a name stands for: of its own node first, then of any."""
        beside = [known for known in self.known if known.rpartition("/")[0] == name.rpartition("/")[0]]
        if closest(name, beside):
            return nearest(name, beside)
        same = [known for known in self.known if known.rpartition("/")[2] == name.rpartition("/")[2]]
        return f"; did you mean '{same[0]}'?" if same else nearest(name, self.known)


def _whole_name(name: str, node: LaunchedNode) -> str:
    if name.startswith("~"):
        return f"{node.name}/{name[1:]}"
    return name if name.startswith("/") else f"{node.namespace}{name}"
