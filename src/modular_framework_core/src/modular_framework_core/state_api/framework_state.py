# SPDX-License-Identifier: BSD-3-Clause
"""Base class of states with reasons for failures and with interruptible waits.

A plain ``smach.State`` returns only an outcome, without the reason of a failure, and its waits ignore preemption unless
the author polls for it. A preempted ``FrameworkState`` ends its own waits and its calls of services and actions through
``modular_framework_ros.calls``. Example::

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
from collections.abc import Callable, Iterable
from typing import Any, ClassVar

import smach
from modular_framework_core.state_api.constructor_keys import STATE_KEYS
from modular_framework_core.state_api.option_checks import checks_options
from modular_framework_ros.calls import MotionTimeout
from modular_framework_ros.stop_requests import stoppable

DEFAULT_OUTCOMES = ("success", "fail")


class FrameworkState(smach.State):
    """A state whose first outcome is positive and whose last outcome is negative.

    Attributes:
        DEFAULT_IO_KEYS: Default of ``io_keys``.
        outcomes: Outcomes in declared order.
        reason: Reason why the last execution did not succeed; "" after a success or before the first execution.
        feedback: Description of the current activity, which a running state may set for viewers of the task.
    """

    DEFAULT_IO_KEYS: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **options: Any) -> None:
        """Adds the check of the options to ``__init__`` and the end of waits on preemption to ``execute``."""
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
            outcomes: At least two names; the first is positive, the last negative.
            input_keys: Userdata keys that the state only reads; ordinary Python objects arrive read-only.
            output_keys: Userdata keys that the state only writes.
            io_keys: Userdata keys that the state reads and writes, including commanders and clients whose methods the
                state calls. None for ``DEFAULT_IO_KEYS``.

        Raises:
            ValueError: There are fewer than two outcomes, or an outcome occurs twice.
        """
        names = [outcomes] if isinstance(outcomes, str) else list(outcomes)
        if len(names) < 2 or len(set(names)) != len(names):
            raise ValueError(
                f"{type(self).__name__}: outcomes are {names}; give at least two different names, "
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
        """Stores and logs the reason of a failure, and returns the negative outcome.

        If the state was preempted, ``stopped`` is called instead, because the preemption may have caused the failure.

        Args:
            reason: Sentence with the attempted step, the result and the expected result.
        """
        if self.stop_requested():
            return self.stopped()
        self.reason = reason
        smach.logwarn(f"{type(self).__name__}: {reason}")
        return self.outcomes[-1]

    def end(self, outcome: str, reason: str) -> str:
        """Logs the reason of an intermediate outcome and returns the outcome; the last outcome counts as a failure.

        Args:
            outcome: One of the state's outcomes.
            reason: Reason for this outcome.
        """
        if outcome == self.outcomes[-1]:
            return self.fail(reason)
        self.reason = ""
        smach.loginfo(f"{type(self).__name__}: {outcome}: {reason}")
        return outcome

    def stop_requested(self) -> bool:
        """Returns whether a stop of this state or of the task was requested."""
        return bool(self.preempt_requested()) or smach.is_shutdown()

    def stopped(self) -> str:
        """Acknowledges a preemption and returns ``preempted`` if declared, otherwise the negative outcome."""
        self.service_preempt()
        self.reason = "stopped on request"
        return "preempted" if "preempted" in self.outcomes else self.outcomes[-1]

    def wait_until(self, condition: Callable[[], bool], timeout_s: float | None, period_s: float = 0.02) -> bool:
        """Waits for a condition, a preemption or the timeout.

        Args:
            condition: Function evaluated every ``period_s`` seconds.
            timeout_s: Timeout [s of the slower of real time and the ROS clock]; None for no timeout.
            period_s: Polling period [s].

        Returns:
            Whether the condition held. If False, ``stop_requested()`` distinguishes preemption from a timeout.
        """
        timeout = None if timeout_s is None else MotionTimeout(timeout_s)
        while not self.stop_requested():
            if condition():
                return True
            if timeout is not None and timeout.is_exceeded():
                return False
            self._preempt_event.wait(period_s)
        return False

    def request_preempt(self) -> None:
        """Asks the state to stop. States that move hardware extend this method to cancel the motion at once."""
        super().request_preempt()
        self._preempt_event.set()

    def recall_preempt(self) -> None:
        """Withdraws the preemption request."""
        super().recall_preempt()
        self._preempt_event.clear()

    def service_preempt(self) -> None:
        """Marks the preemption request as handled."""
        super().service_preempt()
        self._preempt_event.clear()


def _stoppable(execute: Callable[[Any, Any], str]) -> Callable[[Any, Any], str]:
    @functools.wraps(execute)
    def execute_stoppable(state: FrameworkState, userdata: Any) -> str:
        with stoppable(state.stop_requested):
            return execute(state, userdata)

    return execute_stoppable
