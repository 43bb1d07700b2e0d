# SPDX-License-Identifier: BSD-3-Clause
"""Substitutions with the values `true` or `false`, and a selection between two texts."""

from __future__ import annotations

import math

from launch.core.errors import LaunchError
from launch.core.launch_context import LaunchContext
from launch.core.some_substitutions_type import SomeSubstitutionsType
from launch.core.substitution import Substitution
from launch.core.utilities import (
    normalize_to_list_of_substitutions,
    perform_boolean,
    perform_substitutions,
    perform_text,
)
from launch.substitutions.text import described


def _text(truth: bool) -> str:
    return "true" if truth else "false"


class _OfTexts(Substitution):
    """Base class of logical functions of several texts."""

    def __init__(self, *values: SomeSubstitutionsType) -> None:
        self._values = [normalize_to_list_of_substitutions(each) for each in values]

    def describe(self) -> str:
        return f"{type(self).__name__}({', '.join(described(each) for each in self._values)})"

    def perform(self, context: LaunchContext) -> str:
        return _text(self._is_true(context))

    def _booleans(self, context: LaunchContext) -> list[bool]:
        return [perform_boolean(context, each, f"an operand of {self.describe()}") for each in self._values]

    def _is_true(self, context: LaunchContext) -> bool:
        raise NotImplementedError


class EqualsSubstitution(_OfTexts):
    """Returns whether two texts are equal, or have the same bool or number.

    Args:
        left: First text.
        right: Second text.
    """

    def __init__(self, left: object, right: object) -> None:
        super().__init__(_as_text(left), _as_text(right))

    def _is_true(self, context: LaunchContext) -> bool:
        left, right = (perform_substitutions(context, each) for each in self._values)
        if left == right:
            return True
        try:
            return perform_boolean(context, left, "") == perform_boolean(context, right, "")
        except LaunchError:
            pass
        try:
            return math.isclose(float(left), float(right))
        except ValueError:
            return False


def _as_text(value: object) -> SomeSubstitutionsType:
    return str(value) if isinstance(value, bool | int | float) else value  # type: ignore[return-value]


class NotEqualsSubstitution(EqualsSubstitution):
    """Returns whether two texts differ."""

    def _is_true(self, context: LaunchContext) -> bool:
        return not super()._is_true(context)


class NotSubstitution(_OfTexts):
    """Returns whether a text is false.

    Args:
        value: The text.
    """

    def __init__(self, value: SomeSubstitutionsType) -> None:
        super().__init__(value)

    def _is_true(self, context: LaunchContext) -> bool:
        return not self._booleans(context)[0]


class AllSubstitution(_OfTexts):
    """Returns whether all texts are true."""

    def _is_true(self, context: LaunchContext) -> bool:
        return all(self._booleans(context))


class AnySubstitution(_OfTexts):
    """Returns whether any text is true."""

    def _is_true(self, context: LaunchContext) -> bool:
        return any(self._booleans(context))


class _OfTwoTexts(_OfTexts):
    """Base class of logical functions of two texts.

    Args:
        left: First text.
        right: Second text.
    """

    def __init__(self, left: SomeSubstitutionsType, right: SomeSubstitutionsType) -> None:
        super().__init__(left, right)


class AndSubstitution(_OfTwoTexts, AllSubstitution):
    """Returns whether both texts are true."""


class OrSubstitution(_OfTwoTexts, AnySubstitution):
    """Returns whether any of two texts is true."""


class IfElseSubstitution(Substitution):
    """Selects one of two texts.

    Args:
        condition: Text that is true or false.
        if_value: Text for a true condition.
        else_value: Text for a false condition.
    """

    def __init__(
        self,
        condition: SomeSubstitutionsType,
        if_value: SomeSubstitutionsType = "",
        else_value: SomeSubstitutionsType = "",
    ) -> None:
        self._condition = normalize_to_list_of_substitutions(condition)
        self._values = (if_value, else_value)

    def describe(self) -> str:
        return f"IfElse({described(self._condition)})"

    def perform(self, context: LaunchContext) -> str:
        truth = perform_boolean(context, self._condition, f"the condition of {self.describe()}")
        return perform_text(context, self._values[0 if truth else 1])
