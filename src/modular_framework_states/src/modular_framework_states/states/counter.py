# SPDX-License-Identifier: BSD-3-Clause
"""A state that repeats a part of a task a number of times."""

from __future__ import annotations

from typing import Annotated, Any, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Limits


class Counter(FrameworkState):
    """Counts its executions: positive up to the count, then once negative, after which it restarts.

    For a loop, connect the positive outcome to the first state of the repeated part. For a retry, connect the negative
    outcomes of the part to the counter, and the counter's positive outcome to the part.

    Args:
        count: Number of positive outcomes.
        **keys: Outcomes and userdata keys of any state; the output key ``counter`` receives the number of executions.
    """

    def __init__(self, count: Annotated[int, Limits(at_least=1)], **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._count, self._passed = int(count), 0

    def execute(self, userdata: Any) -> str:
        """Increments the counter and compares it with the count."""
        self._passed += 1
        if "counter" in self.get_registered_output_keys():
            userdata.counter = self._passed
        if self._passed <= self._count:
            return self.succeed()
        self._passed = 0
        return self.fail(f"all {self._count} repetitions were used")
