# SPDX-License-Identifier: BSD-3-Clause
"""Base class of containers, which are states made of states: construction, userdata and callbacks."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from smach import log
from smach.exceptions import InvalidConstructionError, InvalidStateError, InvalidUserCodeError
from smach.state import State
from smach.user_data import Remapper, UserData
from smach.util import NameMap, Names

__all__ = ["Container"]

Callback = Callable[..., object]


class _Construction(threading.local):
    """Containers under construction in this thread, the innermost last."""

    def __init__(self) -> None:
        self.stack: list[Container] = []


class Container(State):
    """Base class of containers: children, local userdata, construction and callbacks."""

    _construction = _Construction()

    def __init__(self, outcomes: Names = (), input_keys: Names = (), output_keys: Names = ()) -> None:
        """Declares the interface of the container, like that of a state."""
        super().__init__(outcomes, input_keys, output_keys)
        self.userdata = UserData()
        self._running = False
        self._start_cbs: list[tuple[Callback, tuple[Any, ...]]] = []
        self._transition_cbs: list[tuple[Callback, tuple[Any, ...]]] = []
        self._termination_cbs: list[tuple[Callback, tuple[Any, ...]]] = []

    # ---- abstract methods ----------------------------------------------------------------------------------
    def get_children(self) -> dict[str, State]:
        """Returns the contained states by label."""
        return {}

    def __getitem__(self, key: str) -> State:
        return self.get_children()[key]

    def get_initial_states(self) -> list[str]:
        """Returns the labels of the initial states."""
        return []

    def set_initial_state(self, initial_states: list[str], userdata: UserData | None = None) -> None:
        """Sets the initial states, and adds values to the local userdata."""
        raise self._unsupported_error("set_initial_state")

    def get_active_states(self) -> list[str]:
        """Returns the labels of the running states."""
        return []

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Returns the internal transitions as (outcome, from label, to label or container outcome)."""
        return []

    def check_consistency(self) -> None:
        """Raises an error if the container is incomplete or inconsistent."""
        raise self._unsupported_error("check_consistency")

    def is_running(self) -> bool:
        """Returns whether the container is executing."""
        return self._running

    def _unsupported_error(self, method: str) -> InvalidConstructionError:
        return InvalidConstructionError(f"{type(self).__name__} does not define {method}")

    # ---- construction --------------------------------------------------------------------------------------
    def open(self) -> None:
        """Makes this container the target of ``add`` calls in this thread."""
        self._construction.stack.append(self)

    def close(self) -> None:
        """Ends the construction of this container.

        Raises:
            smach.InvalidStateError: A container that was opened later is still open, or no container is open.
        """
        stack = self._construction.stack
        if not stack or stack[-1] is not self:
            raise InvalidStateError("cannot close a container other than the last opened container")
        stack.pop()

    def is_opened(self) -> bool:
        """Returns whether this container is under construction in this thread."""
        return self in self._construction.stack

    def assert_opened(self, msg: str = "the container is not open; use 'with container:'") -> None:
        """Raises ``InvalidConstructionError`` with a message unless the container is open."""
        if not self.is_opened():
            raise InvalidConstructionError(msg)

    @contextmanager
    def opened(self) -> Iterator[Container]:
        """Opens the container for a ``with`` block, like ``with container:``."""
        with self as container:
            yield container

    def __enter__(self) -> Container:
        self.open()
        return self

    def __exit__(self, exc_type: object, exc_val: object, exc_tb: object) -> None:
        if exc_type is not None:
            stack = self._construction.stack
            del stack[stack.index(self) :]
            return
        try:
            self.check_consistency()
        finally:
            self.close()

    @classmethod
    def _currently_opened_container(cls) -> Any:
        """Returns the container under construction; raises ``InvalidConstructionError`` without one of this class."""
        stack = cls._construction.stack
        if not stack:
            raise InvalidConstructionError(f"no container is open; call {cls.__name__}.add inside 'with container:'")
        if not isinstance(stack[-1], cls):
            raise InvalidConstructionError(
                f"{cls.__name__}.add was called while a {type(stack[-1]).__name__} is open; use its own add"
            )
        return stack[-1]

    # ---- userdata ------------------------------------------------------------------------------------------
    def _copy_input_keys(self, parent_ud: Any) -> None:
        for key in self.get_registered_input_keys():
            if parent_ud is not None and key in parent_ud:
                self.userdata[key] = parent_ud[key]
            elif parent_ud is not None and key not in self.userdata:
                log.warn(f"{type(self).__name__}: input key '{key}' has no value in the parent's userdata")

    def _copy_output_keys(self, parent_ud: Any) -> None:
        if parent_ud is None:
            return
        for key in self.get_registered_output_keys():
            if key in self.userdata:
                parent_ud[key] = self.userdata[key]

    def _execute_child(self, label: str, state: State, remapping: NameMap) -> str:
        """Runs a child with its view of the userdata; converts its errors to ``InvalidUserCodeError``."""
        view = Remapper(self.userdata, state.get_registered_input_keys(), state.get_registered_output_keys(), remapping)
        try:
            return state.execute(view)
        except InvalidUserCodeError:
            log.error(f"state '{label}' of type {type(state).__name__} could not be executed")
            raise
        except Exception as error:
            raise InvalidUserCodeError(
                f"state '{label}' of type {type(state).__name__} raised {type(error).__name__}: {error}\n"
                f"{traceback.format_exc()}"
            ) from error

    # ---- callbacks -----------------------------------------------------------------------------------------
    def register_start_cb(self, start_cb: Callback, cb_args: Iterable[Any] = ()) -> None:
        """Registers ``start_cb(userdata, initial_labels, *cb_args)``, called when the container starts."""
        self._start_cbs.append((start_cb, tuple(cb_args)))

    def register_transition_cb(self, transition_cb: Callback, cb_args: Iterable[Any] = ()) -> None:
        """Registers ``transition_cb(userdata, active_labels, *cb_args)``, called when the running states change."""
        self._transition_cbs.append((transition_cb, tuple(cb_args)))

    def register_termination_cb(self, termination_cb: Callback, cb_args: Iterable[Any] = ()) -> None:
        """Registers ``termination_cb(userdata, last_labels, outcome, *cb_args)``, called when the container ends."""
        self._termination_cbs.append((termination_cb, tuple(cb_args)))

    def call_start_cbs(self) -> None:
        """Calls the start callbacks; their errors are logged and ignored."""
        self._call(self._start_cbs, "start", self.get_initial_states())

    def call_transition_cbs(self) -> None:
        """Calls the transition callbacks; their errors are logged and ignored."""
        self._call(self._transition_cbs, "transition", self.get_active_states())

    def call_termination_cbs(self, terminal_states: list[str], outcome: str | None) -> None:
        """Calls the termination callbacks; their errors are logged and ignored."""
        self._call(self._termination_cbs, "termination", terminal_states, outcome)

    def _call(self, callbacks: list[tuple[Callback, tuple[Any, ...]]], kind: str, *args: Any) -> None:
        for callback, extra in callbacks:
            try:
                callback(self.userdata, *args, *extra)
            except Exception:  # a failing callback must not affect the container
                log.error(f"{kind} callback {callback!r} raised:\n{traceback.format_exc()}")
