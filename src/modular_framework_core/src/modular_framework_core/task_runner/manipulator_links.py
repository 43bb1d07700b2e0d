# SPDX-License-Identifier: BSD-3-Clause
"""The parameters a framework state machine starts from: read together, checked together, reported together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from modular_framework_ros.node_handle import ParameterError

PLANNER_FILE = "motion_planner_config.yaml"
MANIPULATOR_FILE = "manipulator_controller_parameters.yaml"


@dataclass(frozen=True, slots=True)
class UserdataParameters:
    """Parameters of the arm commander and of the manipulator's client.

    Attributes:
        planner_name: Planner to ask move_group for.
        robot_speed_factor: Share of the joint velocity limits, in (0, 1].
        arm_group_name: Planning group of the arm.
        number_plan_attempt: Plans made for each request; the shortest is kept.
        planning_max_time: Longest time for a plan [s].
        manipulator_prefix: Texts, one of which is in the name of every link of the manipulator; "" = no manipulator.
        manipulator_action: Name of the manipulator's Grasp action; "" without manipulator.
        max_torque: What a torque intensity of 1 stands for; None without manipulator.
    """

    planner_name: str
    robot_speed_factor: float
    arm_group_name: str
    number_plan_attempt: int
    planning_max_time: float
    manipulator_prefix: str
    manipulator_action: str
    max_torque: float | None


def read_parameters(get: Callable[[str], Any]) -> UserdataParameters:
    """Reads and checks all parameters.

    Args:
        get: Returns the value of a global parameter, None when it is not set.

    Raises:
        ParameterError: Lists every parameter that is missing or wrong, with its config file.
    """
    faults: list[str] = []

    def value(name: str, file: str, kinds: tuple[type, ...], allowed: str, fits: Callable[[Any], bool]) -> Any:
        found = get(name)
        if found is None:
            faults.append(f"'{name}' is not set; it belongs in {file} ({allowed})")
        elif not isinstance(found, kinds) or isinstance(found, bool) or not fits(found):
            faults.append(f"'{name}' is {found!r}; in {file} it must be {allowed}")
        return found

    number = (int, float)
    planner = value("planner_name", PLANNER_FILE, (str,), "the name of a planner", bool)
    speed = value("robot_speed_factor", PLANNER_FILE, number, "a number in (0, 1]", lambda v: 0.0 < v <= 1.0)
    group = value("arm_group_name", PLANNER_FILE, (str,), "the name of a planning group", bool)
    attempts = value("number_plan_attempt", PLANNER_FILE, (int,), "a whole number of at least 1", lambda v: v >= 1)
    time_s = value("planning_max_time", PLANNER_FILE, number, "seconds, more than 0", lambda v: v > 0.0)
    prefix = str(get("manipulator_prefix") or "")
    action, torque = "", None
    if prefix:
        name = "manipulator_controller_action_server_name"
        action = value(name, MANIPULATOR_FILE, (str,), "the name of an action", bool)
        torque = value("max_torque", MANIPULATOR_FILE, number, "a number of at least 0", lambda v: v >= 0.0)
    if faults:
        raise ParameterError("parameters of the task are missing or wrong: " + "; ".join(faults))
    return UserdataParameters(
        planner, float(speed), group, attempts, float(time_s), prefix, action, None if torque is None else float(torque)
    )


def manipulator_links(link_names: Sequence[str], prefix: str) -> list[int]:
    """Returns the indices of the manipulator's links.

    Args:
        link_names: Names of links.
        prefix: Texts separated by spaces; a link belongs to the manipulator if its name contains one of them.
    """
    texts = prefix.split()
    return [index for index, name in enumerate(link_names) if any(text in name for text in texts)]
