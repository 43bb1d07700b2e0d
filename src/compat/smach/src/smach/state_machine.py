# SPDX-License-Identifier: BSD-3-Clause
"""A container that runs one state at a time.

Transitions from outcomes to states are followed until an outcome of the machine is reached.
"""

from __future__ import annotations

import threading
from typing import Any

from smach import log
from smach.container import Container
from smach.exceptions import InvalidStateError, InvalidTransitionError
from smach.state import State
from smach.user_data import UserData
from smach.util import NameMap, Names, is_shutdown

__all__ = ["StateMachine"]


class StateMachine(Container):
    """Runs its states according to its transitions, starting with the state added first."""

    def __init__(self, outcomes: Names, input_keys: Names = (), output_keys: Names = ()) -> None:
        """Creates an empty machine; states are added inside ``with machine:``."""
        super().__init__(outcomes, input_keys, output_keys)
        self._states: dict[str, State] = {}
        self._transitions: dict[str, dict[str, str | None]] = {}
        self._remappings: dict[str, dict[str, str]] = {}
        self._initial_label: str | None = None
        self._current_label: str | None = None
        self._preempted_label: str | None = None
        self._connector_outcomes: list[str] = []
        self._connector_label: str | None = None
        self._lock = threading.RLock()

    # ---- construction --------------------------------------------------------------------------------------
    @staticmethod
    def add(label: str, state: State, transitions: NameMap | None = None, remapping: NameMap | None = None) -> State:
        """Adds a state to the open machine.

        Args:
            label: Label of the state.
            state: State or container.
            transitions: Target label or machine outcome, keyed by the state's outcome. An outcome without an entry
                leads to the machine's outcome of the same name.
            remapping: Userdata key in the machine, keyed by key in the state.

        Returns:
            The state.

        Raises:
            smach.InvalidStateError: The label is already used, or the object is not a state.
            smach.InvalidTransitionError: A transition starts from an outcome that the state lacks.
        """
        machine: StateMachine = StateMachine._currently_opened_container()
        machine.check_state_spec(label, state, transitions or {})
        machine._connect_previous(label)
        targets: dict[str, str | None] = dict.fromkeys(state.get_registered_outcomes())
        targets.update(transitions or {})
        machine._states[label] = state
        machine._transitions[label] = targets
        machine._remappings[label] = dict(remapping or {})
        return state

    @staticmethod
    def add_auto(
        label: str,
        state: State,
        connector_outcomes: Names,
        transitions: NameMap | None = None,
        remapping: NameMap | None = None,
    ) -> State:
        """Adds a state whose connector outcomes lead to the state that is added next.

        Args:
            label: Label of the state.
            state: State or container.
            connector_outcomes: Outcomes that lead to the next state.
            transitions: See ``add``.
            remapping: See ``add``.
        """
        machine: StateMachine = StateMachine._currently_opened_container()
        connectors = [outcome for outcome in connector_outcomes if outcome not in (transitions or {})]
        for outcome in connectors:
            if outcome not in state.get_registered_outcomes():
                raise InvalidTransitionError(
                    f"state '{label}': connector outcome '{outcome}' is not an outcome of the state; "
                    f"its outcomes are {list(state.get_registered_outcomes())}"
                )
        StateMachine.add(label, state, transitions, remapping)
        machine._connector_label, machine._connector_outcomes = label, connectors
        return state

    def _connect_previous(self, label: str) -> None:
        if self._connector_label is not None:
            for outcome in self._connector_outcomes:
                self._transitions[self._connector_label][outcome] = label
        self._connector_label, self._connector_outcomes = None, []

    def check_state_spec(self, label: str, state: State, transitions: NameMap) -> None:
        """Checks that a state can be added; raises an error if not.

        Args:
            label: Label of the state.
            state: State to add.
            transitions: Outcome to label of the next state.
        """
        if label in self._states:
            raise InvalidStateError(f"the machine already has a state with the label '{label}'")
        if label in self._outcomes:
            raise InvalidStateError(f"'{label}' is an outcome of the machine and cannot also be a label")
        if not isinstance(state, State):
            raise InvalidStateError(
                f"'{label}' is a {type(state).__name__}, not a smach.State (was the class given, not an object?)"
            )
        unknown = [outcome for outcome in transitions if outcome not in state.get_registered_outcomes()]
        if unknown:
            raise InvalidTransitionError(
                f"state '{label}' has transitions from {unknown}, but its outcomes are "
                f"{list(state.get_registered_outcomes())}"
            )

    def check_consistency(self) -> None:
        """Raises an error if there are no states, or an error that lists all transitions with an unknown target."""
        if not self._states:
            raise InvalidStateError("the state machine has no states")
        if self._initial_label is not None and self._initial_label not in self._states:
            raise InvalidStateError(
                f"the initial state '{self._initial_label}' is not in the machine; it has {list(self._states)}"
            )
        known = {*self._states, *self._outcomes}
        faults = [
            f"'{outcome}' of state '{label}' leads to '{target}'"
            for outcome, label, target in self.get_internal_edges()
            if target not in known
        ]
        if faults:
            raise InvalidTransitionError(
                f"{'; '.join(faults)}: neither a state ({list(self._states)}) nor an outcome "
                f"({list(self._outcomes)}) of the machine"
            )

    # ---- inspection ----------------------------------------------------------------------------------------
    def get_children(self) -> dict[str, State]:
        """Returns the states by label, in the order of their addition."""
        return dict(self._states)

    def get_initial_states(self) -> list[str]:
        """Returns the label of the initial state in a list."""
        if self._initial_label is not None:
            return [self._initial_label]
        return list(self._states)[:1]

    def set_initial_state(self, initial_states: list[str], userdata: UserData | None = None) -> None:
        """Sets the initial state.

        Args:
            initial_states: List of exactly one label.
            userdata: Values to add to the machine's userdata.

        Raises:
            smach.InvalidStateError: The list does not contain exactly one label.
        """
        if len(initial_states) != 1:
            raise InvalidStateError(f"a state machine starts with one state, got {list(initial_states)}")
        if userdata is not None:
            self.userdata.update(userdata)
        with self._lock:
            self._initial_label = initial_states[0]

    def get_active_states(self) -> list[str]:
        """Returns the label of the running state in a list; empty while the machine is not running."""
        label = self._current_label
        return [] if label is None else [label]

    def get_internal_edges(self) -> list[tuple[str, str, str | None]]:
        """Returns the transitions as (outcome, from label, to label or outcome of the machine)."""
        return [
            (outcome, label, outcome if target is None else target)
            for label, transitions in self._transitions.items()
            for outcome, target in transitions.items()
        ]

    # ---- running -------------------------------------------------------------------------------------------
    def execute(self, parent_ud: Any = None) -> str:
        """Runs the machine until one of its outcomes is reached.

        Args:
            parent_ud: Userdata for copying the input and output keys.

        Returns:
            The outcome; ``preempted`` if the process shuts down (``set_shutdown_check``).

        Raises:
            smach.SmachError: The machine is inconsistent, a state raised an error, or a state returned an undeclared
                outcome.
        """
        self.check_consistency()
        self._copy_input_keys(parent_ud)
        label = self.get_initial_states()[0]
        log.info(f"state machine starts in state '{label}'")
        self._running = True
        self._preempted_label = None
        try:
            self._enter(label)
            self.call_start_cbs()
            outcome = self._run_from(label)
        finally:
            last = self.get_active_states()
            with self._lock:
                self._current_label = None
                self._running = False
        self._copy_output_keys(parent_ud)
        self.call_termination_cbs(last, outcome)
        return outcome

    def _run_from(self, label: str) -> str:
        while True:
            if is_shutdown():
                return self._shut_down()
            state = self._states[label]
            outcome = self._execute_child(label, state, self._remappings[label])
            self._settle_preempt(label, state)
            if is_shutdown():
                return self._shut_down()
            target = self._target(label, state, outcome)
            if target in self._outcomes:
                log.info(f"state machine ends: '{label}' gave '{outcome}', outcome '{target}'")
                return target
            log.info(f"state machine goes from '{label}' by '{outcome}' to '{target}'")
            label = target
            self._enter(label)
            self.call_transition_cbs()

    def _enter(self, label: str) -> None:
        """Sets the current state, and forwards a preemption request of the machine to this state."""
        with self._lock:
            self._current_label = label
            if self._preempt_requested:
                self._preempted_label = label
                self._states[label].request_preempt()

    def _settle_preempt(self, label: str, state: State) -> None:
        """Acknowledges the request of the machine once the preempted state has acknowledged its request."""
        with self._lock:
            if self._preempted_label != label:
                return
            if state.preempt_requested():
                log.debug(f"state '{label}' ended without acknowledging the request to stop")
                state.recall_preempt()
            else:
                self.service_preempt()
            self._preempted_label = None

    def _target(self, label: str, state: State, outcome: Any) -> str:
        if outcome not in state.get_registered_outcomes():
            raise InvalidTransitionError(
                f"state '{label}' of type {type(state).__name__} returned {outcome!r}, but its outcomes are "
                f"{list(state.get_registered_outcomes())}"
            )
        name = str(outcome)
        target = self._transitions[label].get(name)
        target = name if target is None else target
        if target not in self._states and target not in self._outcomes:
            raise InvalidTransitionError(f"'{name}' of state '{label}' leads to '{target}', which is nowhere")
        return target

    def _shut_down(self) -> str:
        log.info("state machine stops: the process is going down")
        self.service_preempt()
        return "preempted"

    def request_preempt(self) -> None:
        """Requests preemption of the running state and of states entered later."""
        with self._lock:
            super().request_preempt()
            if self._running and self._current_label is not None and self._preempted_label is None:
                self._preempted_label = self._current_label
                self._states[self._current_label].request_preempt()
