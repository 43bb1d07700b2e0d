# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of nodes on ROS 1, which are set for the node and, if shared, also in its namespace."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from launch.core.errors import LaunchError
from launch.core.launch_context import LaunchContext
from launch.core.parameter_plan import ParameterPlan
from launch.core.utilities import perform_text

from launch_ros.namespaces import full_name
from launch_ros.parameter_descriptions import Parameter, ParameterFile, evaluate_value, read_yaml_mapping

SECTION = "ros__parameters"
"""Key of the parameters of a node in parameter files of ROS 2."""
DESCRIPTION = "robot_description"
DESCRIPTION_PARTS = ("", "_semantic", "_kinematics", "_planning")
"""Suffixes of the parameters that RViz, robot_state_publisher and MoveIt's clients read in their namespace."""
WILDCARDS = {"*": r"/[^/]+", "**": r"(/[^/]+)*"}
"""Regular expressions of the wildcards in node names: a single namespace, or any number including none."""
CLOCK = "use_sim_time"
"""Parameter of the clock in the root namespace, which is shared by all nodes of a ROS 1 master."""


@dataclass(frozen=True, slots=True)
class ParameterSource:
    """Entry of a node's `parameters`.

    Attributes:
        content: Parameters of the entry.
        path: File of the parameters; None for a dict.
    """

    content: Mapping[str, Any]
    path: Path | None = None

    @property
    def has_sections(self) -> bool:
        """Returns whether the entry is a file for ROS 2 with sections of nodes."""
        return self.path is not None and any(True for _ in sections(self.content))


def evaluate_sources(context: LaunchContext, parameters: Any) -> list[ParameterSource]:
    """Returns the contents of the entries of `parameters`, in order.

    Args:
        context: Launch context.
        parameters: Dicts, paths of YAML files, ParameterFile or Parameter objects.

    Raises:
        LaunchError: An entry has another type, or a file cannot be read.
    """
    if isinstance(parameters, str | Mapping):
        raise LaunchError(f"parameters is {type(parameters).__name__}; allowed: a list of dicts and files, [...]")
    return [_evaluated_source(context, entry) for entry in parameters]


def _evaluated_source(context: LaunchContext, entry: Any) -> ParameterSource:
    if isinstance(entry, Mapping):
        values = {
            perform_text(context, key): evaluate_value(context, value, None, f"parameter {perform_text(context, key)}")
            for key, value in entry.items()
        }
        return ParameterSource(values)
    if isinstance(entry, Parameter):
        name, value = entry.evaluate(context)
        return ParameterSource({name: value})
    path = (entry if isinstance(entry, ParameterFile) else ParameterFile(entry)).path(context)
    return ParameterSource(read_yaml_mapping(path), path)


def sections(content: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Yields the sections of a ROS 2 parameter file: pattern of the node's full name, and parameters.

    Args:
        content: Content of the file.
        prefix: Pattern of the enclosing namespace.
    """
    for key, value in content.items():
        if not isinstance(value, Mapping):
            continue
        pattern = f"{prefix}/{str(key).strip('/')}"
        if isinstance(value.get(SECTION), Mapping):
            yield pattern, value[SECTION]
        yield from sections({name: inner for name, inner in value.items() if name != SECTION}, pattern)


def parameters_of_node(sources: Iterable[ParameterSource], node: str) -> dict[str, Any]:
    """Returns the parameters of a node; later entries override earlier entries, and exact sections override patterns.

    Args:
        sources: Entries of `parameters`.
        node: Full name of the node.
    """
    merged: dict[str, Any] = {}
    for source in sources:
        if not source.has_sections:
            merge(merged, nest_dots(source.content))
            continue
        found = [(pattern, values) for pattern, values in sections(source.content) if _matches(pattern, node)]
        for _, values in sorted(found, key=lambda each: "*" not in each[0]):
            merge(merged, nest_dots(values))
    return merged


def _matches(pattern: str, node: str) -> bool:
    parts = pattern.strip("/").split("/")
    return re.fullmatch("".join(WILDCARDS.get(part, f"/{re.escape(part)}") for part in parts), node) is not None


def nest_dots(content: Mapping[str, Any]) -> dict[str, Any]:
    """Converts names with dots, ROS 2's separator, to nested mappings."""
    nested: dict[str, Any] = {}
    for name, value in content.items():
        parts = str(name).replace("/", ".").strip(".").split(".")
        inner = nest_dots(value) if isinstance(value, Mapping) else value
        for part in reversed(parts[1:]):
            inner = {part: inner}
        merge(nested, {parts[0]: inner})
    return nested


def merge(target: dict[str, Any], values: Mapping[str, Any]) -> None:
    """Adds values to a mapping; nested mappings are merged, other values are replaced."""
    for name, value in values.items():
        if isinstance(value, Mapping) and isinstance(target.get(name), dict):
            merge(target[name], value)
        else:
            target[name] = dict(value) if isinstance(value, Mapping) else value


def description_names(parameters: Mapping[str, Any]) -> set[str]:
    """Returns the names of a node's parameters that other nodes read in its namespace.

    These are `robot_description`, `robot_description_semantic`, `..._kinematics` and `..._planning`. A robot
    description under another name is detected by its text, and its name has the same suffixes.
    """
    bases = {DESCRIPTION}
    for name, value in parameters.items():
        if isinstance(value, str) and "<robot" in value[:4000] and value.lstrip().startswith("<"):
            bases.add(name.removesuffix("_semantic"))
    return {base + part for base in bases for part in DESCRIPTION_PARTS} & set(parameters)


def plan_parameters(plan: ParameterPlan, namespace: str, name: str, parameters: Mapping[str, Any]) -> None:
    """Plans the parameters of a node.

    Args:
        plan: Plan of the parameters.
        namespace: Absolute namespace of the node.
        name: Name of the node in its namespace.
        parameters: Parameters of the node.

    Raises:
        LaunchError: Another node of the namespace has set another robot description or clock.
    """
    node = full_name(namespace, name)
    owner = f"node {node}"
    for key, value in parameters.items():
        if key == CLOCK:
            plan.set(f"/{CLOCK}", value, owner, shared=True)
        else:
            plan.set(full_name(node, key), value, owner)
    for key in sorted(description_names(parameters)):
        plan.set(full_name(namespace, key), parameters[key], owner, shared=True)
