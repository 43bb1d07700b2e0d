# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of the public joint_state_publisher are read; wrong ones are named all at once."""

from __future__ import annotations

from typing import Any

import pytest
from joint_sliders.node_parameters import NodeParameters, read_parameters

from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.parameter_declarations import ParameterReader, existing_declaration
from modular_framework_urdf.mimics import Mimic


def read(**given: Any) -> NodeParameters:
    declared = existing_declaration("joint_state_publisher_gui", "joint_state_publisher_gui")
    return read_parameters(ParameterReader(declared, lambda name: given.get(name[1:]), lambda name: name[1:]))


def test_the_defaults_are_the_public_ones() -> None:
    parameters = read()
    assert (parameters.rate, parameters.delta, parameters.num_rows, parameters.source_list) == (10.0, 0.0, 0, ())
    assert parameters.settings.use_mimic_tags and parameters.settings.use_smallest_joint_limits
    defaults = (parameters.default_positions, parameters.default_velocities, parameters.default_efforts)
    assert defaults == (True, False, False)


def test_parameters_are_read() -> None:
    dependent = {"a": {"parent": "b", "factor": -1}, "c": {"parent": "b", "offset": 0.5}}
    parameters = read(rate=50, source_list=["/x"], zeros={"b": 1}, dependent_joints=dependent, num_rows=4)
    assert (parameters.rate, parameters.source_list, parameters.num_rows) == (50.0, ("/x",), 4)
    assert parameters.settings.zeros == {"b": 1.0}
    assert parameters.settings.dependent_joints == {"a": Mimic("b", -1.0, 0.0), "c": Mimic("b", 1.0, 0.5)}


@pytest.mark.parametrize(
    ("name", "value", "allowed"),
    [
        ("rate", 0, "above 0"),
        ("rate", "fast", "above 0"),
        ("delta", -0.1, "at least 0"),
        ("num_rows", 1.5, "a whole number"),
        ("use_mimic_tags", "yes", "true or false"),
        ("publish_default_efforts", 1, "true or false"),
        ("zeros", {"a": "x"}, "a mapping, each a number"),
        ("source_list", "joint_states_of_the_hand", "a list, each a text"),
        ("dependent_joints", {"a": "b"}, "a mapping, each a mapping"),
        ("dependent_joints", {"a": {"factor": 1}}, "a mapping with parent"),
        ("dependent_joints", {"a": {"parent": "b", "multiplier": 1}}, "a mapping with parent"),
        ("dependent_joints", {"a": {"parent": "b", "factor": float("nan")}}, "numbers as factor and offset"),
        ("dependent_joints", "a", "a mapping"),
    ],
)
def test_a_wrong_value_is_named_with_what_is_allowed(name: str, value: Any, allowed: str) -> None:
    with pytest.raises(ParameterError) as caught:
        read(**{name: value})
    assert f"parameter '{name}" in str(caught.value) and allowed in str(caught.value)


def test_all_faults_are_named_at_once() -> None:
    with pytest.raises(ParameterError) as caught:
        read(rate=-1, delta="x", zeros=3)
    assert all(f"parameter '{name}' is " in str(caught.value) for name in ("rate", "delta", "zeros"))
