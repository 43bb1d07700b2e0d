# SPDX-License-Identifier: BSD-3-Clause
"""Conversion between userdata and messages for states that call a server.

Goals and results of actions follow the same rules as requests and responses of services.
"""

from __future__ import annotations

import copy
import traceback
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import smach
from smach_ros.waiting import WallTimeLimit, going_down

__all__ = ["ServerCallState", "ExchangeError", "MessageSink", "MessageSource", "UserCallback"]

OUTCOMES = ("succeeded", "aborted", "preempted")


class ExchangeError(Exception):
    """A message could not be created or processed; the message gives the reason."""


class UserCallback:
    """A user function with its extra arguments and its view of the userdata."""

    def __init__(
        self,
        what: str,
        function: Any,
        args: Iterable[Any] = (),
        kwargs: Mapping[str, Any] | None = None,
        keys: tuple[Iterable[str], Iterable[str]] = ((), ()),
    ) -> None:
        """Checks and stores a function.

        Args:
            what: Name of the function in errors.
            function: User function, or None; a function of ``cb_interface`` declares its own keys and outcomes.
            args: Additional positional arguments.
            kwargs: Additional keyword arguments.
            keys: Readable and writable userdata keys, unless the function declares its own.

        Raises:
            smach.InvalidStateError: The function is not callable.
        """
        if function is not None and not callable(function):
            raise smach.InvalidStateError(f"{what} is a {type(function).__name__}; give a function, or None")
        self._what = what
        self._function = function
        self._args = tuple(args)
        self._kwargs = dict(kwargs or {})
        self.declares_interface = function is not None and smach.has_smach_interface(function)
        self.outcomes: tuple[str, ...] = ()
        self._input_keys, self._output_keys = tuple(keys[0]), tuple(keys[1])
        if self.declares_interface:
            self._input_keys = tuple(function.get_registered_input_keys())
            self._output_keys = tuple(function.get_registered_output_keys())
            self.outcomes = tuple(function.get_registered_outcomes())

    def register_on(self, state: smach.State, with_outcomes: bool) -> None:
        """Registers the function's own keys and, optionally, outcomes with a state."""
        if not self.declares_interface:
            return
        state.register_input_keys(self._input_keys)
        state.register_output_keys(self._output_keys)
        if with_outcomes:
            state.register_outcomes(self.outcomes)

    def call(self, userdata: Any, *values: Any) -> Any:
        """Calls the function with its view of the userdata; returns None without a function.

        Raises:
            ExchangeError: The function raised an error.
        """
        if self._function is None:
            return None
        view = smach.Remapper(userdata, self._input_keys, self._output_keys, {})
        try:
            return self._function(view, *values, *self._args, **self._kwargs)
        except Exception as error:
            smach.logerr(f"{self._what} raised:\n{traceback.format_exc()}")
            raise ExchangeError(f"{self._what} raised {type(error).__name__}: {error}") from error


def check_slots(label: str, message: Any, slots: Iterable[str]) -> tuple[str, ...]:
    """Returns names of fields; raises ``smach.InvalidStateError`` for unknown fields.

    Args:
        label: Name of the argument in errors.
        message: Message with the allowed fields.
        slots: Names of fields.
    """
    if isinstance(slots, str):
        raise smach.InvalidStateError(f"{label} must be a list of field names, got the string '{slots}'")
    names = tuple(slots)
    unknown = [name for name in names if name not in message.__slots__]
    if unknown:
        raise smach.InvalidStateError(
            f"{label}: {unknown} are no fields of {message._type}; its fields are {list(message.__slots__)}"
        )
    return names


class _MessageRules:
    """Base class of the mappings between a message and the userdata."""

    def __init__(self, what: str, empty: Any, key: str | None, slots: Iterable[str], callback: UserCallback) -> None:
        """Checks and stores the mapping.

        Args:
            what: Role of the message: "goal", "result", "request" or "response".
            empty: Empty message of the required type.
            key: Userdata key of the whole message; None for no key.
            slots: Fields that are mapped to userdata keys of the same names.
            callback: User function.

        Raises:
            smach.InvalidStateError: A field does not exist.
        """
        self._what = what
        self._key = key
        self._slots = check_slots(f"{what}_slots", empty, slots)
        self._callback = callback

    @property
    def _keys(self) -> list[str]:
        return [*([] if self._key is None else [self._key]), *self._slots]


