# SPDX-License-Identifier: BSD-3-Clause
"""Launch context, with configurations, environment, event handlers and requests of a running launch."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Iterable, Iterator, MutableMapping
from contextlib import contextmanager
from typing import Any, Protocol

from launch.core.errors import LaunchError, listed
from launch.core.parameter_plan import ParameterPlan
from launch.core.process_request import ProcessRequest
from launch.events.event import Event


class _Substitution(Protocol):
    """Interface of a substitution."""

    def perform(self, context: LaunchContext) -> str:
        """Returns the text of the substitution."""


class _EventHandler(Protocol):
    """Interface of an event handler."""

    def matches(self, event: Event) -> bool:
        """Returns whether the handler applies to an event."""


class _Locals:
    """Read-only access to values by attribute."""

    def __init__(self, values: dict[str, Any]) -> None:
        object.__setattr__(self, "_values", values)

    def __getattr__(self, key: str) -> Any:
        values = object.__getattribute__(self, "_values")
        if key not in values:
            raise AttributeError(f"context.locals has no '{key}'; known: {listed(values)}")
        return values[key]

    def __setattr__(self, key: str, value: Any) -> None:
        raise AttributeError(f"context.locals.{key} cannot be set; use context.extend_locals")


class LaunchContext:
    """State of a launch, read and modified by the visited entities.

    Args:
        argv: Arguments of the launch.
        noninteractive: Whether the launch runs without a user at a terminal.

    Attributes:
        parameters: Parameters to set before the next processes start.
        requests: Processes to start, in order.
        new_timers: TimerActions to start.
        declared_arguments: Names of the visited launch arguments.
        read_configurations: Names of the launch configurations that were read.
    """

    def __init__(self, *, argv: Iterable[str] | None = None, noninteractive: bool = False) -> None:
        self.argv = list(argv or ())
        self.noninteractive = noninteractive
        self.parameters = ParameterPlan()
        self.requests: list[ProcessRequest] = []
        self.new_timers: list[Any] = []
        self.declared_arguments: set[str] = set()
        self.read_configurations: set[str] = set()
        self.is_shutdown = False
        self._events: deque[Event] = deque()
        self._handlers: list[tuple[Any, dict[str, Any]]] = []
        self._configurations: dict[str, Any] = {}
        self._configuration_stack: list[dict[str, Any]] = []
        self._environment_stack: list[dict[str, str]] = []
        self._first_environment = dict(os.environ)
        self._globals: dict[str, Any] = {}
        self._locals: dict[str, Any] = {}

    @property
    def launch_configurations(self) -> dict[str, Any]:
        """Returns the launch configurations of the current scope, by name."""
        return self._configurations

    def read_configuration(self, name: str) -> Any:
        """Returns the value of a launch configuration; None if not set."""
        self.read_configurations.add(name)
        return self._configurations.get(name)

    def push_launch_configurations(self) -> None:
        """Starts a scope of launch configurations, whose changes end with the scope."""
        self._configuration_stack.append(self._configurations)
        self._configurations = dict(self._configurations)

    def pop_launch_configurations(self) -> None:
        """Ends a scope of launch configurations.

        Raises:
            LaunchError: No scope was started.
        """
        if not self._configuration_stack:
            raise LaunchError("PopLaunchConfigurations without a PushLaunchConfigurations before it")
        self._configurations = self._configuration_stack.pop()

    @contextmanager
    def scope(self, configurations: dict[str, Any]) -> Iterator[None]:
        """Temporarily restores the launch configurations of an ended scope, for later actions of this scope."""
        now, self._configurations = self._configurations, configurations
        try:
            yield
        finally:
            self._configurations = now

    @property
    def environment(self) -> MutableMapping[str, str]:
        """Returns the environment variables of the launch, which processes inherit."""
        return os.environ

    def push_environment(self) -> None:
        """Starts a scope of the environment."""
        self._environment_stack.append(dict(os.environ))

    def pop_environment(self) -> None:
        """Ends a scope of the environment.

        Raises:
            LaunchError: No scope was started.
        """
        if not self._environment_stack:
            raise LaunchError("PopEnvironment without a PushEnvironment before it")
        _set_environment(self._environment_stack.pop())

    def reset_environment(self) -> None:
        """Restores the initial environment of the launch."""
        _set_environment(self._first_environment)

    @property
    def locals(self) -> Any:
        """Returns local values as attributes; in an event handler, `event` is the event."""
        return _Locals(self.get_locals_as_dict())

    def get_locals_as_dict(self) -> dict[str, Any]:
        """Returns the local and global values by name."""
        return {**self._globals, **self._locals}

    def extend_locals(self, extensions: dict[str, Any]) -> None:
        """Adds local values, which end with the handling of an event."""
        self._locals = {**self._locals, **extensions}

    def extend_globals(self, extensions: dict[str, Any]) -> None:
        """Adds global values, which never end."""
        self._globals = {**self._globals, **extensions}

    @contextmanager
    def local_scope(self) -> Iterator[None]:
        """Discards local values that are added inside the context."""
        before = self._locals
        try:
            yield
        finally:
            self._locals = before

    def register_event_handler(self, event_handler: _EventHandler, append: bool = False) -> None:
        """Adds an event handler, which keeps the configurations of the current scope.

        Args:
            event_handler: The handler.
            append: Whether the handler is called after the other handlers instead of before them.
        """
        self._handlers.insert(len(self._handlers) if append else 0, (event_handler, self._configurations))

    def unregister_event_handler(self, event_handler: _EventHandler) -> None:
        """Removes an event handler.

        Raises:
            LaunchError: The handler is not registered.
        """
        kept = [entry for entry in self._handlers if entry[0] is not event_handler]
        if len(kept) == len(self._handlers):
            raise LaunchError(f"the event handler {type(event_handler).__name__} is not registered")
        self._handlers = kept

    def handlers_of(self, event: Event) -> list[tuple[Any, dict[str, Any]]]:
        """Returns the handlers of an event, with the configurations of their scopes."""
        return [entry for entry in self._handlers if entry[0].matches(event)]

    def would_handle_event(self, event: Event) -> bool:
        """Returns whether an event has a handler."""
        return bool(self.handlers_of(event))

    def emit_event_sync(self, event: Event) -> None:
        """Adds an event to the queue."""
        self._events.append(event)

    def next_event(self) -> Event | None:
        """Removes and returns the oldest event of the queue; None for an empty queue."""
        return self._events.popleft() if self._events else None

    def perform_substitution(self, substitution: _Substitution) -> str:
        """Returns the text of a substitution."""
        return substitution.perform(self)


def _set_environment(values: dict[str, str]) -> None:
    os.environ.clear()
    os.environ.update(values)
