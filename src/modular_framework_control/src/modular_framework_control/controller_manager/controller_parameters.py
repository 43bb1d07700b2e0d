# SPDX-License-Identifier: BSD-3-Clause
"""Checks the parameters of controllers against the declaration of their type, in `parameters` of the type's package."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from modular_framework_ros.declared_trees import tree_faults
from modular_framework_ros.parameter_declarations import NodeDeclaration, existing_declaration, node_declaration

PACKAGE = "modular_framework_control"
DECLARATIONS = {
    "joint_state_controller/JointStateController": "JointStateController",
    "force_torque_sensor_controller/ForceTorqueSensorController": "SensorController",
    "imu_sensor_controller/ImuSensorController": "SensorController",
    "scaled_controllers/SpeedScalingStateController": "SensorController",
    "diff_drive_controller/DiffDriveController": "DiffDriveController",
    "ackermann_steering_controller/AckermannSteeringController": "AckermannSteeringController",
    "four_wheel_steering_controller/FourWheelSteeringController": "FourWheelSteeringController",
}
"""Declarations of the built-in types whose class name occurs once."""
DECLARATIONS_BY_CLASS = {
    "JointTrajectoryController": "JointTrajectoryController",
    "ScaledJointTrajectoryController": "JointTrajectoryController",
    "GripperActionController": "GripperActionController",
    "JointPositionController": "JointCommandController",
    "JointVelocityController": "JointCommandController",
    "JointEffortController": "JointCommandController",
    "JointGroupPositionController": "JointGroupCommandController",
    "JointGroupVelocityController": "JointGroupCommandController",
    "JointGroupEffortController": "JointGroupCommandController",
}
"""Declarations of the built-in types that exist for several command interfaces, keyed by class name."""
COMMAND_PACKAGES = tuple(f"{kind}_controllers" for kind in ("position", "velocity", "effort", "pos_vel", "pos_vel_acc"))


def controller_declaration(controller_type: str) -> NodeDeclaration | None:
    """Returns the declared parameters of a controller type; None if its package declares none.

    Raises:
        DeclarationError: The declaration is invalid.
    """
    package, _, name = controller_type.partition("/")
    if controller_type in DECLARATIONS:
        return existing_declaration(PACKAGE, DECLARATIONS[controller_type])
    if package in COMMAND_PACKAGES and name in DECLARATIONS_BY_CLASS:
        return existing_declaration(PACKAGE, DECLARATIONS_BY_CLASS[name])
    return node_declaration(package, name) if name else None


def parameter_faults(controller_type: str, parameters: Mapping[str, Any]) -> list[str]:
    """Returns a message per unknown, invalid or missing parameter of a controller.

    Args:
        controller_type: Type of the controller, package/Class.
        parameters: Parameters below the controller's name.

    Raises:
        DeclarationError: The declaration is invalid.
    """
    declared = controller_declaration(controller_type)
    if declared is None:
        return []
    joints = [*_names(parameters.get("joints")), *_names(parameters.get("joint"))]
    return list(tree_faults(parameters, declared, {"joint": joints} if joints else {}))


def _names(value: Any) -> list[str]:
    return [str(name) for name in (value if isinstance(value, list) else [value]) if isinstance(name, str)]
