# SPDX-License-Identifier: BSD-3-Clause
"""Conversion between userdata and messages for states that call another node.

Goal and result of an action, request and response of a service follow the same rules, which are kept here.
"""

from __future__ import annotations

import copy
import traceback
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import smach
from smach_ros.waiting import WallTimeLimit, going_down

__all__ = ["AskingState", "ExchangeError", "MessageSink", "MessageSource", "UserCallback"]

OUTCOMES = ("succeeded", "aborted", "preempted")


class ExchangeError(Exception):
    """A message could not be made or delivered; the text says why."""


class UserCallback:
    """A function of the user with the extra arguments and the view of the userdata it gets."""

    def __init__(
        self,
        what: str,
        function: Any,
        args: Iterable[Any] = (),
        kwargs: Mapping[str, Any] | None = None,
        keys: tuple[Iterable[str], Iterable[str]] = ((), ()),
    ) -> None:
        """Checks and keeps a function.

        Args:
            what: how errors call it.
            function: the function, or None; one made by ``cb_interface`` brings its keys and outcomes along.
            args: positional arguments it gets last.
            kwargs: keyword arguments it gets.
            keys: userdata keys it may read, and those it may write, unless it declares its own.

        Raises:
            smach.InvalidStateError: it cannot be called.
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
        """Declares on a state what the function declares itself."""
        if not self.declares_interface:
            return
        state.register_input_keys(self._input_keys)
        state.register_output_keys(self._output_keys)
        if with_outcomes:
            state.register_outcomes(self.outcomes)

    def call(self, userdata: Any, *values: Any) -> Any:
        """Calls the function with its view of the userdata; None when there is no function.

        Raises:
            ExchangeError: it raised.
        """
        if self._function is None:
            return None
        view = smach.Remapper(userdata, self._input_keys, self._output_keys, {})
        try:
            return self._function(view, *values, *self._args, **self._kwargs)
        except Exception as error:
            smach.logerr(f"{self._what} raised:\n{traceback.format_exc()}")
            raise ExchangeError(f"{self._what} raised {type(error).__name__}: {error}") from error


def check_slots(what: str, message: Any, slots: Iterable[str]) -> tuple[str, ...]:
    """Returns names of fields; raises ``smach.InvalidStateError`` when a message does not have them."""
    if isinstance(slots, str):
        raise smach.InvalidStateError(f"{what} must be a list of field names, got the string '{slots}'")
    given = tuple(slots)
    unknown = [name for name in given if name not in message.__slots__]
    if unknown:
        raise smach.InvalidStateError(
            f"{what}: {unknown} are no fields of {message._type}; its fields are {list(message.__slots__)}"
        )
    return given


class _MessageRules:
    """Base: what connects a message with the userdata, and the user's callback for it."""

    def __init__(self, what: str, empty: Any, key: str | None, slots: Iterable[str], callback: UserCallback) -> None:
        """Checks and keeps the rules.

        Args:
            what: what the message is: "goal", "result", "request" or "response".
            empty: an empty message of the right type.
            key: userdata key of the whole message; None: there is none.
            slots: fields that have userdata keys of the same names.
            callback: function of the user.

        Raises:
            smach.InvalidStateError: a field does not exist.
        """
        self._what = what
        self._key = key
        self._slots = check_slots(f"{what}_slots", empty, slots)
        self._callback = callback

    @property
    def _keys(self) -> list[str]:
        return [*([] if self._key is None else [self._key]), *self._slots]


