# SPDX-License-Identifier: BSD-3-Clause
"""Alternative public module of parameter descriptions."""

from launch_ros.parameter_descriptions import Parameter as Parameter
from launch_ros.parameter_descriptions import ParameterFile as ParameterFile
from launch_ros.parameter_descriptions import ParameterValue as ParameterValue
