# SPDX-License-Identifier: BSD-3-Clause
"""A state to begin with: copy it, name the file after your class (open_door.py: OpenDoor) and change it.

A task finds it by ``states_directory:=<its folder>`` and ``source: my_state``. Its test, test_my_state.py, is beside
it.
"""

from __future__ import annotations

from typing import Any, Literal, Unpack

from modular_framework_core.state_api.constructor_keys import StateKeys
from modular_framework_core.state_api.framework_state import FrameworkState
from modular_framework_core.state_api.option_limits import Positive


class MyState(FrameworkState):
    """Says in one sentence what it does, and when it is positive.

    Args:
        side: One of several words; the annotation is what a task file is checked against.
        timeout: A number above 0, with its unit [s].
        **keys: Outcomes and userdata keys of any state; ``chosen_side`` receives the side if it is an output key.
    """

    def __init__(self, side: Literal["left", "right"], timeout: Positive = 5.0, **keys: Unpack[StateKeys]) -> None:
        super().__init__(**keys)
        self._side, self._timeout_s = side, float(timeout)

    def execute(self, userdata: Any) -> str:
        """Does the work; a request to stop ends ``wait_until`` and the calls of ``modular_framework_ros.calls``."""
        self.feedback = f"looking to the {self._side}"
        if not self.wait_until(self._is_done, self._timeout_s):
            return self.fail(f"nothing was seen on the {self._side} within {self._timeout_s} s")
        if "chosen_side" in self.get_registered_output_keys():
            userdata.chosen_side = self._side
        return self.succeed()

    def _is_done(self) -> bool:
        return self._side == "left"
