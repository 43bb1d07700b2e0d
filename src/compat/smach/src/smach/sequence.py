# SPDX-License-Identifier: BSD-3-Clause
"""A state machine whose states run in the order of their addition."""

from __future__ import annotations

from smach.exceptions import InvalidStateError
from smach.state import State
from smach.state_machine import StateMachine
from smach.util import NameMap, Names

__all__ = ["Sequence"]


class Sequence(StateMachine):
    """Connects each state's connector outcome to the next state, and the last state's to the end of the sequence."""

    def __init__(
        self, outcomes: Names, connector_outcome: str, input_keys: Names = (), output_keys: Names = ()
    ) -> None:
        """Creates an empty sequence.

        Args:
            outcomes: Names of the outcomes.
            connector_outcome: Outcome of a state that leads to the next state.
            input_keys: Userdata keys copied from the parent before the sequence runs.
            output_keys: Userdata keys copied to the parent after the sequence has run.
        """
        super().__init__(outcomes, input_keys, output_keys)
        self._connector_outcome = connector_outcome

    @staticmethod
    def add(label: str, state: State, transitions: NameMap | None = None, remapping: NameMap | None = None) -> State:
        """Adds a state to the open sequence.

        Args:
            label: Label of the state.
            state: State or container; it must have the connector outcome.
            transitions: Targets of its other outcomes; a target of the connector outcome breaks the sequence there.
            remapping: Userdata key in the sequence, keyed by key in the state.

        Raises:
            smach.InvalidStateError: The label is already used, or the object is not a state.
            smach.InvalidTransitionError: The state lacks the connector outcome or an outcome in ``transitions``.
        """
        sequence: Sequence = Sequence._currently_opened_container()
        if not isinstance(state, State):
            raise InvalidStateError(f"'{label}' is a {type(state).__name__}, not a smach.State")
        return StateMachine.add_auto(label, state, [sequence._connector_outcome], transitions, remapping)
