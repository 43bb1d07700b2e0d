# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of a framework state machine: all faults are reported at once, with the file."""

from __future__ import annotations

from typing import Any

import pytest

from modular_framework_core.task_runner.userdata_parameters import (
    manipulator_links,
    read_parameters,
)
from modular_framework_ros.node_handle import ParameterError

GOOD: dict[str, Any] = {
    "planner_name": "RRTConnect",
    "robot_speed_factor": 0.5,
    "arm_group_name": "arm",
    "number_plan_attempt": 1,
    "planning_max_time": 5,
    "manipulator_prefix": "hand",
    "manipulator_controller_action_server_name": "grasp",
    "max_torque": 400,
}


def message(**changes: Any) -> str:
    with pytest.raises(ParameterError) as caught:
        read_parameters({**GOOD, **changes}.get)
    return str(caught.value)


def test_good_parameters_are_read() -> None:
    found = read_parameters(GOOD.get)
    assert (found.planner_name, found.planning_max_time, found.manipulator_action) == ("RRTConnect", 5.0, "grasp")
    assert found.max_torque == 400.0


def test_without_any_parameter_all_missing_ones_of_the_arm_are_named_with_their_file() -> None:
    with pytest.raises(ParameterError) as caught:
        read_parameters({}.get)
    for name in ("planner_name", "robot_speed_factor", "arm_group_name", "number_plan_attempt", "planning_max_time"):
        assert f"'{name}' is not set; it belongs in motion_planner_config.yaml" in str(caught.value)
    assert "manipulator" not in str(caught.value)


def test_a_manipulator_needs_its_action_and_torque() -> None:
    text = message(manipulator_controller_action_server_name=None, max_torque=None)
    assert text.count("manipulator_controller_parameters.yaml") == 2


def test_a_task_without_manipulator_needs_neither() -> None:
    found = read_parameters({**GOOD, "manipulator_prefix": "", "max_torque": None}.get)
    assert (found.manipulator_action, found.max_torque) == ("", None)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("planner_name", ""),
        ("planner_name", 3),
        ("robot_speed_factor", 0.0),
        ("robot_speed_factor", 1.5),
        ("robot_speed_factor", "fast"),
        ("number_plan_attempt", 0),
        ("number_plan_attempt", True),
        ("planning_max_time", -1),
        ("max_torque", -1.0),
        ("arm_group_name", ["arm"]),
    ],
)
def test_a_wrong_value_is_reported_with_what_is_allowed(name: str, value: Any) -> None:
    text = message(**{name: value})
    assert f"'{name}' is {value!r}; in " in text and "it must be" in text


def test_manipulator_links_are_those_with_the_prefix_in_their_name() -> None:
    names = ["base", "hand_palm", "left_hand_tip"]
    assert manipulator_links(names, "hand") == [1, 2]
    assert manipulator_links(names, "") == []
