# SPDX-License-Identifier: BSD-3-Clause
"""States that tests put into containers."""

from __future__ import annotations

import threading
from typing import Any

import smach


class Give(smach.State):
    """Gives the outcomes it was made with, one an execution; the last one again and again."""

    def __init__(self, *given: str, outcomes: tuple[str, ...] = ("success", "fail")) -> None:
        super().__init__(outcomes=outcomes)
        self._given = list(given or outcomes[:1])
        self.executions = 0

    def execute(self, userdata: Any) -> str:
        self.executions += 1
        return self._given.pop(0) if len(self._given) > 1 else self._given[0]


class Stay(smach.State):
    """Runs until it is asked to stop; services the request unless configured otherwise."""

    def __init__(self, services: bool = True, outcomes: tuple[str, ...] = ("success", "preempted")) -> None:
        super().__init__(outcomes=outcomes)
        self._services = services
        self.started = threading.Event()
        self._asked = threading.Event()

    def execute(self, userdata: Any) -> str:
        self.started.set()
        assert self._asked.wait(10.0), "nobody asked the state to stop"
        self._asked.clear()
        if self._services:
            self.service_preempt()
        return "preempted"

    def request_preempt(self) -> None:
        super().request_preempt()
        self._asked.set()


class Raise(smach.State):
    """Raises."""

    def __init__(self) -> None:
        super().__init__(outcomes=["success"])

    def execute(self, userdata: Any) -> str:
        raise ValueError("a spring broke")


class InThread:
    """Executes a container in a thread."""

    def __init__(self, container: smach.Container) -> None:
        self.outcome: str | None = None
        self.error: Exception | None = None
        self._container = container
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            self.outcome = self._container.execute()
        except Exception as error:
            self.error = error

    def end(self, timeout_s: float = 5.0) -> str | None:
        self._thread.join(timeout_s)
        assert not self._thread.is_alive(), "the container still runs"
        if self.error is not None:
            raise self.error
        return self.outcome
