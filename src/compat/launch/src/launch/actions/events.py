# SPDX-License-Identifier: BSD-3-Clause
"""Actions on events: event handlers, emitted events, the shutdown of the launch, and timers."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from launch.core.action import Action
from launch.core.errors import LaunchError, require_type
from launch.core.event_handler import BaseEventHandler
from launch.core.launch_context import LaunchContext
from launch.core.launch_description_entity import LaunchDescriptionEntity
from launch.core.screen_log import get_logger
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.utilities import normalize_to_list_of_entities, perform_number, perform_text
from launch.events import Shutdown as ShutdownEvent
from launch.events.event import Event
from launch.events.process import ProcessExited

EXIT_NODE_DIED = 3
"""Exit code of a launch that ended because a process failed."""


class _EventHandlerAction(Action):
    """Base class of actions on an event handler.

    Args:
        event_handler: The event handler.
    """

    def __init__(self, event_handler: BaseEventHandler, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        if not isinstance(event_handler, BaseEventHandler):
            raise TypeError(
                f"{self.where}: {type(self).__name__}: got {event_handler!r}; allowed: an event handler of "
                "launch.event_handlers"
            )
        self._handler = event_handler

    @property
    def event_handler(self) -> BaseEventHandler:
        """Returns the event handler."""
        return self._handler


class RegisterEventHandler(_EventHandlerAction):
    """Registers an event handler."""

    def execute(self, context: LaunchContext) -> None:
        context.register_event_handler(self._handler)

    def describe_conditional_sub_entities(self) -> list[tuple[str, Iterable[LaunchDescriptionEntity]]]:
        return [(type(self._handler).__name__, normalize_to_list_of_entities(self._handler.described_entities()))]


class UnregisterEventHandler(_EventHandlerAction):
    """Removes a registered event handler."""

    def execute(self, context: LaunchContext) -> None:
        context.unregister_event_handler(self._handler)


class EmitEvent(Action):
    """Emits an event.

    Args:
        event: The event.
    """

    def __init__(self, *, event: Event, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        require_type(event, Event, f"{self.where}: EmitEvent: event", "an event of launch.events")
        self._event = event

    @property
    def event(self) -> Event:
        """Returns the event."""
        return self._event

    def execute(self, context: LaunchContext) -> None:
        context.emit_event_sync(self._event)


class Shutdown(Action):
    """Shuts the launch down; as `on_exit` of a node, this action makes the node required.

    Args:
        reason: Reason for the message.
    """

    def __init__(self, *, reason: SomeSubstitutionsType = "reason not given", **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._reason = reason

    def execute(self, context: LaunchContext) -> None:
        event = context.get_locals_as_dict().get("event")
        reason, exit_code = perform_text(context, self._reason), 0
        if isinstance(event, ProcessExited):
            get_logger().info("required process [%s] has ended: the launch shuts down", event.process_name)
            exit_code = EXIT_NODE_DIED if event.returncode else 0
        context.emit_event_sync(ShutdownEvent(reason=reason, exit_code=exit_code))


class TimerAction(Action):
    """Executes actions once after a delay.

    Args:
        period: Delay [s].
        actions: Actions to execute.
        cancel_on_shutdown: Accepted without effect; a shutdown always cancels all timers.
    """

    def __init__(
        self,
        *,
        period: float | SomeSubstitutionsType,
        actions: Iterable[LaunchDescriptionEntity],
        cancel_on_shutdown: bool | SomeSubstitutionsType = True,
        **kwargs: Any,
    ) -> None:
        super().__init__(**kwargs)
        del cancel_on_shutdown
        self._period = period
        self._actions = normalize_to_list_of_entities(actions)
        self._cancelled = False
        self.period_s = 0.0
        self.configurations: dict[str, Any] = {}

    @property
    def actions(self) -> list[LaunchDescriptionEntity]:
        """Returns the actions to execute."""
        return self._actions

    @property
    def cancelled(self) -> bool:
        """Returns whether the timer was cancelled."""
        return self._cancelled

    def cancel(self) -> None:
        """Cancels the timer."""
        self._cancelled = True

    def execute(self, context: LaunchContext) -> None:
        self.period_s = perform_number(context, self._period, "the period of the TimerAction")
        if self.period_s < 0.0:
            raise LaunchError(f"the period of the TimerAction is {self.period_s} s; allowed: 0 or more")
        self.configurations = context.launch_configurations
        context.new_timers.append(self)

    def describe_conditional_sub_entities(self) -> list[tuple[str, Iterable[LaunchDescriptionEntity]]]:
        return [("TimerAction", self._actions)]
