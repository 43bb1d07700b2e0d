# SPDX-License-Identifier: BSD-3-Clause
"""Substitution, a text that is only known during the launch."""

from __future__ import annotations

from launch.core.launch_context import LaunchContext


class Substitution:
    """Base class of substitutions, which are replaced by a text in a launch context."""

    def describe(self) -> str:
        """Returns a description of the substitution for argument listings and messages."""
        return f"{type(self).__name__}()"

    def perform(self, context: LaunchContext) -> str:
        """Returns the text.

        Raises:
            SubstitutionFailure: The substitution has no value in this context.
        """
        raise NotImplementedError(f"{type(self).__name__} has no value; define perform(context)")


class TextSubstitution(Substitution):
    """Constant text.

    Args:
        text: The text.
    """

    def __init__(self, *, text: str) -> None:
        if not isinstance(text, str):
            raise TypeError(f"TextSubstitution: text is {text!r} of type {type(text).__name__}; allowed: a text")
        self._text = text

    @property
    def text(self) -> str:
        """Returns the text."""
        return self._text

    def describe(self) -> str:
        return f"'{self._text}'"

    def perform(self, context: LaunchContext) -> str:
        del context
        return self._text
