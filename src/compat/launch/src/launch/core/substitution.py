# SPDX-License-Identifier: BSD-3-Clause
"""Substitution: a text that is known only while a description is launched."""

from __future__ import annotations

from launch.core.launch_context import LaunchContext


class Substitution:
    """Base of everything that stands for a text and gets its value in a launch context."""

    def describe(self) -> str:
        """Returns how the substitution is written, for listings of arguments and for messages."""
        return f"{type(self).__name__}()"

    def perform(self, context: LaunchContext) -> str:
        """Returns the text.

        Raises:
            SubstitutionFailure: There is no value in this context.
        """
        raise NotImplementedError(f"{type(self).__name__} does not say its value: define perform(context)")


class TextSubstitution(Substitution):
    """A text.

    Args:
        text: The text.
    """

    def __init__(self, *, text: str) -> None:
        if not isinstance(text, str):
            raise TypeError(f"TextSubstitution: text is {text!r} of type {type(text).__name__}; allowed: a text")
        self._text = text

    @property
    def text(self) -> str:
        """The text."""
        return self._text

    def describe(self) -> str:
        return f"'{self._text}'"

    def perform(self, context: LaunchContext) -> str:
        del context
        return self._text
