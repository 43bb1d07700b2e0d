# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of the node, checked: all faults at once."""

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
    """What the node reads.

    Attributes:
        settings: How the description is read.
        source_list: Topics whose joint states are taken over.
        rate: Joint states published in a second [1/s].
        delta: How far all joints move between two of them [rad or m]; 0: not.
        num_rows: Joints below each other in the window; 0: all.
        default_positions, default_velocities, default_efforts: Whether these are published from the start.
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
        ParameterError: Values are not allowed; names all of them.
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
        allowed = "a mapping with parent and, if wanted, factor and offset"
        raise ParameterError(f"parameter '{name}' is {entry!r}; allowed: {allowed}")
    factor, offset = entry.get("factor", 1), entry.get("offset", 0)
    if not (_is_number(factor) and _is_number(offset)):
        raise ParameterError(f"parameter '{name}' is {entry!r}; allowed: numbers as factor and offset")
    return Mimic(entry["parent"], float(factor), float(offset))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
