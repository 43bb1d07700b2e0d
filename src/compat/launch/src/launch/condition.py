# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the base class of conditions."""

from launch.core.condition import Condition as Condition
