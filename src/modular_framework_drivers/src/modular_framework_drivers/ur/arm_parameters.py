# SPDX-License-Identifier: BSD-3-Clause
"""Reads the parameters of an arm of Universal Robots and checks them."""

from __future__ import annotations

import math
from dataclasses import replace

from modular_framework_control.hardware_interface.joint_limit_parameters import (
    JointLimits,
    limits_from_urdf,
    limits_with_parameters,
    soft_limits_from_urdf,
    soft_limits_with_parameters,
)
from modular_framework_drivers.ur.command_check import CheckedJoint
from modular_framework_drivers.ur.rtde_link import LinkSettings
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names, read_bool, read_number

# Largest limits of an arm: range in turns, its maker's speed, and the acceleration that URScript accepts of a joint
_UR_LIMITS = JointLimits(-2.0 * math.pi, 2.0 * math.pi, max_velocity=math.pi, max_acceleration=40.0)


def read_prefix(nh: NodeHandle) -> str:
    """Returns the prefix of the joint names: `robot_id` and an underscore, or "".

    Raises:
        ParameterError: it is no text.
    """
    robot_id = nh.get_param("robot_id", "")
    if not isinstance(robot_id, str):
        raise ParameterError(f"parameter {join_names(nh.namespace, 'robot_id')}: got {robot_id!r}; expected a text")
    return f"{robot_id}_" if robot_id else ""


def read_link_settings(nh: NodeHandle) -> LinkSettings:
    """Returns the connection settings from the parameters below `nh`.

    Raises:
        ParameterError: something is missing or not allowed.
    """
    address = nh.get_param("robot_ip_address")
    if not isinstance(address, str) or not address:
        raise ParameterError(
            f"parameter {join_names(nh.namespace, 'robot_ip_address')}: got {address!r}; expected the "
            "address of the arm's controller, for example 192.168.56.101"
        )
    scale = _read_bounded(nh, "speed_scale", 1.0, 0.0, 1.0) if nh.has_param("speed_scale") else None
    return LinkSettings(
        address,
        read_number(nh, "link_timeout", 0.12, 0.02),
        scale,
        read_number(nh, "payload_mass_kg", 0.0),
        _read_centre(nh),
        _read_bounded(nh, "servoj_lookahead_time", 0.03, 0.03, 0.2),
        _read_bounded(nh, "servoj_gain", 2000.0, 100.0, 2000.0),
        read_bool(nh, "real_time", True),
    )


def _read_bounded(nh: NodeHandle, key: str, default: float, low: float, high: float) -> float:
    value = read_number(nh, key, default, low)
    if value > high:
        raise ParameterError(f"parameter {join_names(nh.namespace, key)}: got {value:g}; expected {low:g} to {high:g}")
    return value


def _read_centre(nh: NodeHandle) -> tuple[float, float, float]:
    value = nh.get_param("payload_center_of_mass_m", [0.0, 0.0, 0.0])
    numbers = [float(number) for number in value if isinstance(number, (int, float))] if isinstance(value, list) else []
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise ParameterError(
            f"parameter {join_names(nh.namespace, 'payload_center_of_mass_m')}: got {value!r}; "
            "expected three numbers [m]"
        )
    return numbers[0], numbers[1], numbers[2]


def read_checked_joints(names: list[str], root_nh: NodeHandle) -> list[CheckedJoint]:
    """The joints with their limits: of the robot description and `joint_limits`, and what the arm can do at most.

    Raises:
        ParameterError: a limit is not allowed.
    """
    description = root_nh.get_param("robot_description")
    known = limits_from_urdf(description) if isinstance(description, str) else {}
    soft = soft_limits_from_urdf(description) if isinstance(description, str) else {}
    joints = []
    for name in names:
        limits = limits_with_parameters(name, known.get(name, _UR_LIMITS), root_nh)
        _refuse_standstill(limits, join_names(root_nh.namespace, f"joint_limits/{name}"))
        joints.append(
            CheckedJoint(
                name,
                replace(
                    limits,
                    min_position=max(limits.min_position, _UR_LIMITS.min_position),
                    max_position=min(limits.max_position, _UR_LIMITS.max_position),
                    max_velocity=min(limits.max_velocity, _UR_LIMITS.max_velocity),
                    max_acceleration=min(limits.max_acceleration, _UR_LIMITS.max_acceleration),
                ),
                soft_limits_with_parameters(name, soft.get(name), root_nh),
            )
        )
    return joints


def _refuse_standstill(limits: JointLimits, where: str) -> None:
    for key, value in (("max_velocity", limits.max_velocity), ("max_acceleration", limits.max_acceleration)):
        if not value > 0.0:
            raise ParameterError(
                f"parameter {where}/{key}: got {value:g}, there or in the robot description; expected "
                "more than 0, else the joint cannot move"
            )
