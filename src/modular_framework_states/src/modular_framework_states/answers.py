# SPDX-License-Identifier: BSD-3-Clause
"""The outcome and the userdata that a task derives from the answer of a service or action."""

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
class AnswerRules:
    """Rules that map an answer to an outcome and userdata.

    Attributes:
        outcome_field: Field that decides about the outcome; empty when none does.
        outcome_values: Outcome to the value of the field, or a list of values, that stands for it.
        keep: Userdata key to the field that it receives.
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
    ) -> AnswerRules:
        """Returns the rules that the options of a state give.

        Raises:
            ValueError: The state does not declare an outcome or a key, or values are given without a field.
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

    def outcome(self, answer: Any, outcomes: Sequence[str]) -> str:
        """Returns the outcome that the answer's field stands for.

        Without ``outcome_values`` a true value stands for the first outcome and a false one for the last, a whole
        number for the outcome with that number, from 0, and a text for the outcome of that name.

        Raises:
            FillingError: The field is not there, or its value stands for no outcome.
        """
        value = field_at(answer, self.outcome_field)
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
            f"{self.outcome_field} is {value!r}, which stands for no outcome; allowed are a truth "
            f"value, 0 to {len(outcomes) - 1}, or one of {', '.join(outcomes)}; say others in "
            "outcome_values"
        )

    def kept(self, answer: Any) -> dict[str, Any]:
        """Returns the userdata that fields of the answer give.

        Raises:
            FillingError: A field is not there.
        """
        return {key: field_at(answer, path) for key, path in self.keep.items()}


def end_with(
    state: FrameworkState,
    rules: AnswerRules,
    answer: Any,
    userdata: Any,
    what: str,
    reason_given: str,
    aborted: bool = False,
) -> str:
    """Ends a state by an answer: keeps its fields and returns the outcome.

    Args:
        state: The state.
        rules: How the outcome follows from it.
        answer: The answer.
        userdata: Where fields are kept.
        what: What answered, for reasons.
        reason_given: Reason in the answer.
        aborted: Whether what answered calls it a failure, which the first outcome cannot be then.
    """
    try:
        outcome = rules.outcome(answer, state.outcomes) if rules.outcome_field else state.outcomes[0]
        if aborted and outcome == state.outcomes[0]:
            return state.fail(f"{what}; its {rules.outcome_field} says '{outcome}'")
        for key, value in rules.kept(answer).items():
            userdata[key] = value
    except FillingError as error:
        return state.fail(f"{what}: {error}")
    if outcome == state.outcomes[0]:
        return state.succeed()
    reason = f"{what}: its {rules.outcome_field} is {field_at(answer, rules.outcome_field)!r}: {reason_given}"
    return state.end(outcome, reason)
