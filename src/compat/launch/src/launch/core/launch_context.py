# SPDX-License-Identifier: BSD-3-Clause
"""Launch context: the configurations, environment, event handlers and requests while a description is launched."""

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
    """What the context needs of a substitution."""

    def perform(self, context: LaunchContext) -> str:
        """Returns its text."""


class _EventHandler(Protocol):
    """What the context needs of an event handler."""

    def matches(self, event: Event) -> bool:
        """Returns whether an event concerns it."""


class _Locals:
    """Values by attribute, read only."""

    def __init__(self, values: dict[str, Any]) -> None:
        object.__setattr__(self, "_values", values)

    def __getattr__(self, key: str) -> Any:
        values = object.__getattribute__(self, "_values")
        if key not in values:
            raise AttributeError(f"context.locals has no '{key}'; there are: {listed(values)}")
        return values[key]

    def __setattr__(self, key: str, value: Any) -> None:
        raise AttributeError(f"context.locals.{key} cannot be set; use context.extend_locals")


class LaunchContext:
    """Everything that entities read and write when they are visited.

    Args:
        argv: Arguments of the launch.
        noninteractive: Whether nobody sits at the terminal.

    Attributes:
        parameters: Parameters to set before the next processes start.
        requests: Processes to start, in order.
        new_timers: TimerActions to run from now.
        declared_arguments: Names of the launch arguments visited so far.
        read_configurations: Names of the launch configurations that were read so far.
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
        """Values of the launch configurations of this scope, by name."""
        return self._configurations

    def read_configuration(self, name: str) -> Any:
        """Returns the value of a launch configuration; None when it is not set."""
        self.read_configurations.add(name)
        return self._configurations.get(name)

    def push_launch_configurations(self) -> None:
        """Begins a scope: what is set in it is forgotten at its end."""
        self._configuration_stack.append(self._configurations)
        self._configurations = dict(self._configurations)

    def pop_launch_configurations(self) -> None:
        """Ends a scope.

        Raises:
            LaunchError: None was begun.
        """
        if not self._configuration_stack:
            raise LaunchError("PopLaunchConfigurations without a PushLaunchConfigurations before it")
        self._configurations = self._configuration_stack.pop()

    @contextmanager
    def scope(self, configurations: dict[str, Any]) -> Iterator[None]:
        """Puts a scope back that has ended, for what was written in it and happens later."""
        now, self._configurations = self._configurations, configurations
        try:
            yield
        finally:
            self._configurations = now

    @property
    def environment(self) -> MutableMapping[str, str]:
        """The environment of the launch, which processes get."""
        return os.environ

    def push_environment(self) -> None:
        """Begins a scope of the environment."""
        self._environment_stack.append(dict(os.environ))

    def pop_environment(self) -> None:
        """Ends a scope of the environment.

        Raises:
            LaunchError: None was begun.
        """
        if not self._environment_stack:
            raise LaunchError("PopEnvironment without a PushEnvironment before it")
        _set_environment(self._environment_stack.pop())

    def reset_environment(self) -> None:
        """Puts the environment back that the launch began with."""
        _set_environment(self._first_environment)

    @property
    def locals(self) -> Any:
        """Values by attribute, among them `event` in an event handler."""
        return _Locals(self.get_locals_as_dict())

    def get_locals_as_dict(self) -> dict[str, Any]:
        """Returns the values of `locals` by name."""
        return {**self._globals, **self._locals}

    def extend_locals(self, extensions: dict[str, Any]) -> None:
        """Sets values of `locals`, until the end of an event's handling."""
        self._locals = {**self._locals, **extensions}

    def extend_globals(self, extensions: dict[str, Any]) -> None:
        """Sets values of `locals` for good."""
        self._globals = {**self._globals, **extensions}

    @contextmanager
    def local_scope(self) -> Iterator[None]:
        """Forgets what is set in `locals` inside."""
        before = self._locals
        try:
            yield
        finally:
            self._locals = before

    def register_event_handler(self, event_handler: _EventHandler, append: bool = False) -> None:
        """Adds an event handler, before the others or after them; it keeps the configurations of this scope."""
        self._handlers.insert(len(self._handlers) if append else 0, (event_handler, self._configurations))

    def unregister_event_handler(self, event_handler: _EventHandler) -> None:
        """Removes an event handler.

        Raises:
            LaunchError: It was not registered.
        """
        kept = [entry for entry in self._handlers if entry[0] is not event_handler]
        if len(kept) == len(self._handlers):
            raise LaunchError(f"the event handler {type(event_handler).__name__} is not registered")
        self._handlers = kept

    def handlers_of(self, event: Event) -> list[tuple[Any, dict[str, Any]]]:
        """Returns the event handlers that an event concerns, each with the configurations of its scope."""
        return [entry for entry in self._handlers if entry[0].matches(event)]

    def would_handle_event(self, event: Event) -> bool:
        """Returns whether an event concerns any handler."""
        return bool(self.handlers_of(event))

    def emit_event_sync(self, event: Event) -> None:
        """Lets an event happen, after those that are waiting."""
        self._events.append(event)

    def next_event(self) -> Event | None:
        """Takes the event that waits longest; None when there is none."""
        return self._events.popleft() if self._events else None

    def perform_substitution(self, substitution: _Substitution) -> str:
        """Returns the text of a substitution."""
        return substitution.perform(self)


def _set_environment(values: dict[str, str]) -> None:
    os.environ.clear()
    os.environ.update(values)
