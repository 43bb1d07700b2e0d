# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the base class of actions."""

from launch.core.action import Action as Action
