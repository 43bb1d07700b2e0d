# SPDX-License-Identifier: BSD-3-Clause
"""Public name of the base class of events."""

from launch.events.event import Event as Event
