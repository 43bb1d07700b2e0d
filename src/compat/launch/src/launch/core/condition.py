# SPDX-License-Identifier: BSD-3-Clause
"""Condition, which decides during the launch whether an action is executed."""

from __future__ import annotations

from collections.abc import Callable

from launch.core.launch_context import LaunchContext


class Condition:
    """Predicate over the launch context; false without a predicate.

    Args:
        predicate: Function that is called with the context and returns whether the condition holds.
    """

    def __init__(self, *, predicate: Callable[[LaunchContext], bool] | None = None) -> None:
        self._predicate = predicate

    def describe(self) -> str:
        """Returns a short text for messages."""
        return f"{type(self).__name__}()"

    def evaluate(self, context: LaunchContext) -> bool:
        """Returns whether the condition holds in a context."""
        return self._predicate is not None and self._predicate(context)
