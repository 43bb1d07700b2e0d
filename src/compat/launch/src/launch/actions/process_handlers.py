# SPDX-License-Identifier: BSD-3-Clause
"""Event handlers for starts and exits of processes, and for the shutdown of the launch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from launch.core.errors import LaunchError, line_of_launch_file
from launch.core.event_handler import BaseEventHandler
from launch.core.launch_context import LaunchContext
from launch.core.some_entities_type import SomeEntitiesType
from launch.core.utilities import normalize_to_list_of_entities
from launch.events import Shutdown
from launch.events.event import Event
from launch.events.process import ProcessExited, ProcessStarted, RunningProcessEvent

__all__ = ["OnProcessExit", "OnProcessStart", "OnShutdown"]

Reaction = SomeEntitiesType | Callable[[Any, LaunchContext], SomeEntitiesType | None]


class _Handler(BaseEventHandler):
    """Visits entities, or the result of a function, after events of a class.

    Args:
        event_class: Class of the events.
        target: Action of the process, or a function that returns whether an action matches; None for all processes.
        reaction: Entities, or a function of event and context that returns entities.
        handle_once: Whether the handler is removed after the first event.
    """

    def __init__(self, event_class: type[Event], target: Any, reaction: Reaction, handle_once: bool) -> None:
        super().__init__(matcher=lambda event: isinstance(event, event_class) and self._matches_target(event))
        self._handle_once = handle_once
        self._target = target
        self._function = reaction if callable(reaction) else None
        self._entities = [] if callable(reaction) else normalize_to_list_of_entities(reaction)

    def _matches_target(self, event: Event) -> bool:
        if self._target is None or not isinstance(event, RunningProcessEvent):
            return True
        return bool(self._target(event.action)) if callable(self._target) else event.action is self._target

    def described_entities(self) -> SomeEntitiesType | None:
        return self._entities

    def handle(self, event: Event, context: LaunchContext) -> SomeEntitiesType | None:
        super().handle(event, context)
        return self._entities if self._function is None else self._function(event, context)


def _check_target(target: Any, handler: str) -> None:
    if target is not None and not callable(target) and not hasattr(target, "process_request"):
        raise LaunchError(
            f"{line_of_launch_file()}: {handler}: target_action is {target!r}; allowed: an ExecuteProcess or Node "
            "object, a function of an action, or None for all processes"
        )


class OnProcessExit(_Handler):
    """Handles the exit of a process.

    Args:
        target_action: Action of the process, or a function that returns whether an action matches; None for all.
        on_exit: Entities, or a function of the ProcessExited event and the context that returns entities.
        handle_once: Whether only the first exit is handled.
    """

    def __init__(self, *, target_action: Any = None, on_exit: Reaction, handle_once: bool = False) -> None:
        _check_target(target_action, "OnProcessExit")
        super().__init__(ProcessExited, target_action, on_exit, handle_once)


class OnProcessStart(_Handler):
    """Handles the start of a process.

    Args:
        target_action: Action of the process, or a function that returns whether an action matches; None for all.
        on_start: Entities, or a function of the ProcessStarted event and the context that returns entities.
        handle_once: Whether only the first start is handled.
    """

    def __init__(self, *, target_action: Any = None, on_start: Reaction, handle_once: bool = False) -> None:
        _check_target(target_action, "OnProcessStart")
        super().__init__(ProcessStarted, target_action, on_start, handle_once)


class OnShutdown(_Handler):
    """Handles the shutdown of the launch, before the processes are stopped.

    Args:
        on_shutdown: Entities, or a function of the Shutdown event and the context that returns entities.
        handle_once: Accepted without effect; a launch shuts down only once.
    """

    def __init__(self, *, on_shutdown: Reaction, handle_once: bool = False) -> None:
        super().__init__(Shutdown, None, on_shutdown, handle_once)
