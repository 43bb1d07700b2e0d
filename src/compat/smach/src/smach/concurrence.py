# SPDX-License-Identifier: BSD-3-Clause
"""A container that runs all its states in parallel threads and ends when the last state has ended."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

from smach import log
from smach.container import Container
from smach.exceptions import InvalidStateError, InvalidTransitionError, InvalidUserCodeError, SmachError
from smach.state import State
from smach.user_data import UserData
from smach.util import NameMap, Names, is_shutdown

__all__ = ["Concurrence"]

OutcomeMap = Mapping[str, NameMap]
ChildTerminationCallback = Callable[[dict[str, "str | None"]], "bool | list[str] | tuple[str, ...] | None"]
OutcomeCallback = Callable[[dict[str, "str | None"]], "str | None"]


class Concurrence(Container):
    """Runs its states in parallel; their outcomes determine its outcome.

    The outcome is, in order of precedence: the return value of ``outcome_cb``; the first entry of ``outcome_map``
    whose child outcomes all match; ``default_outcome``.
    """

    def __init__(
        self,
        outcomes: Names,
        default_outcome: str,
        input_keys: Names = (),
        output_keys: Names = (),
        outcome_map: OutcomeMap | None = None,
        outcome_cb: OutcomeCallback | None = None,
        child_termination_cb: ChildTerminationCallback | None = None,
    ) -> None:
        """Creates an empty concurrence; states are added inside ``with concurrence:``.

        Args:
            outcomes: Names of the outcomes.
            default_outcome: Outcome if nothing else determines it.
            input_keys: Userdata keys copied from the parent before the states run.
            output_keys: Userdata keys copied to the parent after the states have ended.
            outcome_map: Required child outcomes {label: outcome}, keyed by outcome of the concurrence.
            outcome_cb: Function that receives all {label: outcome} at the end; returns an outcome or None.
            child_termination_cb: Function that receives {label: outcome, None while running} after each end of a child;
                True stops all other children, a list stops the children with these labels.
        """
        super().__init__(outcomes, input_keys, output_keys)
        self._states: dict[str, State] = {}
        self._remappings: dict[str, dict[str, str]] = {}
        self._default_outcome = default_outcome
        self._outcome_map = {name: dict(children) for name, children in (outcome_map or {}).items()}
        self._outcome_cb = outcome_cb
        self._child_termination_cb = child_termination_cb
        self._child_outcomes: dict[str, str | None] = {}
        self._active: list[str] = []
        self._errors: list[SmachError] = []
        self._lock = threading.RLock()
        self._ended = threading.Condition(self._lock)

    # ---- construction --------------------------------------------------------------------------------------
    @staticmethod
    def add(label: str, state: State, remapping: NameMap | None = None) -> State:
        """Adds a state to the open concurrence.

        Args:
            label: Label of the state.
            state: State or container.
            remapping: Userdata key in the concurrence, keyed by key in the state.

        Returns:
            The state.

        Raises:
            smach.InvalidStateError: The label is already used, or the object is not a state.
        """
        concurrence: Concurrence = Concurrence._currently_opened_container()
        if label in concurrence._states:
            raise InvalidStateError(f"the concurrence already has a state with the label '{label}'")
        if not isinstance(state, State):
            raise InvalidStateError(f"'{label}' is a {type(state).__name__}, not a smach.State")
        concurrence._states[label] = state
        concurrence._remappings[label] = dict(remapping or {})
        return state

    def check_consistency(self) -> None:
        """Raises an error if there are no states, or if the outcome map names unknown outcomes or states."""
        if not self._states:
            raise InvalidStateError("the concurrence has no states")
        faults = []
        if self._default_outcome not in self._outcomes:
            faults.append(f"default outcome '{self._default_outcome}' is not among the outcomes")
        for outcome, children in self._outcome_map.items():
            if outcome not in self._outcomes:
                faults.append(f"the outcome map gives '{outcome}', which is not among the outcomes")
            for label, child_outcome in children.items():
                if label not in self._states:
                    faults.append(f"the outcome map names the state '{label}'; there are {list(self._states)}")
                elif child_outcome not in self._states[label].get_registered_outcomes():
                    known = list(self._states[label].get_registered_outcomes())
                    faults.append(f"the outcome map names '{child_outcome}' of '{label}', which gives {known}")
        if faults:
            raise InvalidStateError(f"{'; '.join(faults)}; outcomes: {list(self._outcomes)}")

    # ---- inspection ----------------------------------------------------------------------------------------
    def get_children(self) -> dict[str, State]:
        """Returns the states by label, in the order of their addition."""
        return dict(self._states)

    def get_initial_states(self) -> list[str]:
        """Returns the labels of all states, which start together."""
        return list(self._states)

    def set_initial_state(self, initial_states: list[str], userdata: UserData | None = None) -> None:
        """Adds values to the local userdata; the initial states are fixed, because all states run.

        Args:
            initial_states: Ignored with a warning unless all or no states are named.
            userdata: Values to add to the local userdata.
        """
        if userdata is not None:
            self.userdata.update(userdata)
        if initial_states and set(initial_states) != set(self._states):
            log.warn(f"a concurrence starts all its states; the choice {list(initial_states)} is ignored")

    def get_active_states(self) -> list[str]:
        """Returns the labels of the running states."""
        with self._lock:
            return list(self._active)

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Returns the entries of the outcome map as (outcome of the child, label, outcome of the concurrence)."""
        return [
            (child_outcome, label, outcome)
            for outcome, children in self._outcome_map.items()
            for label, child_outcome in children.items()
        ]

    # ---- running -------------------------------------------------------------------------------------------
    def execute(self, parent_ud: Any = None) -> str:
        """Runs all states and returns the outcome after the last state has ended.

        Args:
            parent_ud: Userdata for copying the input and output keys.

        Raises:
            smach.SmachError: The concurrence is inconsistent; or a state raised an error or returned an undeclared
                outcome, after the other states have been stopped.
        """
        self.check_consistency()
        self._copy_input_keys(parent_ud)
        log.info(f"concurrence starts {list(self._states)}")
        threads = [
            threading.Thread(target=self._run_child, args=(label,), name=f"smach-{label}", daemon=True)
            for label in self._states
        ]
        with self._lock:
            self._child_outcomes = dict.fromkeys(self._states)
            self._active = list(self._states)
            self._errors = []
            self._running = True
            if self._preempt_requested:
                self._preempt_active()
        self.call_start_cbs()
        try:
            for thread in threads:
                thread.start()
            self._wait_for_children()
        finally:
            with self._lock:
                self._running = False
                outcomes = dict(self._child_outcomes)
                errors = list(self._errors)
        if errors:
            self._recall_leftovers()
            raise errors[0]
        outcome = self._decide(outcomes)
        self._settle_preempt()
        self._copy_output_keys(parent_ud)
        self.call_termination_cbs(list(self._states), outcome)
        log.info(f"concurrence ends with '{outcome}': {outcomes}")
        return outcome

    def _run_child(self, label: str) -> None:
        """Thread body: runs a child and stores its outcome."""
        state = self._states[label]
        outcome: str | None = None
        error: SmachError | None = InvalidUserCodeError(f"state '{label}' ended its thread")
        try:
            outcome = self._execute_child(label, state, self._remappings[label])
            error = None
            if outcome not in state.get_registered_outcomes() and not is_shutdown():
                error = InvalidTransitionError(
                    f"state '{label}' of type {type(state).__name__} returned {outcome!r}, but its outcomes are "
                    f"{list(state.get_registered_outcomes())}"
                )
        except SmachError as raised:
            error = raised
        finally:  # also after SystemExit, so that the concurrence does not wait forever
            with self._ended:
                self._child_outcomes[label] = outcome
                self._active.remove(label)
                if error is not None:
                    log.error(f"concurrent state '{label}' failed: {error}")
                    self._errors.append(error)
                self._ended.notify_all()

    def _wait_for_children(self) -> None:
        """Waits until all children have ended; each end may stop other children."""
        known_active = list(self._states)
        while known_active:
            with self._ended:
                while self._active == known_active:
                    self._ended.wait()
                known_active = list(self._active)
                outcomes = dict(self._child_outcomes)
                failed = bool(self._errors)
            self.call_transition_cbs()
            if failed:
                self._preempt_active()
            elif known_active:
                self._call_child_termination_cb(outcomes)

    def _call_child_termination_cb(self, outcomes: dict[str, str | None]) -> None:
        if self._child_termination_cb is None:
            return
        try:
            answer = self._child_termination_cb(outcomes)
        except Exception as raised:
            error = InvalidUserCodeError(f"child termination callback raised {type(raised).__name__}: {raised}")
            error.__cause__ = raised
            with self._lock:
                self._errors.append(error)
            self._preempt_active()
            return
        if isinstance(answer, (list, tuple)):
            self._preempt_active(answer)
        elif answer:
            self._preempt_active()

    def _preempt_active(self, labels: Names | None = None) -> None:
        """Requests preemption of the running children, all or those with the given labels."""
        with self._lock:
            wanted = set(self._active if labels is None else labels)
            for label in self._active:
                if label in wanted and not self._states[label].preempt_requested():
                    self._states[label].request_preempt()

    def _decide(self, outcomes: dict[str, str | None]) -> str:
        """Returns the outcome of the concurrence for the outcomes of its children."""
        if is_shutdown() and not all(
            outcome in self._states[label].get_registered_outcomes() for label, outcome in outcomes.items()
        ):
            return "preempted"
        chosen: str | None = None
        if self._outcome_cb is not None:
            try:
                chosen = self._outcome_cb(dict(outcomes))
            except Exception as raised:
                raise InvalidUserCodeError(f"outcome callback raised {type(raised).__name__}: {raised}") from raised
        if chosen is None:
            chosen = next(
                (
                    name
                    for name, children in self._outcome_map.items()
                    if all(outcomes[label] == child_outcome for label, child_outcome in children.items())
                ),
                self._default_outcome,
            )
        if chosen not in self._outcomes:
            raise InvalidStateError(
                f"the concurrence chose the outcome {chosen!r}; its outcomes are {list(self._outcomes)}"
            )
        return chosen

    def _settle_preempt(self) -> None:
        """Acknowledges a preemption request after all children have acknowledged it; withdraws remaining requests."""
        leftovers = self._recall_leftovers()
        if self._preempt_requested and not leftovers:
            self.service_preempt()

    def _recall_leftovers(self) -> list[str]:
        leftovers = [label for label, state in self._states.items() if state.preempt_requested()]
        for label in leftovers:
            log.debug(f"state '{label}' ended without acknowledging the request to stop")
            self._states[label].recall_preempt()
        return leftovers

    def request_preempt(self) -> None:
        """Requests preemption of all running children; the concurrence waits until they have ended."""
        with self._lock:
            super().request_preempt()
            if self._running:
                self._preempt_active()
