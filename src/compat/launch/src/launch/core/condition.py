# SPDX-License-Identifier: BSD-3-Clause
"""Condition: decides, while launching, whether an action is carried out."""

from __future__ import annotations

from collections.abc import Callable

from launch.core.launch_context import LaunchContext


class Condition:
    """A predicate over the launch context; without one it is false.

    Args:
        predicate: Called with the context; returns the truth.
    """

    def __init__(self, *, predicate: Callable[[LaunchContext], bool] | None = None) -> None:
        self._predicate = predicate

    def describe(self) -> str:
        """Returns a short text for messages."""
        return f"{type(self).__name__}()"

    def evaluate(self, context: LaunchContext) -> bool:
        """Returns the truth in a context."""
        return self._predicate is not None and self._predicate(context)
