# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of the node, checked: all faults at once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from joint_sliders.slider_joints import SliderSettings
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


class ParameterFaults(Exception):
    """Parameters are wrong; the text has a line for each."""


class _Reader:
    """Reads parameters and collects what is wrong with them."""

    def __init__(self, get: Callable[[str, Any], Any]) -> None:
        self._get = get
        self.faults: list[str] = []

    def fault(self, name: str, value: object, allowed: str) -> None:
        self.faults.append(f"parameter {name} is {value!r}; allowed: {allowed}; correct it in the launch file")

    def switch(self, name: str, default: bool) -> bool:
        value = self._get(name, default)
        if not isinstance(value, bool):
            self.fault(name, value, "true, false")
        return bool(value)

    def number(self, name: str, default: float, allowed: str, accept: Callable[[float], bool]) -> float:
        value = self._get(name, default)
        if _is_number(value) and accept(value):
            return float(value)
        self.fault(name, value, allowed)
        return default

    def zeros(self) -> dict[str, float]:
        given = self._get("zeros", {})
        if isinstance(given, dict) and all(map(_is_number, given.values())):
            return {str(name): float(value) for name, value in given.items()}
        self.fault("zeros", given, "a number for each joint that is named")
        return {}

    def dependent_joints(self) -> dict[str, Mimic]:
        given = self._get("dependent_joints", {})
        if not isinstance(given, dict):
            self.fault("dependent_joints", given, "a mapping with parent for each joint that is named")
            return {}
        result = {}
        for name, entry in given.items():
            known = isinstance(entry, dict) and not entry.keys() - {"parent", "factor", "offset"}
            if not known or not isinstance(entry.get("parent"), str):
                self.fault(f"dependent_joints/{name}", entry, "a mapping with parent and, if wanted, factor and offset")
                continue
            factor, offset = entry.get("factor", 1), entry.get("offset", 0)
            if _is_number(factor) and _is_number(offset):
                result[str(name)] = Mimic(entry["parent"], float(factor), float(offset))
            else:
                self.fault(f"dependent_joints/{name}", entry, "numbers as factor and offset")
        return result

    def source_list(self) -> tuple[str, ...]:
        given = self._get("source_list", [])
        if isinstance(given, list) and all(isinstance(topic, str) and topic for topic in given):
            return tuple(given)
        self.fault("source_list", given, "a list of topics, e.g. [/move_group/fake_controller_joint_states]")
        return ()


def read_parameters(get: Callable[[str, Any], Any]) -> NodeParameters:
    """Returns the node's parameters.

    Args:
        get: Returns the value of a parameter, or the default that it is given.

    Raises:
        ParameterFaults: A value is not allowed.
    """
    read = _Reader(get)
    parameters = NodeParameters(
        SliderSettings(
            read.switch("use_mimic_tags", True),
            read.switch("use_smallest_joint_limits", True),
            read.zeros(),
            read.dependent_joints(),
        ),
        read.source_list(),
        read.number("rate", 10.0, "a number above 0 [1/s]", lambda value: value > 0),
        read.number("delta", 0.0, "a number from 0 [rad or m]", lambda value: value >= 0),
        int(read.number("num_rows", 0, "a whole number from 0", lambda value: value >= 0 and value == int(value))),
        read.switch("publish_default_positions", True),
        read.switch("publish_default_velocities", False),
        read.switch("publish_default_efforts", False),
    )
    if read.faults:
        raise ParameterFaults("\n".join(read.faults))
    return parameters


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
