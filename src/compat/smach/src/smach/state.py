# SPDX-License-Identifier: BSD-3-Clause
"""A state: something that runs, reads and writes userdata, ends with one of its outcomes, and can be asked to stop."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from smach.exceptions import InvalidUserCodeError
from smach.util import CBInterface, Names, has_smach_interface

__all__ = ["CBState", "State"]


class State:
    """Base of all states: declares outcomes and userdata keys; ``execute`` is written by the user."""

    def __init__(
        self, outcomes: Names = (), input_keys: Names = (), output_keys: Names = (), io_keys: Names = ()
    ) -> None:
        """Declares the interface of the state.

        Args:
            outcomes: names of what ``execute`` may return.
            input_keys: userdata keys that are read.
            output_keys: userdata keys that are written.
            io_keys: userdata keys that are read and written.
        """
        self._outcomes: dict[str, None] = dict.fromkeys(outcomes)
        self._input_keys: dict[str, None] = dict.fromkeys(input_keys)
        self._output_keys: dict[str, None] = dict.fromkeys(output_keys)
        self._preempt_requested = False
        self.register_io_keys(io_keys)

    def execute(self, userdata: Any) -> str:
        """Does the work of the state and returns one of its outcomes. Subclasses override this.

        Args:
            userdata: the view this state has of its container's userdata.

        Raises:
            smach.InvalidUserCodeError: when a subclass did not override it.
        """
        raise InvalidUserCodeError(f"{type(self).__name__} does not define execute(self, userdata)")

    # ---- interface -----------------------------------------------------------------------------------------
    def register_outcomes(self, new_outcomes: Names) -> None:
        """Adds outcomes to those the state may return."""
        self._outcomes.update(dict.fromkeys(new_outcomes))

    def get_registered_outcomes(self) -> tuple[str, ...]:
        """Returns the outcomes, in the order of declaration."""
        return tuple(self._outcomes)

    def register_io_keys(self, keys: Names) -> None:
        """Adds userdata keys that are read and written."""
        both = dict.fromkeys(keys)
        self._input_keys.update(both)
        self._output_keys.update(both)

    def register_input_keys(self, keys: Names) -> None:
        """Adds userdata keys that are read."""
        self._input_keys.update(dict.fromkeys(keys))

    def get_registered_input_keys(self) -> tuple[str, ...]:
        """Returns the userdata keys that are read."""
        return tuple(self._input_keys)

    def register_output_keys(self, keys: Names) -> None:
        """Adds userdata keys that are written."""
        self._output_keys.update(dict.fromkeys(keys))

    def get_registered_output_keys(self) -> tuple[str, ...]:
        """Returns the userdata keys that are written."""
        return tuple(self._output_keys)

    # ---- stopping ------------------------------------------------------------------------------------------
    def request_preempt(self) -> None:
        """Asks the state to stop; it does so where its ``execute`` checks ``preempt_requested``."""
        self._preempt_requested = True

    def service_preempt(self) -> None:
        """Acknowledges the request: called by the state that stops because of it."""
        self._preempt_requested = False

    def recall_preempt(self) -> None:
        """Withdraws the request; called by the requester."""
        self._preempt_requested = False

    def preempt_requested(self) -> bool:
        """Returns whether the state was asked to stop and has not acknowledged it yet."""
        return self._preempt_requested


class CBState(State):
    """A state whose work is a function: ``cb(userdata, *cb_args, **cb_kwargs)`` returning an outcome."""

    def __init__(
        self,
        cb: Callable[..., str],
        cb_args: Iterable[Any] = (),
        cb_kwargs: Mapping[str, Any] | None = None,
        outcomes: Names = (),
        input_keys: Names = (),
        output_keys: Names = (),
        io_keys: Names = (),
    ) -> None:
        """Makes a state of a function; an interface declared with ``cb_interface`` is taken over.

        Args:
            cb: the function.
            cb_args: positional arguments passed after the userdata.
            cb_kwargs: keyword arguments passed to the function.
            outcomes: names of what the function may return.
            input_keys: userdata keys that are read.
            output_keys: userdata keys that are written.
            io_keys: userdata keys that are read and written.
        """
        super().__init__(outcomes, input_keys, output_keys, io_keys)
        self._cb = cb
        self._cb_args = tuple(cb_args)
        self._cb_kwargs = dict(cb_kwargs or {})
        if isinstance(cb, CBInterface) or has_smach_interface(cb):
            declared: Any = cb
            self.register_outcomes(declared.get_registered_outcomes())
            self.register_input_keys(declared.get_registered_input_keys())
            self.register_output_keys(declared.get_registered_output_keys())

    def execute(self, userdata: Any) -> str:
        """Calls the function and returns what it returned."""
        return self._cb(userdata, *self._cb_args, **self._cb_kwargs)
