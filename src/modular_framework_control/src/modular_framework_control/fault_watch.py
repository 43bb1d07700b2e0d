# SPDX-License-Identifier: BSD-3-Clause
"""Asks the hardware in every cycle whether it follows, and tells the log when that changes."""
from __future__ import annotations

from collections.abc import Sequence

from modular_framework_control.controller_switch import LOGGER
from modular_framework_control.robot_hw import HardwareFault, RobotHW


class FaultWatch:
    """What one hardware suffers from.

    Args:
        robot_hw: the hardware.

    Attributes:
        text: why it could not follow when it was asked last; "" when it could.
    """

    def __init__(self, robot_hw: RobotHW) -> None:
        self._robot_hw = robot_hw
        self.text = ""

    def ask(self) -> Sequence[HardwareFault]:
        """The faults it has now, with the joints they are about; never raises."""
        try:
            faults = self._robot_hw.faults()
            if faults:  # a user's hardware may tell anything, an exception for example
                faults = [HardwareFault(str(fault.reason), frozenset(fault.joints)) for fault in faults]
        except Exception as error:  # a user's hardware may raise anything; what cannot tell is not to be trusted
            faults = (HardwareFault(f"fault() raised {type(error).__name__}: {error}",
                                    self._robot_hw.commanded_joints),)
        if faults or self.text:
            self._tell("; ".join(fault.reason for fault in faults))
        return faults

    def _tell(self, text: str) -> None:
        if text and text != self.text:
            LOGGER.error("hardware fault: %s; controllers of its joints hold until it is over", text)
        elif not text:
            LOGGER.info("the hardware follows again (it did not for: %s)", self.text)
        self.text = text
