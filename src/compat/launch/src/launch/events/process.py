# SPDX-License-Identifier: BSD-3-Clause
"""Events of processes: started, ended, and what asks a process to end or sends it a signal."""

from __future__ import annotations

import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from launch.events.event import Event

__all__ = [
    "ProcessExited",
    "ProcessStarted",
    "RunningProcessEvent",
    "ShutdownProcess",
    "SignalProcess",
]


@dataclass(eq=False)
class RunningProcessEvent(Event):
    """Something happened to a process.

    Attributes:
        action: The action that started it.
        name: Its name in messages.
        cmd: Its command.
        pid: Its process id.
        cwd: Its working folder; None for that of the launch.
        env: Its environment.
    """

    action: Any
    name: str
    cmd: list[str]
    pid: int
    cwd: str | None = None
    env: dict[str, str] = field(default_factory=dict)

    @property
    def process_name(self) -> str:
        """Name of the process."""
        return self.name


@dataclass(eq=False)
class ProcessStarted(RunningProcessEvent):
    """A process has started, or started again."""


@dataclass(eq=False)
class ProcessExited(RunningProcessEvent):
    """A process has ended by itself.

    Attributes:
        returncode: Its exit code; minus the number of the signal that ended it.
    """

    returncode: int = 0


class ShutdownProcess(Event):
    """Asks processes to end: SIGINT, and after the timeouts SIGTERM and SIGKILL.

    Args:
        process_matcher: Called with an action; returns whether its process is meant.
    """

    def __init__(self, *, process_matcher: Callable[[Any], bool]) -> None:
        self.process_matcher = process_matcher


class SignalProcess(Event):
    """Sends a signal to processes.

    Args:
        signal_number: Number or name (`SIGUSR1`) of the signal.
        process_matcher: Called with an action; returns whether its process is meant.
    """

    def __init__(self, *, signal_number: str | int | signal.Signals, process_matcher: Callable[[Any], bool]) -> None:
        named = isinstance(signal_number, str)
        self.signal = signal.Signals[str(signal_number)] if named else signal.Signals(int(signal_number))
        self.process_matcher = process_matcher
