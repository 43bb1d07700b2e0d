# SPDX-License-Identifier: BSD-3-Clause
"""A container that runs one state for each item of a sequence."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable
from typing import Any

from smach import log
from smach.container import Container
from smach.exceptions import InvalidStateError, InvalidTransitionError
from smach.state import State
from smach.user_data import UserData
from smach.util import NameMap, Names, is_shutdown

__all__ = ["Iterator"]


class Iterator(Container):
    """Stores each item in its userdata and runs the contained state."""

    def __init__(
        self,
        outcomes: Names,
        input_keys: Names = (),
        output_keys: Names = (),
        it: Iterable[Any] | Callable[[], Iterable[Any]] = (),
        it_label: str = "it_data",
        exhausted_outcome: str = "exhausted",
    ) -> None:
        """Creates an iterator; its state is set inside ``with iterator:``.

        Args:
            outcomes: Names of the outcomes; ``exhausted_outcome`` is added if missing.
            input_keys: Userdata keys copied from the parent before the first run.
            output_keys: Userdata keys copied to the parent after the last run.
            it: Items, or a function without arguments that returns them when the iterator starts.
            it_label: Userdata key of the current item.
            exhausted_outcome: Outcome after the last item.
        """
        super().__init__(dict.fromkeys([*outcomes, exhausted_outcome]), input_keys, output_keys)
        self._items = it
        self._items_label = it_label
        self._exhausted_outcome = exhausted_outcome
        self._state_label = ""
        self._state: State | None = None
        self._loop_outcomes: list[str] = []
        self._break_outcomes: list[str] = []
        self._final_outcome_map: dict[str, str] = {}
        self._active = False
        self._lock = threading.RLock()

    @staticmethod
    def set_contained_state(
        label: str,
        state: State,
        loop_outcomes: Names = (),
        break_outcomes: Names = (),
        final_outcome_map: NameMap | None = None,
    ) -> None:
        """Sets the state that runs for each item.

        Args:
            label: Label of the state.
            state: State or container.
            loop_outcomes: Outcomes of the state that continue with the next item; if empty, all outcomes that are not
                in ``break_outcomes``.
            break_outcomes: Outcomes of the state that end the iteration.
            final_outcome_map: Outcome of the iterator, keyed by the state's outcome that ends the iteration; outcomes
                without an entry keep their names.
        """
        iterator: Iterator = Iterator._currently_opened_container()
        iterator._state_label = label
        iterator._state = state
        iterator._loop_outcomes = list(loop_outcomes)
        iterator._break_outcomes = list(break_outcomes)
        iterator._final_outcome_map = dict(final_outcome_map or {})

    def set_iteritems(self, it: Iterable[Any] | Callable[[], Iterable[Any]], it_label: str) -> None:
        """Replaces the items and the userdata key of the current item."""
        self._items = it
        self._items_label = it_label

    def check_consistency(self) -> None:
        """Raises an error if there is no state, or if an ending outcome is not an outcome of the iterator."""
        if not isinstance(self._state, State):
            raise InvalidStateError("the iterator has no contained state; call Iterator.set_contained_state")
        registered = self._state.get_registered_outcomes()
        both = sorted(set(self._loop_outcomes) & set(self._break_outcomes))
        if both:
            raise InvalidTransitionError(f"{both} are loop outcomes and break outcomes at once")
        named = [*self._loop_outcomes, *self._break_outcomes, *self._final_outcome_map]
        unknown = [name for name in named if name not in registered]
        if unknown:
            raise InvalidTransitionError(
                f"{unknown} are not outcomes of '{self._state_label}', which gives {list(registered)}"
            )
        lost = [name for name in registered if self._breaks(name) and self._final(name) not in self._outcomes]
        if lost:
            raise InvalidTransitionError(
                f"{lost} of '{self._state_label}' end the iteration as {[self._final(name) for name in lost]}, but "
                f"the iterator's outcomes are {list(self._outcomes)}"
            )

    def _breaks(self, outcome: str) -> bool:
        if outcome in self._break_outcomes:
            return True
        return bool(self._loop_outcomes) and outcome not in self._loop_outcomes

    def _final(self, outcome: str) -> str:
        return self._final_outcome_map.get(outcome, outcome)

    # ---- inspection ----------------------------------------------------------------------------------------
    def get_children(self) -> dict[str, State]:
        """Returns the contained state by its label."""
        return {} if self._state is None else {self._state_label: self._state}

    def get_initial_states(self) -> list[str]:
        """Returns the label of the contained state in a list."""
        return list(self.get_children())

    def set_initial_state(self, initial_states: list[str], userdata: UserData | None = None) -> None:
        """Adds values to the local userdata; the initial state is always the contained state."""
        if initial_states and list(initial_states) != self.get_initial_states():
            log.warn(f"an iterator starts with its contained state; {list(initial_states)} is ignored")
        if userdata is not None:
            self.userdata.update(userdata)

    def get_active_states(self) -> list[str]:
        """Returns the label of the contained state while it runs."""
        return [self._state_label] if self._active else []

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Returns (outcome, label, label or outcome of the iterator) for each outcome of the contained state."""
        if self._state is None:
            return []
        edges: list[tuple[str, str, str | None]] = []
        for outcome in self._state.get_registered_outcomes():
            if self._breaks(outcome):
                edges.append((outcome, self._state_label, self._final(outcome)))
            else:
                edges.append((outcome, self._state_label, self._state_label))
                edges.append((outcome, self._state_label, self._exhausted_outcome))
        return edges

    # ---- running -------------------------------------------------------------------------------------------
    def execute(self, parent_ud: Any = None) -> str:
        """Runs the contained state for each item.

        Args:
            parent_ud: Userdata for copying the input and output keys.

        Returns:
            The exhausted outcome, or the outcome of the state that ended the iteration; ``preempted``, if the
            iterator has this outcome, after a preemption request between two items.
        """
        self.check_consistency()
        self._copy_input_keys(parent_ud)
        items = self._items() if callable(self._items) else self._items
        self._running = True
        self.call_start_cbs()
        try:
            outcome = self._run_over(items)
        finally:
            with self._lock:
                self._running = False
                self._active = False
        self._copy_output_keys(parent_ud)
        self.call_termination_cbs([self._state_label], outcome)
        return outcome

    def _run_over(self, items: Iterable[Any]) -> str:
        for item in items:
            if is_shutdown():
                self.service_preempt()
                return "preempted"
            if self._preempt_requested and "preempted" in self._outcomes:
                self.service_preempt()
                return "preempted"
            self.userdata[self._items_label] = item
            outcome = self._run_once()
            if self._breaks(outcome):
                return self._final(outcome)
            self.call_transition_cbs()
        return self._exhausted_outcome

    def _run_once(self) -> str:
        state = self.get_children()[self._state_label]
        with self._lock:
            self._active = True
            if self._preempt_requested:
                state.request_preempt()
        outcome = self._execute_child(self._state_label, state, {})
        with self._lock:
            self._active = False
            if self._preempt_requested and not state.preempt_requested():
                self.service_preempt()
            elif state.preempt_requested():
                state.recall_preempt()
        if outcome not in state.get_registered_outcomes() and not is_shutdown():
            raise InvalidTransitionError(
                f"state '{self._state_label}' of type {type(state).__name__} returned {outcome!r}, but its outcomes "
                f"are {list(state.get_registered_outcomes())}"
            )
        return outcome

    def request_preempt(self) -> None:
        """Requests preemption of the iterator and of the contained state when it runs."""
        with self._lock:
            super().request_preempt()
            if self._active and self._state is not None:
                self._state.request_preempt()
