# SPDX-License-Identifier: BSD-3-Clause
"""The parameters of a launch are held against what its nodes, and their hardware, declare."""

from __future__ import annotations

from typing import Any

import pytest

from modular_framework_core.launching.ros_declared_names import DeclaredNames
from modular_framework_core.launching.ros_launch_preview import LaunchedNode, LaunchPreview

ROBOT_HW = LaunchedNode("modular_framework_control", "robot_hw", "/robot_hw", "/")
UR, EZGRIPPER = (f"modular_framework_drivers/{name}RobotHW" for name in ("UrArm", "EzGripper"))
COMBINED: dict[str, Any] = {
    "/robot_hardware": ["arm_hw", "hand_hw"],
    "/arm_hw/type": UR,
    "/arm_hw/robot_ip_address": "192.168.56.101",
    "/hand_hw/type": EZGRIPPER,
    "/port_name": "/dev/ttyUSB0",
}


def faults(parameters: dict[str, Any]) -> list[str]:
    names = DeclaredNames(LaunchPreview((ROBOT_HW,), parameters))
    return [fault.text for fault in (*names.misspelt(), *names.wrong_values())]


def test_hardware_that_is_right_has_no_faults() -> None:
    assert faults(COMBINED) == []
    assert faults({"/robot_hw/type": UR, "/robot_hw/robot_ip_address": "10.0.0.2", "/robot_hw/rate": 500}) == []


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"/arm_hw/robot_ip_address": None}, "needs the parameter '/arm_hw/robot_ip_address'"),
        (
            {"/arm_hw/speed_scale": 2.0},
            "parameter '/arm_hw/speed_scale' is 2.0; allowed: a number, at least 0 and at most 1",
        ),
        (
            {"/arm_hw/servoj_gian": 300},
            "does not read the parameter '/arm_hw/servoj_gian'; did you mean '/arm_hw/servoj_gain'",
        ),
        (
            {"/hand_hw/poll_rate": 0},
            "parameter '/hand_hw/poll_rate' is 0; allowed: a number, at least 1 and at most 200",
        ),
        ({"/servo_ids": [1, 1]}, "parameter '/servo_ids' is [1, 1]; allowed: a list that is not empty, each a whole"),
        ({"/robot_hw/rate": "fast"}, "parameter '/robot_hw/rate' is 'fast'; allowed: a number, at least 1"),
    ],
)
def test_parameters_of_hardware_are_checked_by_the_declaration_of_its_class(changes: dict[str, Any], text: str) -> None:
    given = {name: value for name, value in {**COMBINED, **changes}.items() if value is not None}
    (found,) = faults(given)
    assert text in found


def test_hardware_of_others_without_a_declaration_may_have_any_parameter() -> None:
    assert faults({"/robot_hardware": ["arm"], "/arm/type": "my_arm/MyArm", "/arm/joints": 3}) == []
