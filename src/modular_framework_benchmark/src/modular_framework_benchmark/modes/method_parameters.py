# SPDX-License-Identifier: BSD-3-Clause
"""Parameters of a method that an experiment file gives, for a mode without a parameter server."""

from __future__ import annotations

import math
from collections.abc import Mapping

from modular_framework_benchmark.modes.errors import ModeError


class GivenNumbers:
    """Reads numbers that were given by name; implements `ReadNumber` of the grasp methods.

    Args:
        values: Numbers by name, without the ~ of a node's own parameters.
    """

    def __init__(self, values: Mapping[str, float]) -> None:
        self._values = values
        self._known: set[str] = set()

    def __call__(self, name: str, default: float, low: float = -math.inf, high: float = math.inf) -> float:
        """Returns a number; its default when it was not given.

        Raises:
            ModeError: It is out of range.
        """
        key = name.removeprefix("~")
        self._known.add(key)
        value = float(self._values.get(key, default))
        if not low <= value <= high:
            raise ModeError(f"method_parameters: '{key}' is {value:g}; allowed is a number from {low:g} to {high:g}")
        return value

    def check_all_read(self) -> None:
        """Checks, once the method has read its parameters, that it has all that were given.

        Raises:
            ModeError: It did not ask for one, so that one would have no effect.
        """
        unknown = sorted(set(self._values) - self._known)
        if unknown:
            raise ModeError(
                f"method_parameters: the method has no {' and no '.join(map(repr, unknown))}; allowed are "
                f"{', '.join(sorted(self._known)) or 'none'}"
            )
