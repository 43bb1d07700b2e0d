# SPDX-License-Identifier: BSD-3-Clause
"""The interface between robots and controllers: `RobotHW`, handles, interfaces, limits and transmissions."""

from modular_framework_control.hardware_interface.handles import (
    ActuatorHandle,
    ForceTorqueSensorHandle,
    ImuSensorHandle,
    JointHandle,
    JointStateHandle,
    PosVelAccJointHandle,
    PosVelJointHandle,
    SpeedScalingHandle,
)
from modular_framework_control.hardware_interface.interfaces import (
    EffortJointInterface,
    ForceTorqueSensorInterface,
    HardwareInterface,
    HardwareInterfaceError,
    ImuSensorInterface,
    JointStateInterface,
    PositionJointInterface,
    PosVelAccJointInterface,
    PosVelJointInterface,
    SpeedScalingInterface,
    VelocityJointInterface,
)
from modular_framework_control.hardware_interface.robot_hw import (
    HardwareFault,
    RobotHW,
    SwitchState,
)

__all__ = [
    "ActuatorHandle",
    "EffortJointInterface",
    "ForceTorqueSensorHandle",
    "ForceTorqueSensorInterface",
    "HardwareFault",
    "HardwareInterface",
    "HardwareInterfaceError",
    "ImuSensorHandle",
    "ImuSensorInterface",
    "JointHandle",
    "JointStateHandle",
    "JointStateInterface",
    "PosVelAccJointHandle",
    "PosVelAccJointInterface",
    "PosVelJointHandle",
    "PosVelJointInterface",
    "PositionJointInterface",
    "RobotHW",
    "SpeedScalingHandle",
    "SpeedScalingInterface",
    "SwitchState",
    "VelocityJointInterface",
]
