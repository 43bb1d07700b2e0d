# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the base class of launch file sources."""

from launch.actions.launch_description_source import LaunchDescriptionSource as LaunchDescriptionSource
