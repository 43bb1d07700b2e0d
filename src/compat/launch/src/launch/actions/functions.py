# SPDX-License-Identifier: BSD-3-Clause
"""Actions that call a function of the launch file or log a message."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from launch.core.action import Action
from launch.core.launch_context import LaunchContext
from launch.core.launch_description_entity import LaunchDescriptionEntity
from launch.core.screen_log import get_logger
from launch.core.some_entities_type import SomeEntitiesType
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.substitution import Substitution
from launch.core.utilities import (
    normalize_to_list_of_entities,
    normalize_to_list_of_substitutions,
    perform_substitutions,
)


class OpaqueFunction(Action):
    """Calls a function with the launch context, and visits the returned entities.

    Args:
        function: Function that is called as `function(context, *args, **kwargs)` and returns entities or None.
        args: Further positional arguments.
        kwargs: Further keyword arguments.
    """

    def __init__(
        self,
        *,
        function: Callable[..., SomeEntitiesType | None],
        args: Iterable[Any] | None = None,
        kwargs: Mapping[str, Any] | None = None,
        **left_over_kwargs: Any,
    ) -> None:
        super().__init__(**left_over_kwargs)
        if not callable(function):
            raise TypeError(f"{self.where}: OpaqueFunction: function is {function!r}; allowed: a function")
        self._function = function
        self._args = tuple(args or ())
        self._kwargs = dict(kwargs or {})

    def describe(self) -> str:
        return f"OpaqueFunction({getattr(self._function, '__name__', self._function)})"

    def execute(self, context: LaunchContext) -> list[LaunchDescriptionEntity]:
        return normalize_to_list_of_entities(self._function(context, *self._args, **self._kwargs))


class LogInfo(Action):
    """Logs a message on the screen.

    Args:
        msg: The message.
    """

    def __init__(self, *, msg: SomeSubstitutionsType, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._msg = normalize_to_list_of_substitutions(msg)

    @property
    def msg(self) -> list[Substitution]:
        """Returns the message."""
        return self._msg

    def execute(self, context: LaunchContext) -> None:
        get_logger("launch.user").info("%s", perform_substitutions(context, self._msg))
