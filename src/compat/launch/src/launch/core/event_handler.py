# SPDX-License-Identifier: BSD-3-Clause
"""Event handler, which determines the entities to visit after an event."""

from __future__ import annotations

from collections.abc import Callable

from launch.core.launch_context import LaunchContext
from launch.core.some_entities_type import SomeEntitiesType
from launch.core.utilities import normalize_to_list_of_entities
from launch.events.event import Event


class BaseEventHandler:
    """Base class of event handlers; entities read the event as `context.locals.event`.

    Args:
        matcher: Function that returns whether the handler applies to an event.
        handle_once: Whether the handler is removed after the first event.
    """

    def __init__(self, *, matcher: Callable[[Event], bool], handle_once: bool = False) -> None:
        self._matcher = matcher
        self._handle_once = handle_once

    @property
    def handle_once(self) -> bool:
        """Returns whether the handler is removed after the first event."""
        return self._handle_once

    def matches(self, event: Event) -> bool:
        """Returns whether the handler applies to an event."""
        return self._matcher(event)

    def handle(self, event: Event, context: LaunchContext) -> SomeEntitiesType | None:
        """Returns the entities to visit after an event."""
        context.extend_locals({"event": event})
        return None

    def described_entities(self) -> SomeEntitiesType | None:
        """Returns the entities that are known before any event."""
        return None


class EventHandler(BaseEventHandler):
    """Event handler that visits the same entities after each event.

    Args:
        matcher: Function that returns whether the handler applies to an event.
        entities: Entities to visit.
        handle_once: Whether the handler is removed after the first event.
    """

    def __init__(
        self,
        *,
        matcher: Callable[[Event], bool],
        entities: SomeEntitiesType | None = None,
        handle_once: bool = False,
    ) -> None:
        super().__init__(matcher=matcher, handle_once=handle_once)
        self._entities = None if entities is None else normalize_to_list_of_entities(entities)

    @property
    def entities(self) -> SomeEntitiesType | None:
        """Returns the entities to visit."""
        return self._entities

    def described_entities(self) -> SomeEntitiesType | None:
        return self._entities

    def handle(self, event: Event, context: LaunchContext) -> SomeEntitiesType | None:
        super().handle(event, context)
        return self._entities
