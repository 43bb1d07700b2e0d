# SPDX-License-Identifier: BSD-3-Clause
"""Checks the parameters of a launch against the declarations of its nodes, before anything starts."""

from __future__ import annotations

from collections.abc import Collection, Container, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from modular_framework_core.launching.ros_launch_preview import LaunchedNode, LaunchPreview, leaves
from modular_framework_ros.allowed_names import closest, misspelling, nearest
from modular_framework_ros.declared_trees import tree_fault
from modular_framework_ros.parameter_declarations import (
    Declaration,
    NodeDeclaration,
    existing_declaration,
    node_declaration,
)

ROSLAUNCH_NAMES = ("/rosdistro", "/rosversion", "/run_id", "/roslaunch")
HARDWARE_PACKAGE_AND_NODE = ("modular_framework_control", "hardware")
"""Declaration of the common parameters of all hardware."""
MAX_NAME_PARTS = 10
"""Maximum number of parts of a declared name."""


@dataclass(frozen=True, slots=True)
class LaunchFault:
    """A fault in a launch.

    Attributes:
        name: Resolved name of the parameter, or name of the argument; "" for neither.
        text: Description of the fault.
        key: Key of the experiment file with the fault: parameters, arguments or task.
    """

    name: str
    text: str
    key: str = "parameters"


