# SPDX-License-Identifier: BSD-3-Clause
"""ROS 2's Python launch descriptions, executed on ROS 1 with roslaunch's Python API."""

from __future__ import annotations

from launch import actions, conditions, event_handlers, events, launch_description_sources, logging, substitutions
from launch.actions.launch_description import LaunchDescription
from launch.actions.launch_description_source import LaunchDescriptionSource
from launch.core.action import Action
from launch.core.condition import Condition
from launch.core.errors import InvalidLaunchFileError, LaunchError
from launch.core.event_handler import EventHandler
from launch.core.launch_context import LaunchContext
from launch.core.launch_description_entity import LaunchDescriptionEntity
from launch.core.some_entities_type import SomeEntitiesType, SomeEntitiesType_types_tuple
from launch.core.some_substitutions_type import SomeSubstitutionsType, SomeSubstitutionsType_types_tuple
from launch.core.substitution import Substitution
from launch.events.event import Event
from launch.launch_service import LaunchService

__all__ = [
    "Action",
    "Condition",
    "Event",
    "EventHandler",
    "InvalidLaunchFileError",
    "LaunchContext",
    "LaunchDescription",
    "LaunchDescriptionEntity",
    "LaunchDescriptionSource",
    "LaunchError",
    "LaunchService",
    "SomeEntitiesType",
    "SomeEntitiesType_types_tuple",
    "SomeSubstitutionsType",
    "SomeSubstitutionsType_types_tuple",
    "Substitution",
    "actions",
    "conditions",
    "event_handlers",
    "events",
    "launch_description_sources",
    "logging",
    "substitutions",
]
