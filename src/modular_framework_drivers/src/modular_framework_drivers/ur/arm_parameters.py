# SPDX-License-Identifier: BSD-3-Clause
"""Reads and checks the parameters of a UR arm."""

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

# Limits of all UR joints: position range, velocity of the data sheet, maximum acceleration accepted by URScript
_UR_LIMITS = JointLimits(-2.0 * math.pi, 2.0 * math.pi, max_velocity=math.pi, max_acceleration=40.0)


def read_link_settings(parameters: ParameterReader) -> LinkSettings:
    """Returns the connection settings in the parameters of the arm.

    Raises:
        ParameterError: If parameters are missing or invalid; names each of them.
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
    return LinkSettings(
        address,
        timeout_s=timeout_s,
        speed_scale=scale,
        payload_kg=mass_kg,
        payload_centre_m=tuple(centre_m),
        lookahead_s=lookahead_s,
        gain=gain,
        real_time=real_time,
    )


def read_checked_joints(names: list[str], root_nh: NodeHandle) -> list[CheckedJoint]:
    """Returns the joints with the limits of the URDF and of `joint_limits`, bounded by those of the arm.

    Args:
        names: Names of the joints.
        root_nh: Node handle in the root namespace.

    Raises:
        ParameterError: If a limit is invalid.
    """
    description = root_nh.get_param("robot_description")
    urdf_limits = limits_from_urdf(description) if isinstance(description, str) else {}
    urdf_soft_limits = soft_limits_from_urdf(description) if isinstance(description, str) else {}
    joints = []
    for name in names:
        limits = limits_with_parameters(name, urdf_limits.get(name, _UR_LIMITS), root_nh)
        _check_nonzero_limits(limits, join_names(root_nh.namespace, f"joint_limits/{name}"))
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
                soft_limits_with_parameters(name, urdf_soft_limits.get(name), root_nh),
            )
        )
    return joints


def _check_nonzero_limits(limits: JointLimits, where: str) -> None:
    for key, value in (("max_velocity", limits.max_velocity), ("max_acceleration", limits.max_acceleration)):
        if not value > 0.0:
            raise ParameterError(
                f"parameter {where}/{key}: got {value:g}, from this parameter or from the robot description; expected "
                "more than 0, otherwise the joint cannot move"
            )
