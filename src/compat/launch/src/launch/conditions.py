# SPDX-License-Identifier: BSD-3-Clause
"""Conditions of actions, which evaluate a text or a launch configuration."""

from __future__ import annotations

from collections.abc import Iterable

from launch.core.condition import Condition
from launch.core.errors import InvalidConditionExpressionError
from launch.core.launch_context import LaunchContext
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.substitution import Substitution
from launch.core.utilities import normalize_to_list_of_substitutions, perform_substitutions

__all__ = [
    "IfCondition",
    "InvalidConditionExpressionError",
    "LaunchConfigurationEquals",
    "LaunchConfigurationNotEquals",
    "UnlessCondition",
    "evaluate_condition_expression",
]

VALID_TRUE_EXPRESSIONS, VALID_FALSE_EXPRESSIONS = ["true", "1"], ["false", "0"]


def evaluate_condition_expression(context: LaunchContext, expression: Iterable[Substitution]) -> bool:
    """Evaluates a text as true (`true`, `1`) or false (`false`, `0`), ignoring case.

    Raises:
        InvalidConditionExpressionError: The text is neither true nor false.
    """
    expression = list(expression)
    text = perform_substitutions(context, expression).strip().lower()
    if text in VALID_TRUE_EXPRESSIONS:
        return True
    if text in VALID_FALSE_EXPRESSIONS:
        return False
    written = " + ".join(each.describe() for each in expression)
    allowed = ", ".join(VALID_TRUE_EXPRESSIONS + VALID_FALSE_EXPRESSIONS)
    raise InvalidConditionExpressionError(
        f"the condition {written} is '{text}'; allowed: {allowed}; set it to an allowed value"
    )


class IfCondition(Condition):
    """Condition that holds if a text is true.

    Args:
        predicate_expression: Text of the condition, with substitutions.
    """

    _expected = True

    def __init__(self, predicate_expression: SomeSubstitutionsType) -> None:
        self._expression = normalize_to_list_of_substitutions(predicate_expression)
        super().__init__(
            predicate=lambda context: evaluate_condition_expression(context, self._expression) is self._expected
        )

    def describe(self) -> str:
        return f"{type(self).__name__}({' + '.join(each.describe() for each in self._expression)})"


class UnlessCondition(IfCondition):
    """Condition that holds if a text is false."""

    _expected = False


class LaunchConfigurationEquals(Condition):
    """Condition that holds if a launch configuration has a value; with None, if the configuration is not set.

    Args:
        launch_configuration_name: Name of the configuration.
        expected_value: Expected value, with substitutions; None for a configuration that is not set.
    """

    def __init__(self, launch_configuration_name: str, expected_value: SomeSubstitutionsType | None) -> None:
        self._name = launch_configuration_name
        self._expected = None if expected_value is None else normalize_to_list_of_substitutions(expected_value)
        super().__init__(predicate=self._compare)

    def _compare(self, context: LaunchContext) -> bool:
        expected = None if self._expected is None else perform_substitutions(context, self._expected)
        return context.read_configuration(self._name) == expected

    def describe(self) -> str:
        return f"{type(self).__name__}('{self._name}')"


class LaunchConfigurationNotEquals(LaunchConfigurationEquals):
    """Condition that holds if a launch configuration has another value or is not set; with None, if it is set."""

    def _compare(self, context: LaunchContext) -> bool:
        return not super()._compare(context)
