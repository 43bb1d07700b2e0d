# SPDX-License-Identifier: BSD-3-Clause
"""Alternative public module of parameter descriptions."""

from __future__ import annotations

from launch_ros.parameter_descriptions import Parameter, ParameterFile, ParameterValue

__all__ = ["Parameter", "ParameterFile", "ParameterValue"]
