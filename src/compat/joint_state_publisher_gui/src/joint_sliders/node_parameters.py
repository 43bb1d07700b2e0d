# SPDX-License-Identifier: BSD-3-Clause
"""Reads and checks the parameters of the node; an error lists all faults."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from joint_sliders.slider_joints import SliderSettings
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.parameter_declarations import ParameterReader
from modular_framework_urdf.mimics import Mimic


@dataclass(frozen=True, slots=True)
class NodeParameters:
    """Parameters of the node.

    Attributes:
        settings: Settings for reading the robot description.
        source_list: Topics whose joint states the node adopts.
        rate: Publishing rate [1/s].
        delta: Step of all joints per message [rad or m]; 0 for no motion.
        num_rows: Joints per column of the window; 0 for a single column.
        default_positions: Whether positions are published from the start.
        default_velocities: Whether velocities are published from the start.
        default_efforts: Whether efforts are published from the start.
    """

    settings: SliderSettings
    source_list: tuple[str, ...]
    rate: float
    delta: float
    num_rows: int
    default_positions: bool
    default_velocities: bool
    default_efforts: bool


def read_parameters(read: ParameterReader) -> NodeParameters:
    """Returns the node's parameters.

    Raises:
        ParameterError: A value is invalid; the message lists all invalid values.
    """
    mimic_tags, smallest_limits, zeros, dependent, sources, *others = read.values(
        "~use_mimic_tags",
        "~use_smallest_joint_limits",
        "~zeros",
        "~dependent_joints",
        "~source_list",
        "~rate",
        "~delta",
        "~num_rows",
        "~publish_default_positions",
        "~publish_default_velocities",
        "~publish_default_efforts",
    )
    zeros = {str(name): float(value) for name, value in zeros.items()}
    joints = {str(name): _mimic(f"dependent_joints/{name}", entry) for name, entry in dependent.items()}
    return NodeParameters(SliderSettings(mimic_tags, smallest_limits, zeros, joints), tuple(sources), *others)


def _mimic(name: str, entry: Mapping[str, Any]) -> Mimic:
    if entry.keys() - {"parent", "factor", "offset"} or not isinstance(entry.get("parent"), str):
        allowed = "a mapping with parent and, optionally, factor and offset"
        raise ParameterError(f"parameter '{name}' is {entry!r}; allowed: {allowed}")
    factor, offset = entry.get("factor", 1), entry.get("offset", 0)
    if not (_is_number(factor) and _is_number(offset)):
        raise ParameterError(f"parameter '{name}' is {entry!r}; allowed: numbers as factor and offset")
    return Mimic(entry["parent"], float(factor), float(offset))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
