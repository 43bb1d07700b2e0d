# SPDX-License-Identifier: BSD-3-Clause
"""Public names of event handlers."""

from launch.core.event_handler import BaseEventHandler as BaseEventHandler
from launch.core.event_handler import EventHandler as EventHandler
