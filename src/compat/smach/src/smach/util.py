# SPDX-License-Identifier: BSD-3-Clause
"""Shutdown check of all containers, and a decorator that declares a function's smach interface."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

__all__ = ["CBInterface", "cb_interface", "has_smach_interface", "is_shutdown", "set_shutdown_check"]

Names = Iterable[str]
"""Outcomes, labels or userdata keys."""

NameMap = Mapping[str, str]
"""Transitions or remappings, from name to name."""


class _ShutdownCheck:
    """Holder of the installed shutdown check."""

    def __init__(self) -> None:
        self.check: Callable[[], bool] = lambda: False


_SHUTDOWN = _ShutdownCheck()


def set_shutdown_check(cb: Callable[[], bool]) -> None:
    """Installs the function that containers call between states; True stops them with the outcome ``preempted``."""
    _SHUTDOWN.check = cb


def is_shutdown() -> bool:
    """Returns whether the process is shutting down according to the installed check (by default never)."""
    return _SHUTDOWN.check()


def has_smach_interface(obj: object) -> bool:
    """Returns whether an object declares outcomes, input keys and output keys like a state."""
    names = ("get_registered_input_keys", "get_registered_output_keys", "get_registered_outcomes")
    return all(hasattr(obj, name) for name in names)


class CBInterface:
    """A function with declared outcomes and userdata keys."""

    def __init__(
        self,
        cb: Callable[..., Any],
        outcomes: Names = (),
        input_keys: Names = (),
        output_keys: Names = (),
        io_keys: Names = (),
    ) -> None:
        """Wraps a function; ``io_keys`` are added to input and output keys.

        Args:
            cb: Function.
            outcomes: Outcomes of the function.
            input_keys: Userdata keys that are read.
            output_keys: Userdata keys that are written.
            io_keys: Userdata keys that are read and written.
        """
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
    """Decorator that declares the outcomes and userdata keys of a function for ``CBState``."""

    def __init__(
        self, outcomes: Names = (), input_keys: Names = (), output_keys: Names = (), io_keys: Names = ()
    ) -> None:
        """Stores the interface of the decorated function.

        Args:
            outcomes: Outcomes of the function.
            input_keys: Userdata keys that are read.
            output_keys: Userdata keys that are written.
            io_keys: Userdata keys that are read and written.
        """
        self._interface = (tuple(outcomes), tuple(input_keys), tuple(output_keys), tuple(io_keys))

    def __call__(self, cb: Callable[..., Any]) -> CBInterface:
        """Returns the function with its interface attached."""
        return CBInterface(cb, *self._interface)
