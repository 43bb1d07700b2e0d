# SPDX-License-Identifier: BSD-3-Clause
"""Lets a task repeat a part of itself a number of times."""

from __future__ import annotations

from typing import Annotated, Any, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Limits


class Counter(FrameworkState):
    """Counts how often it is passed: positive the first times, negative when the count is used up, then it starts anew.

    For a loop, lead the positive outcome to the first state of the part to repeat. For a retry, lead the negative
    outcomes of what may fail to the counter, and the counter's positive outcome back to it.

    Args:
        count: How many times it is positive.
        **keys: Outcomes and userdata keys of any state; ``counter`` receives how often it was passed, from 1, if it is
            an output key.
    """

    def __init__(self, count: Annotated[int, Limits(at_least=1)], **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._count, self._passed = int(count), 0

    def execute(self, userdata: Any) -> str:
        """Counts."""
        self._passed += 1
        if "counter" in self.get_registered_output_keys():
            userdata.counter = self._passed
        if self._passed <= self._count:
            return self.succeed()
        self._passed = 0
        return self.fail(f"all {self._count} times are used up")
