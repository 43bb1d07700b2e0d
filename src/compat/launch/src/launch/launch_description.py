# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the launch description."""

from launch.actions.launch_description import LaunchDescription as LaunchDescription
