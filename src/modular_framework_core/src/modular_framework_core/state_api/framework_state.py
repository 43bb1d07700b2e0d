# SPDX-License-Identifier: BSD-3-Clause
"""The base of the framework's states: one way to succeed, to fail with a reason, and to stop when asked.

A plain ``smach.State`` only returns an outcome, so nobody learns why a task failed, and a state that waits
cannot be interrupted unless its author thought of it. ``FrameworkState`` settles both: its own waits, and calls of
services and actions through ``modular_framework_ros.calls`` below it, end when the state is asked to stop. A state is
written as::

    class OpenDoor(FrameworkState):
        DEFAULT_IO_KEYS = ("arm_commander",)

        def __init__(self, door_name: str, timeout: Positive = 5.0, **keys: Unpack[StateKeys]):
            super().__init__(**keys)
            ...

        def execute(self, userdata):
            if not self.wait_until(self._door_is_open, self._timeout):
                return self.fail(f"door '{self._door_name}' did not open within {self._timeout} s")
            return self.succeed()
"""

from __future__ import annotations

import functools
import threading
import time
from collections.abc import Callable, Iterable
from typing import Any, ClassVar

import smach
from modular_framework_core.state_api.constructor_keys import STATE_KEYS
from modular_framework_core.state_api.option_checks import checks_options
from modular_framework_ros.stop_requests import stoppable

DEFAULT_OUTCOMES = ("success", "fail")


class FrameworkState(smach.State):
    """A state whose first outcome is the positive one and whose last outcome is the negative one.

    Attributes:
        DEFAULT_IO_KEYS: Userdata keys that the state reads and writes unless it is given other ``io_keys``.
        outcomes: The outcomes in the order they were declared.
        reason: Why the last execution did not succeed; "" after a success or before the first execution.
        feedback: What the state is doing now, in words, for whoever watches the task; a state may set it while it runs.
    """

    DEFAULT_IO_KEYS: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **options: Any) -> None:
        """Checks options against their annotations; lets a request to stop end the waits in ``execute``."""
        super().__init_subclass__(**options)
        if "__init__" in vars(cls):
            cls.__init__ = checks_options(cls.__init__, without=STATE_KEYS)  # type: ignore[method-assign]
        if "execute" in vars(cls):
            cls.execute = _stoppable(cls.execute)  # type: ignore[assignment, method-assign]

    def __init__(
        self,
        outcomes: Iterable[str] = DEFAULT_OUTCOMES,
        input_keys: Iterable[str] = (),
        output_keys: Iterable[str] = (),
        io_keys: Iterable[str] | None = None,
    ) -> None:
        """Declares the interface of the state.

        Args:
            outcomes: Names of the outcomes, at least two; first = positive, last = negative.
            input_keys: Userdata keys that are only read (ordinary Python objects arrive read-only).
            output_keys: Userdata keys that are only written.
            io_keys: Userdata keys that are read and written; commanders and clients, whose methods the state
                calls, must be declared here. None for ``DEFAULT_IO_KEYS``.

        Raises:
            ValueError: When fewer than two different outcomes are given.
        """
        names = [outcomes] if isinstance(outcomes, str) else list(outcomes)
        if len(names) < 2 or len(set(names)) != len(names):
            raise ValueError(
                f"{type(self).__name__}: outcomes are {names}; needed are at least two different names, "
                "the first for success and the last for failure, for example [success, fail]"
            )
        super().__init__(
            outcomes=names,
            input_keys=list(input_keys),
            output_keys=list(output_keys),
            io_keys=list(self.DEFAULT_IO_KEYS if io_keys is None else io_keys),
        )
        self.outcomes = names
        self.reason = ""
        self.feedback = ""
        self._preempt_event = threading.Event()

    def succeed(self) -> str:
        """Returns the positive outcome."""
        self.reason = ""
        return self.outcomes[0]

    def fail(self, reason: str) -> str:
        """Records and logs why the state failed, and returns the negative outcome.

        A state that has been asked to stop counts as stopped: whatever it waited for was given up for that.

        Args:
            reason: One sentence: what was attempted, what was got, and what was expected.
        """
        if self.stop_requested():
            return self.stopped()
        self.reason = reason
        smach.logwarn(f"{type(self).__name__}: {reason}")
        return self.outcomes[-1]

    def end(self, outcome: str, reason: str) -> str:
        """Returns an outcome that is neither plain success nor plain failure; the last outcome counts as a failure.

        Args:
            outcome: One of the state's outcomes.
            reason: Why this one.
        """
        if outcome == self.outcomes[-1]:
            return self.fail(reason)
        self.reason = ""
        smach.loginfo(f"{type(self).__name__}: {outcome}: {reason}")
        return outcome

    def stop_requested(self) -> bool:
        """Returns whether this state, or the whole task, has been asked to stop."""
        return bool(self.preempt_requested()) or smach.is_shutdown()

    def stopped(self) -> str:
        """Acknowledges a request to stop; returns ``preempted`` where declared, the negative outcome otherwise."""
        self.service_preempt()
        self.reason = "stopped on request"
        return "preempted" if "preempted" in self.outcomes else self.outcomes[-1]

    def wait_until(self, condition: Callable[[], bool], timeout_s: float | None, period_s: float = 0.02) -> bool:
        """Waits for a condition, for a request to stop, or for the timeout, whichever comes first.

        Args:
            condition: Evaluated every ``period_s`` seconds.
            timeout_s: Longest wait [s, wall time]; None = no limit (a request to stop still ends it).
            period_s: Time between two evaluations [s].

        Returns:
            True when the condition held. When False, ``stop_requested()`` distinguishes a stop from a timeout.
        """
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while not self.stop_requested():
            if condition():
                return True
            if deadline is not None and time.monotonic() >= deadline:
                return False
            self._preempt_event.wait(period_s)
        return False

    def request_preempt(self) -> None:
        """Asks the state to stop. States that drive hardware extend this to cancel their motion at once."""
        super().request_preempt()
        self._preempt_event.set()

    def recall_preempt(self) -> None:
        """Withdraws the request to stop."""
        super().recall_preempt()
        self._preempt_event.clear()

    def service_preempt(self) -> None:
        """Marks the request to stop as handled."""
        super().service_preempt()
        self._preempt_event.clear()


def _stoppable(execute: Callable[[Any, Any], str]) -> Callable[[Any, Any], str]:
    @functools.wraps(execute)
    def execute_stoppable(state: FrameworkState, userdata: Any) -> str:
        with stoppable(state.stop_requested):
            return execute(state, userdata)

    return execute_stoppable
