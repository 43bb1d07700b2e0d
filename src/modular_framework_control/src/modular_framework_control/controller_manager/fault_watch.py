# SPDX-License-Identifier: BSD-3-Clause
"""Monitor of hardware faults that logs changes."""

from __future__ import annotations

from collections.abc import Sequence

from modular_framework_control.controller_manager.controller_switch import LOGGER
from modular_framework_control.hardware_interface.robot_hw import HardwareFault, RobotHW


class FaultWatch:
    """Reads the faults of a robot's hardware in every cycle.

    Args:
        robot_hw: Hardware to monitor.

    Attributes:
        text: Faults of the last cycle in one text, or "".
    """

    def __init__(self, robot_hw: RobotHW) -> None:
        self._robot_hw = robot_hw
        self.text = ""

    def faults(self, log: bool = True) -> Sequence[HardwareFault]:
        """Returns the current faults with their joints, and logs changes; never raises."""
        try:
            faults = self._robot_hw.faults()
            if faults:  # user code may return values of any type
                faults = [HardwareFault(str(fault.reason), frozenset(fault.joints)) for fault in faults]
        except Exception as error:  # user code may raise anything; hardware in an unknown state counts as faulty
            faults = (
                HardwareFault(f"fault() raised {type(error).__name__}: {error}", self._robot_hw.commanded_joints),
            )
        if faults or self.text:
            text = "; ".join(fault.reason for fault in faults)
            if log:
                self._log_change(text)
            self.text = text
        return faults

    def _log_change(self, text: str) -> None:
        if text and text != self.text:
            LOGGER.error("hardware fault: %s; controllers hold the affected joints until the fault ends", text)
        elif not text:
            LOGGER.info("the hardware has recovered (from: %s)", self.text)