class MessageSource(_MessageRules):
    """Makes a message: the fixed one, or that under a userdata key; then fields by key; then the callback's."""

    def __init__(
        self, what: str, empty: Any, fixed: Any, key: str | None, slots: Iterable[str], callback: UserCallback
    ) -> None:
        """Checks and keeps the rules.

        Args:
            what: "goal" or "request".
            empty: an empty message of the right type.
            fixed: the message to start from, when there is no key; None: the empty one.
            key: as of every message.
            slots: as of every message.
            callback: gets (userdata, message) and may return another message.

        Raises:
            smach.InvalidStateError: the fixed message has another type, or a field does not exist.
        """
        super().__init__(what, empty, key, slots, callback)
        self._empty = empty
        if fixed is not None and not self._fits(fixed):
            raise smach.InvalidStateError(
                f"{what} is a {_kind(fixed)}; give a {empty._type}, or a function as {what}_cb"
            )
        self._fixed = empty if fixed is None else fixed

    def register_on(self, state: smach.State) -> None:
        """Declares the userdata keys on a state."""
        state.register_input_keys(self._keys)
        self._callback.register_on(state, with_outcomes=False)

    def make(self, userdata: Any) -> Any:
        """Returns the message of this execution: always a new object.

        Raises:
            ExchangeError: a userdata key has no value or one of the wrong type, or the callback failed.
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
            raise ExchangeError(f"{origin} gave a {_kind(message)} as {self._what}; it must be a {self._empty._type}")

    def _fits(self, message: Any) -> bool:
        return getattr(message, "_type", None) == self._empty._type


def _kind(value: Any) -> str:
    return str(getattr(value, "_type", type(value).__name__))


class MessageSink(_MessageRules):
    """Delivers an answer: to the callback, then whole under a userdata key, then its fields under keys."""

    def register_on(self, state: smach.State) -> None:
        """Declares the userdata keys and the callback's outcomes on a state."""
        state.register_output_keys(self._keys)
        self._callback.register_on(state, with_outcomes=True)

    def deliver(self, userdata: Any, outcomes: Iterable[str], message: Any, *before: Any) -> str | None:
        """Delivers an answer.

        Args:
            userdata: of the state.
            outcomes: what the callback may return.
            message: the answer; None when there was none.
            before: what the callback gets before the message.

        Returns:
            The outcome the callback chose, if any.

        Raises:
            ExchangeError: the callback failed or chose an unknown outcome.
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


class AskingState(smach.State):
    """Base of the states that ask another node.

    Attributes:
        reason: why the last execution did not succeed; "" when it did.
    """

    def __init__(
        self, input_keys: Iterable[str], output_keys: Iterable[str], io_keys: Iterable[str], outcomes: Iterable[str]
    ) -> None:
        """Declares succeeded, aborted, preempted, and what the user adds."""
        super().__init__((*OUTCOMES, *outcomes), input_keys, output_keys, io_keys)
        self.reason = ""
        self._keys = (self.get_registered_input_keys(), self.get_registered_output_keys())

    def _user_callback(
        self, what: str, function: Any, args: Iterable[Any], kwargs: Mapping[str, Any] | None
    ) -> UserCallback:
        """Returns a callback that may use the keys the user gave; arguments and errors as of ``UserCallback``."""
        return UserCallback(what, function, args, kwargs, self._keys)

    def _use(self, source: MessageSource, sink: MessageSink) -> None:
        """Takes what makes the message and what delivers the answer, and declares their keys and outcomes."""
        self._source, self._sink = source, sink
        source.register_on(self)
        sink.register_on(self)

    def _stopped(self) -> bool:
        return self.preempt_requested() or going_down()

    def _wait_for_server(self, server: str, is_there: Callable[[], bool], limit_s: float | None, problem: str) -> bool:
        """Waits for the server; returns False when the state was asked to stop.

        Args:
            server: its name, for the warning.
            is_there: checks for the server, for a moment.
            limit_s: longest wait [s of wall time]; None: no limit.
            problem: what is wrong when the time is over, for the error.

        Raises:
            ExchangeError: it did not come in time.
        """
        limit, next_warning = WallTimeLimit(limit_s), WallTimeLimit(1.0)
        while not self._stopped():
            if is_there():
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

    def _preempted(self, reason: str) -> str:
        self.reason = reason
        smach.loginfo(reason)
        self.service_preempt()
        return "preempted"
