# SPDX-License-Identifier: BSD-3-Clause
"""Events of the launch: shutdown and due timers; `launch.events.process` contains the events of processes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from launch.events import process
from launch.events.event import Event

__all__ = ["Shutdown", "TimerEvent", "matches_action", "process"]


class Shutdown(Event):
    """Shuts the launch down.

    Args:
        reason: Reason for the message.
        due_to_sigint: Whether a user requested the shutdown with Ctrl-C.
        exit_code: Exit code of the launch.
    """

    def __init__(self, *, reason: str = "reason not given", due_to_sigint: bool = False, exit_code: int = 0) -> None:
        self.reason = reason
        self.due_to_sigint = due_to_sigint
        self.exit_code = exit_code


class TimerEvent(Event):
    """A timer is due.

    Args:
        timer_action: TimerAction of the timer.
    """

    def __init__(self, *, timer_action: Any) -> None:
        self.timer_action = timer_action


def matches_action(target_action: Any) -> Callable[[Any], bool]:
    """Returns a function that returns whether an action is `target_action`."""
    return lambda action: action is target_action
