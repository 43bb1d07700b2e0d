# SPDX-License-Identifier: BSD-3-Clause
"""Reads the faults of the hardware in every cycle, and logs when they change."""

from __future__ import annotations

from collections.abc import Sequence

from modular_framework_control.controller_manager.controller_switch import LOGGER
from modular_framework_control.hardware_interface.robot_hw import HardwareFault, RobotHW


class FaultWatch:
    """The faults of one hardware.

    Args:
        robot_hw: the hardware.

    Attributes:
        text: the faults of the last cycle in one text; "" if there were none.
    """

    def __init__(self, robot_hw: RobotHW) -> None:
        self._robot_hw = robot_hw
        self.text = ""

    def faults(self, log: bool = True) -> Sequence[HardwareFault]:
        """Returns the faults at the moment, with the joints they concern, and logs a change; never raises."""
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
            LOGGER.error("hardware fault: %s; controllers of its joints hold until it is over", text)
        elif not text:
            LOGGER.info("the hardware follows again (it did not for: %s)", self.text)
