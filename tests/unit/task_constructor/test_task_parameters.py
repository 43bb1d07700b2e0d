# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of a framework state machine: all faults are reported at once, with the file."""

from __future__ import annotations

from typing import Any

import pytest

from modular_framework_core.task_runner.manipulator_links import manipulator_links
from modular_framework_ros.node_handle import ParameterError
from modular_framework_ros.parameter_declarations import ParameterReader, existing_declaration

ARM = ("/planner_name", "/robot_speed_factor", "/arm_group_name", "/number_plan_attempt", "/planning_max_time")
HAND = ("/manipulator_controller_action_server_name", "/max_torque")
GOOD: dict[str, Any] = {
    "/planner_name": "RRTConnect",
    "/robot_speed_factor": 0.5,
    "/arm_group_name": "arm",
    "/number_plan_attempt": 1,
    "/planning_max_time": 5,
    "/manipulator_prefix": "hand",
    "/manipulator_controller_action_server_name": "grasp",
    "/max_torque": 400,
}


def values(given: dict[str, Any]) -> list[Any]:
    declared = existing_declaration("modular_framework_core", "run_task")
    return ParameterReader(declared, given.get).values(*ARM, *HAND)


def message(given: dict[str, Any]) -> str:
    with pytest.raises(ParameterError) as caught:
        values(given)
    return str(caught.value)


def test_good_parameters_are_read() -> None:
    assert values(GOOD) == ["RRTConnect", 0.5, "arm", 1, 5.0, "grasp", 400.0]


def test_without_any_parameter_all_missing_ones_of_the_arm_are_named_with_their_file() -> None:
    text = message({})
    assert all(f"parameter '{name}' is not set" in text for name in ARM) and text.count("motion_planner_config") == 5
    assert "manipulator" not in text


def test_a_manipulator_needs_its_action_and_torque() -> None:
    text = message({**GOOD, "/manipulator_controller_action_server_name": "", "/max_torque": None})
    assert text.count("manipulator_controller_parameters.yaml") == 2


def test_a_task_without_manipulator_needs_neither() -> None:
    assert values({name: GOOD[name] for name in ARM} | {"/manipulator_prefix": ""})[5:] == [None, None]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("/planner_name", ""),
        ("/planner_name", 3),
        ("/robot_speed_factor", 0.0),
        ("/robot_speed_factor", 1.5),
        ("/robot_speed_factor", "fast"),
        ("/number_plan_attempt", 0),
        ("/number_plan_attempt", True),
        ("/planning_max_time", -1),
        ("/max_torque", -1.0),
        ("/arm_group_name", ["arm"]),
    ],
)
def test_a_wrong_value_is_reported_with_what_is_allowed(name: str, value: Any) -> None:
    text = message({**GOOD, name: value})
    assert f"parameter '{name}' is {value!r}; allowed: " in text and ".yaml)" in text


def test_manipulator_links_are_those_with_the_prefix_in_their_name() -> None:
    names = ["base", "hand_palm", "left_hand_tip"]
    assert manipulator_links(names, "hand") == [1, 2]
    assert manipulator_links(names, "") == []
