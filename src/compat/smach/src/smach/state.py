# SPDX-License-Identifier: BSD-3-Clause
"""A state runs, reads and writes userdata, ends with one of its outcomes, and can be preempted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from smach.exceptions import InvalidUserCodeError
from smach.util import CBInterface, Names, has_smach_interface

__all__ = ["CBState", "State"]


class State:
    """Base class of all states: declares outcomes and userdata keys; subclasses define ``execute``."""

    def __init__(
        self, outcomes: Names = (), input_keys: Names = (), output_keys: Names = (), io_keys: Names = ()
    ) -> None:
        """Declares the interface of the state.

        Args:
            outcomes: Allowed return values of ``execute``.
            input_keys: Userdata keys that are read.
            output_keys: Userdata keys that are written.
            io_keys: Userdata keys that are read and written.
        """
        self._outcomes: dict[str, None] = dict.fromkeys(outcomes)
        self._input_keys: dict[str, None] = dict.fromkeys(input_keys)
        self._output_keys: dict[str, None] = dict.fromkeys(output_keys)
        self._preempt_requested = False
        self.register_io_keys(io_keys)

    def execute(self, userdata: Any) -> str:
        """Executes the state and returns one of its outcomes. Subclasses override this method.

        Args:
            userdata: View of the container's userdata.

        Raises:
            smach.InvalidUserCodeError: A subclass does not override this method.
        """
        raise InvalidUserCodeError(f"{type(self).__name__} does not define execute(self, userdata)")

    # ---- interface -----------------------------------------------------------------------------------------
    def register_outcomes(self, new_outcomes: Names) -> None:
        """Adds outcomes that the state may return."""
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
        """Requests a stop; the state stops when its ``execute`` checks ``preempt_requested``."""
        self._preempt_requested = True

    def service_preempt(self) -> None:
        """Acknowledges the preemption request; called by the stopping state."""
        self._preempt_requested = False

    def recall_preempt(self) -> None:
        """Withdraws the preemption request; called by the requester."""
        self._preempt_requested = False

    def preempt_requested(self) -> bool:
        """Returns whether a preemption request has not been acknowledged yet."""
        return self._preempt_requested


class CBState(State):
    """A state that executes a function ``cb(userdata, *cb_args, **cb_kwargs)``, which returns an outcome."""

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
        """Creates a state from a function and any interface that ``cb_interface`` declares for it.

        Args:
            cb: Function to execute.
            cb_args: Positional arguments after the userdata.
            cb_kwargs: Keyword arguments.
            outcomes: Allowed return values of the function.
            input_keys: Userdata keys that are read.
            output_keys: Userdata keys that are written.
            io_keys: Userdata keys that are read and written.
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
        """Calls the function and returns its outcome."""
        return self._cb(userdata, *self._cb_args, **self._cb_kwargs)