class DeclaredNames:
    """Parameters declared by the nodes of a launch.

    Args:
        launch: Nodes and parameters of the launch.

    Attributes:
        known: Nodes and declarations of each declared parameter, by resolved name.
        undeclared: Nodes without a declaration, which may read any parameter.
    """

    def __init__(self, launch: LaunchPreview) -> None:
        self._launch = launch
        self.known: dict[str, list[tuple[LaunchedNode, Declaration]]] = {}
        self.undeclared: list[LaunchedNode] = []
        self._closed_nodes: list[str] = []
        self._open_nodes: list[str] = []
        for node, declared in self._declarations():
            if declared is None:
                self.undeclared.append(node)
                continue
            (self._closed_nodes if declared.closed else self._open_nodes).append(f"{node.name}/")
            for item in declared.parameters.values():
                self.known.setdefault(_resolved_name(item.name, node), []).append((node, item))
        self._undeclared_nodes = [f"{node.name}/" for node in self.undeclared]
        self._trees = [f"{name}/" for name, users in self.known.items() if any(item.tree for _, item in users)]

    def _declarations(self) -> Iterator[tuple[LaunchedNode, NodeDeclaration | None]]:
        """Yields each node with its declaration, and each hardware namespace with the declaration of its class."""
        for node in self._launch.nodes:
            declared = node_declaration(node.package, node.executable)
            yield node, declared
            yield from self._hardware_declarations(node, declared) if declared else ()

    def _hardware_declarations(
        self, node: LaunchedNode, declared: NodeDeclaration
    ) -> Iterator[tuple[LaunchedNode, NodeDeclaration]]:
        """Yields the hardware of a node; hardware without a declaration may read any parameter."""
        types = {part: self._launch.parameters.get(f"{part}/type", "") for part in self._hardware_of(node, declared)}
        default = [item.default for item in declared.parameters.values() if item.names == "hardware" and item.default]
        for part, kind in (types or dict.fromkeys([node.name], *default) if default else types).items():
            package, _, name = str(kind).partition("/")
            declaration = node_declaration(package, name) if name else None
            yield (
                replace(node, name=part),
                declaration or replace(existing_declaration(*HARDWARE_PACKAGE_AND_NODE), closed=False),
            )

    def _hardware_of(self, node: LaunchedNode, declared: NodeDeclaration | None) -> Iterator[str]:
        """Yields the namespace of each hardware of a node."""
        for name, item in (declared.parameters if declared else {}).items():
            value = self._parameter_value(node, name) if item.names == "hardware" else None
            if value:
                yield from [f"{node.namespace}{part}" for part in value] if isinstance(value, list) else [node.name]

    def hardware(self) -> Iterator[str]:
        """Yields the namespace of each hardware of the launch; the parameter `type` in this namespace is the class."""
        for node in self._launch.nodes:
            yield from self._hardware_of(node, node_declaration(node.package, node.executable))

    def unread(self, names: Mapping[str, Any], extra: Container[str] = ()) -> Iterator[LaunchFault]:
        """Yields a fault for each parameter that no node reads.

        Args:
            names: Parameters by resolved name.
            extra: Names that other programs read.
        """
        for name in leaves(names):
            if name in extra or name in self.known or name.startswith((*self._trees, *self._undeclared_nodes)):
                continue
            text = f"no node of the launch reads the parameter '{name}'{self._hint(name)}"
            yield LaunchFault(name, f"{text}; list it in extra_parameters if a node of your own reads it")

    def below_trees(self, parameters: Mapping[str, Any], robot: Mapping[str, Collection[str]]) -> Iterator[LaunchFault]:
        """Yields a fault for each parameter in a tree with an unknown name or an invalid value.

        Args:
            parameters: Parameters by resolved name.
            robot: Names of the robot by kind: joint, link, group. Names of an absent kind are not checked.
        """
        for tree, users in self.known.items():
            below = next((item.below for _, item in users if item.below), "")
            for name, value in leaves(parameters).items() if below else ():
                if name.startswith(f"{tree}/"):
                    fault = tree_fault(
                        name.removeprefix(f"{tree}/"), value, existing_declaration(*below.split("/")), robot
                    )
                    if fault:
                        yield LaunchFault(name, f"parameter '{name}' {fault}")

    def misspelt(self, without: Container[str] = ()) -> Iterator[LaunchFault]:
        """Yields a fault for each misspelt parameter, except for names in ``without``.

        A private parameter of a closed node is misspelt if the node does not read it. Other names may belong to plugins
        and foreign programs. They are misspelt if they differ slightly from a declared name of the same namespace, or
        if their first part differs slightly from the name of a node; a misspelt node is reported once.
        """
        misspelt_nodes: dict[str, str] = {}
        namespaces = sorted({node.namespace for node in self._launch.nodes}, key=len, reverse=True)
        for name in self._launch.parameters:
            if name in without or name in self.known or name.startswith((*self._trees, *self._undeclared_nodes)):
                continue
            open_node = next((node for node in self._open_nodes if name.startswith(node)), "")
            if not open_node and name.startswith(tuple(self._closed_nodes)):
                node = name.rpartition("/")[0]
                yield LaunchFault(name, f"node '{node}' does not read the parameter '{name}'{self._hint(name)}")
                continue
            parent = open_node or next((namespace for namespace in namespaces if name.startswith(namespace)), "/")
            meant = self._meant(name, parent, max_parts=MAX_NAME_PARTS if open_node else 1)
            first = name.split("/")[1]
            if not meant and first not in misspelt_nodes:
                misspelt_nodes[first] = meant = self._meant_node(name)
            if meant:
                yield LaunchFault(name, f"no node reads the parameter '{name}'; did you mean '{meant}'?")

    def _meant_node(self, name: str) -> str:
        """Returns a parameter's name with the misspelt node name corrected, or ""."""
        first, _, rest = name.removeprefix("/").partition("/")
        nodes = {node.name.split("/")[1] for node in self._launch.nodes}
        meant = next((node for node in sorted(nodes) if rest and first not in nodes and misspelling(first, node)), "")
        return f"/{meant}/{rest}" if meant else ""

    def _meant(self, name: str, parent: str, max_parts: int) -> str:
        """Returns the declared name that differs from a name slightly and in one part only, or "".

        Args:
            name: Resolved name.
            parent: Node or namespace that contains the declared name, with a slash at the end.
            max_parts: Maximum number of parts of the declared name below the parent.
        """
        parts = name.removeprefix(parent).split("/")
        for known in (*self.known, *self._trees):
            declared = known.removeprefix(parent).rstrip("/").split("/")
            remaining_parts = parts[len(declared) :]
            is_comparable = len(declared) <= min(len(parts), max_parts) and (not remaining_parts or known.endswith("/"))
            if not known.startswith(parent) or not is_comparable:
                continue
            differing = [(part, other) for part, other in zip(parts, declared, strict=False) if part != other]
            if len(differing) == 1 and misspelling(*differing[0]):
                return parent + "/".join([*declared, *remaining_parts])
        return ""

    def wrong_values(self) -> Iterator[LaunchFault]:
        """Yields a fault for each value that a node does not accept and each missing required parameter."""
        for name, users in self.known.items():
            if name in ROSLAUNCH_NAMES or any(item.tree for _, item in users):
                continue
            for node, declared in users:
                item = declared.apply_required_with(partial(self._parameter_value, node))
                value = self._launch.parameters.get(name, item.default)
                if value is None and item.required:
                    yield LaunchFault(name, f"node '{node.name}' needs the parameter '{name}'; {item.doc}")
                elif value is not None and item.fault(value):
                    yield LaunchFault(name, f"parameter '{name}' {item.fault(value)}")
                    break

    def _parameter_value(self, node: LaunchedNode, name: str) -> Any:
        """Returns the value of a node's parameter by declared name, or None if not set."""
        return self._launch.parameters.get(_resolved_name(name, node))

    def effective_values(self) -> dict[str, Any]:
        """Returns the launch's parameters and the declared defaults; integers of type float are converted to float."""
        values = dict(self._launch.parameters)
        for name, users in self.known.items():
            item = users[0][1]
            value = values.get(name, item.default)
            if value is not None and not item.tree:
                is_whole = isinstance(value, int) and not isinstance(value, bool)
                values[name] = float(value) if item.type == "float" and is_whole else value
        return values

    def without_effect(self) -> list[str]:
        """Returns the resolved names of the parameters that change nothing in any node."""
        return [name for name, users in self.known.items() if not any(item.effect for _, item in users)]

    def naming(self, kind: str) -> Iterator[tuple[str, str]]:
        """Yields resolved name and value of each parameter that is a name of the given kind, or a list of names."""
        for name, users in self.known.items():
            if any(item.names == kind for _, item in users):
                value = self._launch.parameters.get(name, users[0][1].default)
                for item in value if isinstance(value, list) else [value]:
                    if isinstance(item, str) and item:
                        yield name, item

    def _hint(self, name: str) -> str:
        """Returns a hint with the most similar declared parameter, first of the same node, then of all nodes."""
        siblings = [known for known in self.known if known.rpartition("/")[0] == name.rpartition("/")[0]]
        if closest(name, siblings):
            return nearest(name, siblings)
        namesakes = [known for known in self.known if known.rpartition("/")[2] == name.rpartition("/")[2]]
        return f"; did you mean '{namesakes[0]}'?" if namesakes else nearest(name, self.known)


def _resolved_name(name: str, node: LaunchedNode) -> str:
    if name.startswith("~"):
        return f"{node.name}/{name[1:]}"
    return name if name.startswith("/") else f"{node.namespace}{name}"
