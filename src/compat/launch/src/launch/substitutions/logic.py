# SPDX-License-Identifier: BSD-3-Clause
"""Substitutions that are `true` or `false`, and the choice between two texts."""

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
    """Base: a truth about several texts."""

    def __init__(self, *values: SomeSubstitutionsType) -> None:
        self._values = [normalize_to_list_of_substitutions(each) for each in values]

    def describe(self) -> str:
        return f"{type(self).__name__}({', '.join(described(each) for each in self._values)})"

    def perform(self, context: LaunchContext) -> str:
        return _text(self._holds(context))

    def _truths(self, context: LaunchContext) -> list[bool]:
        return [perform_boolean(context, each, f"an operand of {self.describe()}") for each in self._values]

    def _holds(self, context: LaunchContext) -> bool:
        raise NotImplementedError


class EqualsSubstitution(_OfTexts):
    """Whether two texts are equal, or say the same truth or number.

    Args:
        left: One text.
        right: The other.
    """

    def __init__(self, left: object, right: object) -> None:
        super().__init__(_as_text(left), _as_text(right))

    def _holds(self, context: LaunchContext) -> bool:
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
    """Whether two texts differ."""

    def _holds(self, context: LaunchContext) -> bool:
        return not super()._holds(context)


class NotSubstitution(_OfTexts):
    """Whether a text says false.

    Args:
        value: The text.
    """

    def __init__(self, value: SomeSubstitutionsType) -> None:
        super().__init__(value)

    def _holds(self, context: LaunchContext) -> bool:
        return not self._truths(context)[0]


class AllSubstitution(_OfTexts):
    """Whether all texts say true."""

    def _holds(self, context: LaunchContext) -> bool:
        return all(self._truths(context))


class AnySubstitution(_OfTexts):
    """Whether a text says true."""

    def _holds(self, context: LaunchContext) -> bool:
        return any(self._truths(context))


class _OfTwoTexts(_OfTexts):
    """Base: a truth about two texts.

    Args:
        left: One text.
        right: The other.
    """

    def __init__(self, left: SomeSubstitutionsType, right: SomeSubstitutionsType) -> None:
        super().__init__(left, right)


class AndSubstitution(_OfTwoTexts, AllSubstitution):
    """Whether both texts say true."""


class OrSubstitution(_OfTwoTexts, AnySubstitution):
    """Whether one of two texts says true."""


class IfElseSubstitution(Substitution):
    """One text or another.

    Args:
        condition: A text that says true or false.
        if_value: Taken when it says true.
        else_value: Taken when it says false.
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
