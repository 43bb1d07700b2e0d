# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the launch context."""

from launch.core.launch_context import LaunchContext as LaunchContext
