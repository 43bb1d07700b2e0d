# SPDX-License-Identifier: BSD-3-Clause
"""Events of processes: start and exit, and requests to stop or signal a process."""

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
    """Event of a process.

    Attributes:
        action: Action that started the process.
        name: Name of the process in messages.
        cmd: Program and arguments.
        pid: Process id.
        cwd: Working folder; None for the folder of the launch.
        env: Environment variables.
    """

    action: Any
    name: str
    cmd: list[str]
    pid: int
    cwd: str | None = None
    env: dict[str, str] = field(default_factory=dict)

    @property
    def process_name(self) -> str:
        """Returns the name of the process."""
        return self.name


@dataclass(eq=False)
class ProcessStarted(RunningProcessEvent):
    """A process has started or restarted."""


@dataclass(eq=False)
class ProcessExited(RunningProcessEvent):
    """A process has ended.

    Attributes:
        returncode: Exit code; the negative signal number if a signal ended the process.
    """

    returncode: int = 0


class ShutdownProcess(Event):
    """Stops processes with SIGINT, and after timeouts with SIGTERM and SIGKILL.

    Args:
        process_matcher: Function that returns whether the process of an action is selected.
    """

    def __init__(self, *, process_matcher: Callable[[Any], bool]) -> None:
        self.process_matcher = process_matcher


class SignalProcess(Event):
    """Sends a signal to processes.

    Args:
        signal_number: Number or name (`SIGUSR1`) of the signal.
        process_matcher: Function that returns whether the process of an action is selected.
    """

    def __init__(self, *, signal_number: str | int | signal.Signals, process_matcher: Callable[[Any], bool]) -> None:
        named = isinstance(signal_number, str)
        self.signal = signal.Signals[str(signal_number)] if named else signal.Signals(int(signal_number))
        self.process_matcher = process_matcher
