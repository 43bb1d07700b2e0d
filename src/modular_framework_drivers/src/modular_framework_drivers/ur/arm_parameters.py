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
from modular_framework_ros.node_handle import NodeHandle, ParameterError, join_names
from modular_framework_ros.parameter_declarations import ParameterReader

# Largest limits of an arm: range in turns, its maker's speed, and the acceleration that URScript accepts of a joint
_UR_LIMITS = JointLimits(-2.0 * math.pi, 2.0 * math.pi, max_velocity=math.pi, max_acceleration=40.0)


def read_link_settings(parameters: ParameterReader) -> LinkSettings:
    """Returns the connection settings from the parameters of the arm.

    Raises:
        ParameterError: something is missing or not allowed; names all of it.
    """
    address, timeout_s, scale, mass_kg, centre_m, lookahead_s, gain, real_time = parameters.values(
        "~robot_ip_address",
        "~link_timeout",
        "~speed_scale",
        "~payload_mass_kg",
        "~payload_center_of_mass_m",
        "~servoj_lookahead_time",
        "~servoj_gain",
        "~real_time",
    )
    return LinkSettings(address, timeout_s, scale, mass_kg, tuple(centre_m), lookahead_s, gain, real_time)


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