class MessageSource(_MessageRules):
    """Creates a message from the fixed message or a userdata key, then from fields by key, then from the callback."""

    def __init__(
        self, what: str, empty: Any, fixed: Any, *, key: str | None, slots: Iterable[str], callback: UserCallback
    ) -> None:
        """Checks and stores the mapping.

        Args:
            what: Role of the message: "goal" or "request".
            empty: Empty message of the required type.
            fixed: Initial message without a key; None for an empty message.
            key: Userdata key of the whole message; None for no key.
            slots: Fields that are read from userdata keys of the same names.
            callback: Function that receives (userdata, message) and may return a replacement.

        Raises:
            smach.InvalidStateError: The fixed message has a wrong type, or a field does not exist.
        """
        super().__init__(what, empty, key, slots, callback)
        self._empty = empty
        if fixed is not None and not self._fits(fixed):
            raise smach.InvalidStateError(
                f"{what} is a {_type_name(fixed)}; give a {empty._type}, or a function as {what}_cb"
            )
        self._fixed = empty if fixed is None else fixed

    def register_on(self, state: smach.State) -> None:
        """Registers the userdata keys with a state."""
        state.register_input_keys(self._keys)
        self._callback.register_on(state, with_outcomes=False)

    def make(self, userdata: Any) -> Any:
        """Returns a new message for this execution.

        Raises:
            ExchangeError: A userdata key has no value or a value of the wrong type, or the callback failed.
        """
        message = copy.deepcopy(self._fixed if self._key is None else self._read(userdata, self._key))
        self._check(message, f"userdata key '{self._key}'")
        for name in self._slots:
            setattr(message, name, copy.deepcopy(self._read(userdata, name)))
        other = self._callback.call(userdata, message)
        if other is None:
            return message
        self._check(other, f"{self._what}_cb")
        return other

    def _read(self, userdata: Any, key: str) -> Any:
        if key not in userdata:
            raise ExchangeError(
                f"the {self._what} needs userdata key '{key}', which has no value; there are {sorted(userdata.keys())}"
            )
        return userdata[key]

    def _check(self, message: Any, origin: str) -> None:
        if not self._fits(message):
            raise ExchangeError(
                f"{origin} gave a {_type_name(message)} as {self._what}; it must be a {self._empty._type}"
            )

    def _fits(self, message: Any) -> bool:
        return getattr(message, "_type", None) == self._empty._type


def _type_name(value: Any) -> str:
    return str(getattr(value, "_type", type(value).__name__))


class MessageSink(_MessageRules):
    """Passes an answer to the callback, and stores the message and its fields under userdata keys."""

    def register_on(self, state: smach.State) -> None:
        """Registers the userdata keys and the callback's outcomes with a state."""
        state.register_output_keys(self._keys)
        self._callback.register_on(state, with_outcomes=True)

    def deliver(self, userdata: Any, outcomes: Iterable[str], message: Any, *before: Any) -> str | None:
        """Processes an answer.

        Args:
            userdata: Userdata of the state.
            outcomes: Allowed return values of the callback.
            message: Answer; None without an answer.
            before: Arguments of the callback before the message.

        Returns:
            Outcome from the callback, if any.

        Raises:
            ExchangeError: The callback failed or returned an unknown outcome.
        """
        chosen = self._callback.call(userdata, *before, message)
        known = list(outcomes)
        if chosen is not None and chosen not in known:
            raise ExchangeError(f"{self._what}_cb returned {chosen!r}, but the state's outcomes are {known}")
        if self._key is not None:
            userdata[self._key] = message
        if message is not None:
            for name in self._slots:
                userdata[name] = getattr(message, name)
        return None if chosen is None else str(chosen)


class ServerCallState(smach.State):
    """Base class of states that call a server.

    Attributes:
        reason: Reason for a failed execution; "" on success.
    """

    def __init__(
        self, input_keys: Iterable[str], output_keys: Iterable[str], io_keys: Iterable[str], outcomes: Iterable[str]
    ) -> None:
        """Declares the keys, the outcomes succeeded, aborted and preempted, and the user's outcomes."""
        super().__init__((*OUTCOMES, *outcomes), input_keys, output_keys, io_keys)
        self.reason = ""
        self._keys = (self.get_registered_input_keys(), self.get_registered_output_keys())

    def _user_callback(
        self, what: str, function: Any, args: Iterable[Any], kwargs: Mapping[str, Any] | None
    ) -> UserCallback:
        """Returns a callback with the user's keys; ``UserCallback`` describes arguments and errors."""
        return UserCallback(what, function, args, kwargs, self._keys)

    def _use(self, source: MessageSource, sink: MessageSink) -> None:
        """Stores the mappings of message and answer, and registers their keys and outcomes."""
        self._source, self._sink = source, sink
        source.register_on(self)
        sink.register_on(self)

    def _is_stopped(self) -> bool:
        return self.preempt_requested() or going_down()

    def _wait_for_server(
        self, server: str, is_available: Callable[[], bool], limit_s: float | None, problem: str
    ) -> bool:
        """Waits for the server; returns False after a request to stop.

        Args:
            server: Name of the server for the warning.
            is_available: Function that checks briefly for the server.
            limit_s: Maximum wait [s of wall time]; None for no limit.
            problem: Description of the timeout for the error.

        Raises:
            ExchangeError: The server did not appear in time.
        """
        limit, next_warning = WallTimeLimit(limit_s), WallTimeLimit(1.0)
        while not self._is_stopped():
            if is_available():
                return True
            if limit.over():
                raise ExchangeError(f"{problem} within {limit_s} s; start the node that offers it")
            if next_warning.over():
                smach.logwarn(f"still waiting for {server}")
                next_warning = WallTimeLimit(10.0)
        return False

    def _abort(self, reason: str) -> str:
        self.reason = reason
        smach.logerr(reason)
        return "aborted"

    def _preempt_with(self, reason: str) -> str:
        self.reason = reason
        smach.loginfo(reason)
        self.service_preempt()
        return "preempted"
