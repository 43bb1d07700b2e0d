# SPDX-License-Identifier: BSD-3-Clause
"""The shutdown check shared by all containers, and the decorator that gives a plain function a state's interface."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

__all__ = ["CBInterface", "cb_interface", "has_smach_interface", "is_shutdown", "set_shutdown_check"]

Names = Iterable[str]
"""Outcomes, labels or userdata keys."""

NameMap = Mapping[str, str]
"""Transitions or remappings: one name -> another."""


class _ShutdownCheck:
    """Holds the function that says whether the process is going down."""

    def __init__(self) -> None:
        self.ask: Callable[[], bool] = lambda: False


_SHUTDOWN = _ShutdownCheck()


def set_shutdown_check(cb: Callable[[], bool]) -> None:
    """Installs the function that containers call between two states: True = stop, with the outcome ``preempted``."""
    _SHUTDOWN.ask = cb


def is_shutdown() -> bool:
    """Returns whether the process is going down, as far as the installed check knows (by default: never)."""
    return _SHUTDOWN.ask()


def has_smach_interface(obj: object) -> bool:
    """Returns whether an object declares outcomes, input keys and output keys the way states do."""
    names = ("get_registered_input_keys", "get_registered_output_keys", "get_registered_outcomes")
    return all(hasattr(obj, name) for name in names)


class CBInterface:
    """A callable that carries the outcomes and userdata keys of the function it wraps."""

    def __init__(
        self,
        cb: Callable[..., Any],
        outcomes: Names = (),
        input_keys: Names = (),
        output_keys: Names = (),
        io_keys: Names = (),
    ) -> None:
        """Wraps ``cb``; keys in ``io_keys`` count as input and as output."""
        both = list(io_keys)
        self._cb = cb
        self._outcomes = tuple(outcomes)
        self._input_keys = tuple(dict.fromkeys([*input_keys, *both]))
        self._output_keys = tuple(dict.fromkeys([*output_keys, *both]))

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        """Calls the wrapped function."""
        return self._cb(*args, **kwargs)

    def get_registered_outcomes(self) -> tuple[str, ...]:
        """Returns the declared outcomes."""
        return self._outcomes

    def get_registered_input_keys(self) -> tuple[str, ...]:
        """Returns the userdata keys the function reads."""
        return self._input_keys

    def get_registered_output_keys(self) -> tuple[str, ...]:
        """Returns the userdata keys the function writes."""
        return self._output_keys


class cb_interface:  # noqa: N801 - public name
    """Decorator: declares outcomes and userdata keys of a function, for use with ``CBState``."""

    def __init__(
        self, outcomes: Names = (), input_keys: Names = (), output_keys: Names = (), io_keys: Names = ()
    ) -> None:
        """Stores the interface that the decorated function will carry."""
        self._interface = (tuple(outcomes), tuple(input_keys), tuple(output_keys), tuple(io_keys))

    def __call__(self, cb: Callable[..., Any]) -> CBInterface:
        """Returns the function with its interface attached."""
        return CBInterface(cb, *self._interface)
