# SPDX-License-Identifier: BSD-3-Clause
"""A state machine whose states follow each other in the order they were added."""

from __future__ import annotations

from smach.exceptions import InvalidStateError
from smach.state import State
from smach.state_machine import StateMachine
from smach.util import NameMap, Names

__all__ = ["Sequence"]


class Sequence(StateMachine):
    """Each state's connector outcome leads to the next state; the last one's leads out of the sequence."""

    def __init__(
        self, outcomes: Names, connector_outcome: str, input_keys: Names = (), output_keys: Names = ()
    ) -> None:
        """Makes an empty sequence.

        Args:
            outcomes: names of the outcomes.
            connector_outcome: the outcome of a state that leads to the next state.
            input_keys: userdata keys copied from the parent before it runs.
            output_keys: userdata keys copied to the parent after it has run.
        """
        super().__init__(outcomes, input_keys, output_keys)
        self._connector_outcome = connector_outcome

    @staticmethod
    def add(label: str, state: State, transitions: NameMap | None = None, remapping: NameMap | None = None) -> State:
        """Adds a state to the sequence that is open.

        Args:
            label: its name in this sequence.
            state: the state, or a container; it must have the connector outcome.
            transitions: where its other outcomes lead; one from the connector outcome breaks the sequence there.
            remapping: userdata name in the state -> userdata name in this sequence.

        Raises:
            smach.InvalidStateError: the label is taken, or the object is not a state.
            smach.InvalidTransitionError: the state lacks the connector outcome, or one in ``transitions``.
        """
        sequence: Sequence = Sequence._currently_opened_container()
        if not isinstance(state, State):
            raise InvalidStateError(f"'{label}' is a {type(state).__name__}, not a smach.State")
        return StateMachine.add_auto(label, state, [sequence._connector_outcome], transitions, remapping)
