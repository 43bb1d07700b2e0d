# SPDX-License-Identifier: BSD-3-Clause
"""Controller classes by the type names in controller files."""

from __future__ import annotations

import importlib
from collections.abc import Callable

from modular_framework_control.controller_interface.controller import Controller, ControllerError
from modular_framework_control.hardware_interface.plugins import CONTROLLER_BASE, PluginError, PluginIndex
from modular_framework_ros.allowed_names import nearest

BASE_CLASS = CONTROLLER_BASE

_CONTROLLERS = "modular_framework_control.controllers"
_MOBILE_BASE = "modular_framework_control.mobile_base"
_JOINT_COMMAND = f"{_CONTROLLERS}.joint_command_controllers"
_CLOSED_LOOP = f"{_CONTROLLERS}.closed_loop_trajectory_controllers"
_POS_VEL = f"{_CONTROLLERS}.position_velocity_trajectory_controllers"
_TRAJECTORY = f"{_CONTROLLERS}.joint_trajectory_controller"
_SENSORS = f"{_CONTROLLERS}.sensor_controllers"
_ACKERMANN = f"{_MOBILE_BASE}.ackermann_steering_controller"
_FOUR_WHEEL = f"{_MOBILE_BASE}.four_wheel_steering_controller"
_EFFORT_GRIPPER = f"{_CONTROLLERS}.effort_gripper_controller"
BUILT_IN_TYPES: dict[str, str] = {
    "joint_state_controller/JointStateController": f"{_CONTROLLERS}.joint_state_controller:JointStateController",
    "force_torque_sensor_controller/ForceTorqueSensorController": f"{_SENSORS}:ForceTorqueSensorController",
    "imu_sensor_controller/ImuSensorController": f"{_SENSORS}:ImuSensorController",
    "scaled_controllers/SpeedScalingStateController": f"{_SENSORS}:SpeedScalingStateController",
    "position_controllers/JointTrajectoryController": f"{_TRAJECTORY}:JointTrajectoryController",
    "position_controllers/ScaledJointTrajectoryController": f"{_TRAJECTORY}:JointTrajectoryController",
    "pos_vel_controllers/JointTrajectoryController": f"{_POS_VEL}:PosVelJointTrajectoryController",
    "pos_vel_acc_controllers/JointTrajectoryController": f"{_POS_VEL}:PosVelAccJointTrajectoryController",
    "velocity_controllers/JointTrajectoryController": f"{_CLOSED_LOOP}:VelocityJointTrajectoryController",
    "velocity_controllers/ScaledJointTrajectoryController": f"{_CLOSED_LOOP}:VelocityJointTrajectoryController",
    "effort_controllers/JointTrajectoryController": f"{_CLOSED_LOOP}:EffortJointTrajectoryController",
    "position_controllers/GripperActionController": f"{_CONTROLLERS}.gripper_action_controller:GripperActionController",
    "effort_controllers/GripperActionController": f"{_EFFORT_GRIPPER}:EffortGripperActionController",
    "position_controllers/JointPositionController": f"{_JOINT_COMMAND}:PositionJointPositionController",
    "position_controllers/JointGroupPositionController": f"{_JOINT_COMMAND}:PositionJointGroupPositionController",
    "velocity_controllers/JointPositionController": f"{_JOINT_COMMAND}:VelocityJointPositionController",
    "velocity_controllers/JointVelocityController": f"{_JOINT_COMMAND}:VelocityJointVelocityController",
    "velocity_controllers/JointGroupVelocityController": f"{_JOINT_COMMAND}:VelocityJointGroupVelocityController",
    "effort_controllers/JointPositionController": f"{_JOINT_COMMAND}:EffortJointPositionController",
    "effort_controllers/JointVelocityController": f"{_JOINT_COMMAND}:EffortJointVelocityController",
    "effort_controllers/JointEffortController": f"{_JOINT_COMMAND}:EffortJointEffortController",
    "effort_controllers/JointGroupPositionController": f"{_JOINT_COMMAND}:EffortJointGroupPositionController",
    "effort_controllers/JointGroupEffortController": f"{_JOINT_COMMAND}:EffortJointGroupEffortController",
    "diff_drive_controller/DiffDriveController": f"{_MOBILE_BASE}.diff_drive_controller:DiffDriveController",
    "ackermann_steering_controller/AckermannSteeringController": f"{_ACKERMANN}:AckermannSteeringController",
    "four_wheel_steering_controller/FourWheelSteeringController": f"{_FOUR_WHEEL}:FourWheelSteeringController",
}


class ControllerTypes:
    """Controller classes by type name: registered classes, built-in classes, then plugins of packages.

    Args:
        locations: "module:Class" by type name; by default the built-in classes.
        plugins: Plugins of packages; by default of the sourced workspace.
    """

    def __init__(self, locations: dict[str, str] | None = None, plugins: PluginIndex | None = None) -> None:
        self._locations = dict(BUILT_IN_TYPES if locations is None else locations)
        self._plugins = plugins if plugins is not None else PluginIndex(CONTROLLER_BASE)
        self._factories: dict[str, Callable[[], Controller]] = {}

    @property
    def names(self) -> list[str]:
        """Known type names, sorted."""
        return sorted({*self._locations, *self._factories, *self._plugins.names})

    def register(self, type_name: str, factory: Callable[[], Controller]) -> None:
        """Registers a class under `type_name` ("package/Class"), replacing an earlier registration."""
        if "/" not in type_name:
            raise ControllerError(f"controller type '{type_name}': expected the form package/Class")
        self._factories[type_name] = factory

    def create(self, type_name: str) -> Controller:
        """Returns a new controller of a type.

        Raises:
            ControllerError: The type is unknown, or its module cannot be imported.
        """
        if type_name in self._factories:
            return self._factories[type_name]()
        if type_name not in self._locations:
            return self._create_plugin(type_name)
        module_name, _, class_name = self._locations[type_name].partition(":")
        try:
            controller_class = getattr(importlib.import_module(module_name), class_name)
        except (ImportError, AttributeError) as error:
            raise ControllerError(
                f"controller type '{type_name}': cannot load {class_name} of {module_name}: {error}"
            ) from error
        controller: Controller = controller_class()
        return controller

    def _create_plugin(self, type_name: str) -> Controller:
        if type_name not in self._plugins:
            faults = "".join(f"; {fault}" for fault in self._plugins.faults)
            raise ControllerError(
                f"unknown controller type '{type_name}'; known types: {', '.join(self.names)}"
                f"{nearest(type_name, self.names)}{faults}"
            )
        try:
            controller: Controller = self._plugins.load(type_name, Controller)()
        except PluginError as error:
            raise ControllerError(f"controller type '{type_name}': {error}") from error
        except Exception as error:  # a user's constructor may raise anything
            raise ControllerError(
                f"controller type '{type_name}': its constructor raised {type(error).__name__}: {error}"
            ) from error
        return controller

    def reload(self) -> None:
        """Searches again for plugins, to find packages installed since the program started."""
        self._plugins.reload()
