# SPDX-License-Identifier: BSD-3-Clause
"""The controllers to load, start and stop for a group of controllers."""

from __future__ import annotations

import pytest

from modular_framework_control.ros.controller_groups import GroupPlan, plan_group, read_groups
from modular_framework_control.ros.controller_manager_client import ControllerManagerClientError

GROUPS = {"follow": ["states", "arm", "gripper"], "teach": ["states", "gravity"], "empty": []}


@pytest.mark.parametrize(
    ("group", "states", "plan"),
    [
        ("follow", {}, GroupPlan(("states", "arm", "gripper"), ("states", "arm", "gripper"), ())),
        (
            "follow",
            {"states": "running", "gravity": "running", "arm": "stopped", "stranger": "running"},
            GroupPlan(("gripper",), ("arm", "gripper"), ("gravity",)),
        ),
        (
            "teach",
            {"states": "running", "arm": "running", "gripper": "initialized", "gravity": "initialized"},
            GroupPlan((), ("gravity",), ("arm",)),
        ),
    ],
)
def test_what_is_shared_goes_on_and_what_is_others_only_stops(
    group: str, states: dict[str, str], plan: GroupPlan
) -> None:
    assert plan_group(GROUPS, group, states) == plan


@pytest.mark.parametrize("group", ["empty", "absent"])
def test_a_group_without_controllers_is_refused_with_the_known_ones(group: str) -> None:
    with pytest.raises(ControllerManagerClientError, match=f"group '{group}'; known groups: empty, follow, teach"):
        plan_group(GROUPS, group, {})


@pytest.mark.parametrize("value", [None, {}, [], "teach", {"a": "b"}, {"a": [1]}, {"a": None}])
def test_a_faulty_parameter_is_refused_with_its_name(value: object) -> None:
    with pytest.raises(ControllerManagerClientError, match="parameter /controller_groups"):
        read_groups(value)
