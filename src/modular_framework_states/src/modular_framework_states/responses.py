# SPDX-License-Identifier: BSD-3-Clause
"""Maps the response of a service, or the result of an action, to the outcome and userdata of a state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_uses import Fields, OutcomeNames, OutputKeys
from modular_framework_states.message_filling import FillingError, field_at

MessageFields = Annotated[Mapping[str, Any], Fields()]
OutcomeValues = Annotated[Mapping[str, Any], OutcomeNames()]
KeptFields = Annotated[Mapping[str, str], OutputKeys()]


@dataclass(frozen=True, slots=True)
class ResponseRules:
    """Rules that map a response to an outcome and userdata.

    Attributes:
        outcome_field: Field that selects the outcome; empty for none.
        outcome_values: Outcome to the value, or list of values, of that field.
        keep: Userdata key to the response field stored there.
    """

    outcome_field: str = ""
    outcome_values: Mapping[str, Any] = field(default_factory=dict)
    keep: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        state: FrameworkState,
        outcome_field: str,
        outcome_values: Mapping[str, Any] | None,
        keep: Mapping[str, str] | None,
    ) -> ResponseRules:
        """Returns the rules given by the options of a state.

        Args:
            state: State with the outcomes and output keys.
            outcome_field: Option of the state.
            outcome_values: Option of the state.
            keep: Option of the state.

        Raises:
            ValueError: The state does not declare an outcome or a key, or `outcome_values` lacks an `outcome_field`.
        """
        rules = cls(outcome_field, dict(outcome_values or {}), dict(keep or {}))
        name, output_keys = type(state).__name__, state.get_registered_output_keys()
        if rules.outcome_values and not outcome_field:
            raise ValueError(f"{name}: outcome_values without outcome_field; name the field that has the values")
        unknown = [outcome for outcome in rules.outcome_values if outcome not in state.outcomes]
        if unknown:
            raise ValueError(f"{name}: outcome_values names {unknown}; its outcomes are {state.outcomes}")
        missing = [key for key in rules.keep if key not in output_keys]
        if missing:
            raise ValueError(f"{name}: keep writes {missing}; its output keys are {sorted(output_keys)}; add them")
        return rules

    def outcome(self, response: Any, outcomes: Sequence[str]) -> str:
        """Returns the outcome selected by the response.

        Without ``outcome_values``, true selects the first outcome, false the last, an integer the outcome at that
        index, and a string the outcome with that name.

        Args:
            response: Response message.
            outcomes: Outcomes of the state.

        Raises:
            FillingError: The field does not exist, or its value selects no outcome.
        """
        value = field_at(response, self.outcome_field)
        if self.outcome_values:
            for name, wanted in self.outcome_values.items():
                if value in (wanted if isinstance(wanted, list | tuple) else [wanted]):
                    return name
            raise FillingError(
                f"{self.outcome_field} is {value!r}, which is none of outcome_values: {dict(self.outcome_values)}"
            )
        match value:
            case bool():
                return outcomes[0 if value else -1]
            case int() if 0 <= value < len(outcomes):
                return outcomes[value]
            case str() if value in outcomes:
                return value
        raise FillingError(
            f"{self.outcome_field} is {value!r}, which selects no outcome; expected a boolean, an index from "
            f"0 to {len(outcomes) - 1}, or one of {', '.join(outcomes)}; map other values with "
            "outcome_values"
        )

    def kept(self, response: Any) -> dict[str, Any]:
        """Returns the userdata taken from fields of the response.

        Raises:
            FillingError: A field does not exist.
        """
        return {key: field_at(response, path) for key, path in self.keep.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """The response of a service, or the result of an action.

    Attributes:
        message: Response message.
        what: Description of the service or action, for reasons.
        reason: Reason stated in the response.
        aborted: Whether the action was aborted, which excludes the first outcome.
    """

    message: Any
    what: str
    reason: str
    aborted: bool = False


def end_by_response(state: FrameworkState, rules: ResponseRules, response: Response, userdata: Any) -> str:
    """Ends a state by a response: stores fields in userdata and returns the outcome.

    Args:
        state: State to end.
        rules: Rules for the outcome and userdata.
        response: Response of the service or action.
        userdata: Userdata of the state.
    """
    message, what = response.message, response.what
    try:
        outcome = rules.outcome(message, state.outcomes) if rules.outcome_field else state.outcomes[0]
        if response.aborted and outcome == state.outcomes[0]:
            return state.fail(f"{what}; its {rules.outcome_field} says '{outcome}'")
        for key, value in rules.kept(message).items():
            userdata[key] = value
    except FillingError as error:
        return state.fail(f"{what}: {error}")
    if outcome == state.outcomes[0]:
        return state.succeed()
    reason = f"{what}: its {rules.outcome_field} is {field_at(message, rules.outcome_field)!r}: {response.reason}"
    return state.end(outcome, reason)
