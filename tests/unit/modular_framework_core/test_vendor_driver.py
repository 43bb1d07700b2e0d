# SPDX-License-Identifier: BSD-3-Clause
"""The file of a vendor's driver is checked entry by entry, and the health of the driver names what is missing."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from modular_framework_core.launching.vendor_driver import DriverHealth, controller_list_faults, driver_actions

ROOT = Path(__file__).parents[3]
JOINTS = ("shoulder", "elbow")
ARM = {"name": "/vendor/arm", "action_ns": "follow", "type": "FollowJointTrajectory", "joints": ["shoulder", "elbow"]}


def test_the_file_of_the_page_has_no_faults() -> None:
    example = re.search(r"```yaml\n(.*?)```", (ROOT / "docs/vendor_driver.md").read_text(), re.DOTALL)
    assert example is not None
    controllers = yaml.safe_load(example[1])["move_group"]["controller_list"]
    assert controller_list_faults(controllers, ()) == []
    assert [action.name for action in driver_actions(controllers)] == [
        "/vendor/scaled_pos_joint_traj_controller/follow_joint_trajectory",
        "/vendor/gripper/gripper_cmd",
    ]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"joins": []}, "entry 0 has no key 'joins'; allowed: name, .*; did you mean 'joints'?"),
        ({"type": "FollowJointTrajectries"}, "type is 'Follow.*; allowed: .*; did you mean 'FollowJointTrajectory'?"),
        ({"joints": ["shoulder", "elbw"]}, "has no joint 'elbw'; allowed: shoulder, elbow; did you mean 'elbow'?"),
        ({"joints": []}, "joints is \\[\\]; it must be a list of joint names"),
        ({"name": ""}, "name is ''; it must be the name of a controller"),
        (
            {"parallel": True, "joints": ["elbow"]},
            "'/vendor/arm' is a parallel gripper with 1 joints; it must have two",
        ),
    ],
)
def test_a_fault_of_a_controller_is_named_with_what_is_allowed(change: dict[str, Any], sentence: str) -> None:
    (fault,) = controller_list_faults([ARM | change], JOINTS)
    assert re.search(sentence, fault), fault


def test_entries_that_are_no_mappings_and_an_empty_list_are_faults() -> None:
    assert "must be a mapping" in controller_list_faults(["arm"], JOINTS)[0]
    assert "is empty" in controller_list_faults([], JOINTS)[0]


def ready_driver() -> DriverHealth:
    health = DriverHealth(driver_actions([ARM]), ["/vendor/joint_states"], ["service /vendor/go"], "/vendor/runs", 2.0)
    health.on_status("/vendor/arm/follow", 0.0)
    health.on_joint_states("/vendor/joint_states", JOINTS, 0.0)
    health.on_signal("service /vendor/go")
    health.on_program(True)
    return health


def test_a_driver_that_sends_everything_lacks_nothing() -> None:
    assert ready_driver().missing(1.0) == []


def test_everything_that_never_came_is_named() -> None:
    health = DriverHealth(driver_actions([ARM]), ["/vendor/joint_states"], ["service /vendor/go"], "/vendor/runs", 2.0)
    assert health.missing(0.0) == [
        "action /vendor/arm/follow has not answered",
        "topic /vendor/joint_states has not answered",
        "topic /vendor/runs is not true",
        "service /vendor/go does not exist",
    ]


def test_silence_and_a_stopped_program_are_a_loss() -> None:
    health = ready_driver()
    health.on_joint_states("/vendor/joint_states", JOINTS, 3.0)
    assert health.missing(3.0) == ["action /vendor/arm/follow has been silent for 3.0 s"]
    health.on_status("/vendor/arm/follow", 3.0)
    health.on_program(False)
    assert health.missing(3.0) == ["topic /vendor/runs is not true"]


def test_joints_that_no_topic_contains_are_named() -> None:
    health = DriverHealth(driver_actions([ARM]), ["/vendor/joint_states"], [], "", 2.0)
    health.on_status("/vendor/arm/follow", 0.0)
    health.on_joint_states("/vendor/joint_states", ["shoulder"], 0.0)
    (missing,) = health.missing(0.0)
    assert missing == "joints elbow are in none of the topics /vendor/joint_states (the topics contain shoulder)"
