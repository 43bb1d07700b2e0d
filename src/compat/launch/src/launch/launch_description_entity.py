# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the base class of entities."""

from launch.core.launch_description_entity import LaunchDescriptionEntity as LaunchDescriptionEntity
