# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the launch's logger."""

from launch.core.screen_log import get_logger as get_logger
